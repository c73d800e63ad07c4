// SPDX-License-Identifier: Apache-2.0
// Options that are quantities: a number in the option's own unit, or with a unit as in robot files (`--by 5`,
// `--by 5deg`, `--by "0.1 rad"`). The help says the unit, also of the default.
#pragma once

#include <CLI/CLI.hpp>
#include <expected>
#include <optional>
#include <string>

#include "config/joint_units.hpp"

namespace takt::cli {

// `value` is in `unit`, one of config::units(), and holds the default.
CLI::Option* add_quantity(CLI::App& command, const std::string& name, double& value, const std::string& unit,
                          const std::string& meaning);

// A quantity of a joint whose kind its robot file alone says. It moves the joint: a number alone, but 0, is refused.
class JointOption {
 public:
  // Of a hinge and of a slide, of config::units().
  struct Units {
    std::string hinge, slide;
  };
  // The object must outlive `command`. `otherwise`: in either unit.
  CLI::Option* add(CLI::App& command, const std::string& name, const Units& units, const std::string& meaning,
                   std::optional<double> otherwise = {});
  // In base units. Nothing: it was not given and has no default. The error is a sentence: given in the other kind's
  // unit.
  [[nodiscard]] std::expected<std::optional<double>, std::string> of(const config::Joint& joint) const;

 private:
  std::string name_, text_;  // text_: as it was given
  config::Unit hinge_{}, slide_{};
  std::optional<double> value_;            // in the units above
  std::optional<config::JointKind> kind_;  // whose unit it was given in
};

}  // namespace takt::cli

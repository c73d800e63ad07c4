// SPDX-License-Identifier: Apache-2.0
#include "cli/quantity_option.hpp"

#include <fmt/format.h>

#include <algorithm>

#include "config/units.hpp"

namespace takt::cli {

namespace {

config::Unit unit_of(const std::string& symbol) {
  return *std::ranges::find(config::units(), symbol, &config::Unit::symbol);
}

}  // namespace

CLI::Option* add_quantity(CLI::App& command, const std::string& name, double& value, const std::string& unit,
                          const std::string& meaning) {
  const auto [symbol, dimension, factor] = unit_of(unit);
  CLI::Option* const option = command.add_option(name, value, meaning);
  option->transform(CLI::Validator(
      [dimension, factor](std::string& text) -> std::string {
        if (config::parse_number(text)) return {};
        const auto read = config::parse_quantity(text, dimension);
        if (!read) return read.error();
        text = fmt::format("{}", *read / factor);
        return {};
      },
      ""));
  option->type_name(unit);
  return option;
}

CLI::Option* JointOption::add(CLI::App& command, const std::string& name, const Units& units,
                              const std::string& meaning, std::optional<double> otherwise) {
  name_ = name;
  hinge_ = unit_of(units.hinge);
  slide_ = unit_of(units.slide);
  value_ = otherwise;
  CLI::Option* const option = command.add_option_function<double>(
      name, [this](const double& value) { value_ = value; }, meaning);
  option->transform(CLI::Validator(
      [this](std::string& text) -> std::string {
        text_ = text;
        if (const auto number = config::parse_number(text)) {
          if (*number == 0) return {};
          return fmt::format("{} has no unit; write it in {}, of a slide in {}", text,
                             config::symbols(hinge_.dimension), config::symbols(slide_.dimension));
        }
        const auto hinge = config::parse_quantity(text, hinge_.dimension);
        const auto slide = config::parse_quantity(text, slide_.dimension);
        if (!hinge && !slide) return hinge.error() + "; of a slide in " + config::symbols(slide_.dimension);
        kind_ = hinge ? config::JointKind::hinge : config::JointKind::slide;
        text = fmt::format("{}", hinge ? *hinge / hinge_.factor : *slide / slide_.factor);
        return {};
      },
      ""));
  option->type_name(units.hinge + "|" + units.slide);
  if (otherwise) option->default_str(fmt::format("{}", *otherwise));
  return option;
}

std::expected<std::optional<double>, std::string> JointOption::of(const config::Joint& joint) const {
  const config::Unit& unit = joint.kind == config::JointKind::slide ? slide_ : hinge_;
  if (kind_ && *kind_ != joint.kind)
    return std::unexpected(fmt::format("{}: {}: {} {}", name_, config::parse_quantity(text_, unit.dimension).error(),
                                       joint.name, joint.kind == config::JointKind::slide ? "slides" : "turns"));
  return value_ ? std::optional(*value_ * unit.factor) : std::nullopt;
}

}  // namespace takt::cli

// SPDX-License-Identifier: Apache-2.0
#include "cli/quantity_option.hpp"

#include <fmt/format.h>

#include <algorithm>

#include "config/units.hpp"

namespace takt::cli {

CLI::Option* add_quantity(CLI::App& command, const std::string& name, double& value, const std::string& unit,
                          const std::string& meaning) {
  const auto known = std::ranges::find(config::units(), unit, &config::Unit::symbol);
  const auto dimension = known->dimension;
  const double factor = known->factor;
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

}  // namespace takt::cli

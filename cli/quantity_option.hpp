// SPDX-License-Identifier: Apache-2.0
// Options that are quantities: a number in the option's own unit, or with a unit as in robot files (`--by 5`,
// `--by 5deg`, `--by "0.1 rad"`). The help says the unit, also of the default.
#pragma once

#include <CLI/CLI.hpp>
#include <string>

namespace takt::cli {

// `value` is in `unit`, one of config::units(), and holds the default.
CLI::Option* add_quantity(CLI::App& command, const std::string& name, double& value, const std::string& unit,
                          const std::string& meaning);

}  // namespace takt::cli

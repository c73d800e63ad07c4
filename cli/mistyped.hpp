// SPDX-License-Identifier: Apache-2.0
// The command or option that an unknown one was probably meant to be.
#pragma once

#include <CLI/CLI.hpp>
#include <optional>
#include <string>
#include <vector>

namespace takt::cli {

// The first of `words` (behind the program's name) that no command or option is called by, as a sentence with the
// nearest one there is; none: every word is known, or is a value.
std::optional<std::string> mistyped(const CLI::App& app, const std::vector<std::string>& words);

}  // namespace takt::cli

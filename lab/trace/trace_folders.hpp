// SPDX-License-Identifier: Apache-2.0
// Finds the CTF traces inside what a user calls a trace.
#pragma once

#include <expected>
#include <string>
#include <vector>

namespace takt::lab {

// The folders with CTF metadata at or below `directory`, sorted. Several snapshots of one flight recorder tell the same
// ticks twice: then, as without any trace, the error says what to name instead.
std::expected<std::vector<std::string>, std::string> trace_folders(const std::string& directory);

}  // namespace takt::lab

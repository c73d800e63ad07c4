// SPDX-License-Identifier: Apache-2.0
// The reference of every key, as a Markdown table, from the same declarations the reader uses.
#pragma once

#include <string>
#include <string_view>

namespace takt::config {

std::string key_table();

// What a key of the robot file means, whatever else its section says: of "joints[3].drive.mode" the table's
// "cia402: cyclic synchronous ...". Empty: there is no such key. Lives as long as the program.
std::string_view meaning_of_key(std::string_view path);

}  // namespace takt::config

// SPDX-License-Identifier: Apache-2.0
// The reference of every key, as a Markdown table, from the same declarations the reader uses.
#pragma once

#include <string>

namespace takt::config {

std::string key_table();

}  // namespace takt::config

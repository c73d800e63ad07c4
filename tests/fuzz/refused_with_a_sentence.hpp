// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <cstdlib>
#include <expected>
#include <string>

namespace takt::fuzz {

// What is refused is refused in words.
template <class Value>
void judge(const std::expected<Value, std::string>& read) {
  if (!read && read.error().empty()) std::abort();
}

}  // namespace takt::fuzz

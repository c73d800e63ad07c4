// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <algorithm>
#include <cstdio>
#include <cstdlib>
#include <expected>
#include <string>
#include <string_view>

#include "config/printable.hpp"

namespace takt::fuzz {

// Fit for a terminal, a log and JSON.
inline void require_printable(std::string_view text) {
  if (config::printable(text) == text) return;
  std::fprintf(stderr, "not printable: %s\n", config::printable(text).c_str());
  std::abort();
}

inline void require_sentence(std::string_view text) {
  require_printable(text);
  if (text.empty() || text.contains('\n')) {
    std::fprintf(stderr, "not one line: `%s`\n", std::string(text).c_str());
    std::abort();
  }
}

// What is refused is refused in printable words.
template <class Value>
void judge(const std::expected<Value, std::string>& read) {
  if (read) return;
  if (read.error().empty()) std::abort();
  require_printable(read.error());
}

// In one sentence.
template <class Value>
void check_refusal(const std::expected<Value, std::string>& read) {
  if (!read) require_sentence(read.error());
}

}  // namespace takt::fuzz

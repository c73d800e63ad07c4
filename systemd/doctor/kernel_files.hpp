// SPDX-License-Identifier: Apache-2.0
// How the kernel's one-line files are read. What is absent or malformed reads as empty.
#pragma once

#include <charconv>
#include <cstdint>
#include <fstream>
#include <optional>
#include <string>

namespace takt::doctor {

inline std::string first_line(const std::string& path) {
  std::ifstream file(path);
  std::string line;
  std::getline(file, line);
  return line;
}

inline std::optional<std::int64_t> number_in(const std::string& path) {
  const std::string text = first_line(path);
  std::int64_t value = 0;
  const auto [end, error] = std::from_chars(text.data(), text.data() + text.size(), value);
  if (error != std::errc{}) return std::nullopt;
  return value;
}

}  // namespace takt::doctor

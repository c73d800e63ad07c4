// SPDX-License-Identifier: Apache-2.0
#include "config/printable.hpp"

#include <fmt/format.h>

#include <cstddef>

namespace takt::config {
namespace {

unsigned char byte(std::string_view text, std::size_t at) {
  return at < text.size() ? static_cast<unsigned char>(text[at]) : 0;
}

bool continues(unsigned char c) {
  return (c & 0xC0U) == 0x80;
}

// A control character, which a terminal obeys instead of showing it: C0 but the newline, DEL, C1.
bool is_obeyed(std::string_view character) {
  const unsigned char first = byte(character, 0);
  if (first == 0xC2) return byte(character, 1) < 0xA0;
  return (first < 0x20 && first != '\n') || first == 0x7F;
}

}  // namespace

std::size_t utf8_length(std::string_view text) {
  const unsigned char first = byte(text, 0), second = byte(text, 1);
  if (first < 0x80) return text.empty() ? 0 : 1;
  if (first < 0xC2 || first > 0xF4 || !continues(second)) return 0;
  if (first < 0xE0) return 2;
  const bool overlong = (first == 0xE0 && second < 0xA0) || (first == 0xF0 && second < 0x90);
  const bool beyond = (first == 0xED && second >= 0xA0) || (first == 0xF4 && second >= 0x90);
  if (overlong || beyond || !continues(byte(text, 2))) return 0;
  if (first < 0xF0) return 3;
  return continues(byte(text, 3)) ? 4 : 0;
}

std::string printable(std::string_view text) {
  std::string shown;
  shown.reserve(text.size());
  while (!text.empty()) {
    const std::size_t length = is_obeyed(text) ? 0 : utf8_length(text);
    if (length == 0) shown += fmt::format("\\x{:02x}", byte(text, 0));
    shown += text.substr(0, length);
    text.remove_prefix(length == 0 ? 1 : length);
  }
  return shown;
}

}  // namespace takt::config

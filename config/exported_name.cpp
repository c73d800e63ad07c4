// SPDX-License-Identifier: Apache-2.0
#include "config/exported_name.hpp"

#include <fmt/format.h>

#include <algorithm>
#include <iterator>

#include "config/robot_text.hpp"

namespace takt::config {
namespace {

constexpr std::size_t kLongest = 127, kShown = 60;

bool is_of_names(char c) {
  return (c >= 'a' && c <= 'z') || (c >= 'A' && c <= 'Z') || (c >= '0' && c <= '9') ||
         std::string_view(" _-+./:()").find(c) != std::string_view::npos;
}

// Nothing beyond ASCII either: a character there may turn the line around.
std::string shown(std::string_view text) {
  std::string ascii;
  for (const char c : in_quotes(text)) {
    const auto byte = static_cast<unsigned char>(c);
    if (byte < 0x80)
      ascii += c;
    else
      ascii += fmt::format("\\x{:02x}", byte);
  }
  return ascii;
}

std::string what_is_wrong(std::string_view text) {
  if (text.empty()) return "is empty";
  if (text.size() > kLongest) return fmt::format("has {} characters", text.size());
  const auto odd = std::ranges::find_if_not(text, is_of_names) - text.begin();
  if (odd != std::ssize(text)) return fmt::format("holds {}", shown(text.substr(static_cast<std::size_t>(odd), 1)));
  if (text.starts_with(' ') || text.ends_with(' ')) return "begins or ends with a blank";
  if (text.ends_with(':') || text.find(": ") != std::string_view::npos) return "holds a colon with nothing behind it";
  return {};
}

}  // namespace

std::string why_no_name(std::string_view text) {
  const std::string wrong = what_is_wrong(text);
  if (wrong.empty()) return {};
  return fmt::format("{}{} {}, and is no name; use up to {} letters, digits, blanks and _ - + . / : ( )",
                     shown(text.substr(0, kShown)), text.size() > kShown ? "..." : "", wrong, kLongest);
}

}  // namespace takt::config

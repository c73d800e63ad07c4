// SPDX-License-Identifier: Apache-2.0
#include "config/robot_text.hpp"

#include "config/printable.hpp"
#include "config/reader.hpp"

namespace takt::config {

std::string on_one_line(std::string_view text) {
  std::string line;
  for (const char c : printable(text))
    if (c == '\n')
      line += "\\n";
    else
      line += c;
  return line;
}

std::string in_quotes(std::string_view text) {
  std::string escaped;
  for (const char c : text) {
    if (c == '"' || c == '\\') escaped += '\\';
    escaped += c;
  }
  return '"' + on_one_line(escaped) + '"';
}

std::string plain_or_quoted(std::string_view text) {
  return is_identifier(text) ? std::string(text) : in_quotes(text);
}

}  // namespace takt::config

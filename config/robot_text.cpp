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

std::string as_identifier(std::string_view text, std::string_view prefix) {
  constexpr std::size_t kLongest = 63;
  std::string name(text);
  if (is_identifier(name)) return name;
  for (char& c : name)
    if (!is_identifier(std::string("a") + c)) c = '_';
  if (!is_identifier(name.substr(0, 1))) name.insert(0, prefix);
  return name.substr(0, kLongest);
}

std::vector<std::string> joint_names_of(const std::vector<std::string>& elsewhere) {
  std::vector<std::string> names;
  for (const std::string& name : elsewhere) names.push_back(as_identifier(name, "joint_"));
  return names;
}

std::string plain_or_quoted(std::string_view text) {
  return is_identifier(text) ? std::string(text) : in_quotes(text);
}

}  // namespace takt::config

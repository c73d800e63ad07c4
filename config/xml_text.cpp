// SPDX-License-Identifier: Apache-2.0
#include "config/xml_text.hpp"

namespace takt::config {

std::string xml_text(std::string_view text) {
  std::string out;
  for (const char c : text) {
    if (c == '<') {
      out += "&lt;";
    } else if (c == '&') {
      out += "&amp;";
    } else if (c == '"') {
      out += "&quot;";
    } else if (static_cast<unsigned char>(c) < 0x20 && c != '\t' && c != '\n' && c != '\r') {
      out += '?';
    } else {
      out += c;
    }
  }
  return out;
}

}  // namespace takt::config

// SPDX-License-Identifier: Apache-2.0
// What nlohmann/json says is wrong, without its "[json.exception.KIND.NUMBER] " in front.
#pragma once

#include <nlohmann/json.hpp>
#include <string_view>

namespace takt::monitor {

// Valid as long as the exception is.
inline std::string_view sentence_of(const nlohmann::json::exception& error) {
  const std::string_view said = error.what();
  const std::size_t end = said.find("] ");
  return said.starts_with('[') && end != std::string_view::npos ? said.substr(end + 2) : said;
}

}  // namespace takt::monitor

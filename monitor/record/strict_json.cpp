// SPDX-License-Identifier: Apache-2.0
#include "monitor/record/strict_json.hpp"

#include <fmt/format.h>

#include <set>
#include <vector>

#include "config/printable.hpp"

namespace takt::monitor {

using Json = nlohmann::ordered_json;

std::expected<Json, std::string> parse_strict(std::string_view text) {
  std::vector<std::set<std::string>> keys;  // of every open object
  std::string repeated;
  const auto watch = [&](int /*depth*/, Json::parse_event_t event, Json& parsed) {
    if (event == Json::parse_event_t::object_start) keys.emplace_back();
    if (event == Json::parse_event_t::object_end) keys.pop_back();
    if (event == Json::parse_event_t::key && !keys.back().insert(parsed.get<std::string>()).second) {
      repeated = parsed.get<std::string>();
    }
    return true;
  };
  // The parser takes the first NUL for the end, and other readers do not.
  if (text.find('\0') != std::string_view::npos) return std::unexpected("not JSON: it has a NUL byte");
  try {
    Json json = Json::parse(text, watch);
    if (!repeated.empty()) return std::unexpected(fmt::format("{} is there twice", config::printable(repeated)));
    return json;
  } catch (const nlohmann::json::exception&) {
    return std::unexpected("not JSON, or cut off");
  }
}

}  // namespace takt::monitor

// SPDX-License-Identifier: Apache-2.0
// A command's answer in JSON. Pure.
#pragma once

#include <nlohmann/json.hpp>
#include <string>

namespace takt::cli {

// On one line. Paths and what others wrote may be no UTF-8, as JSON is: such bytes become U+FFFD.
template <class Json>
std::string json_line(const Json& json) {
  return json.dump(-1, ' ', false, Json::error_handler_t::replace);
}

}  // namespace takt::cli

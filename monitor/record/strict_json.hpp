// SPDX-License-Identifier: Apache-2.0
// JSON that every reader reads alike: no key twice in an object, no NUL byte. The error is one sentence. Pure.
#pragma once

#include <expected>
#include <nlohmann/json.hpp>
#include <string>
#include <string_view>

namespace takt::monitor {

std::expected<nlohmann::ordered_json, std::string> parse_strict(std::string_view text);

}  // namespace takt::monitor

// SPDX-License-Identifier: Apache-2.0
// Text of others in a robot file, whatever is in it, on one line.
#pragma once

#include <string>
#include <string_view>

namespace takt::config {

std::string in_quotes(std::string_view text);        // "so", quotes, backslashes and control characters escaped
std::string plain_or_quoted(std::string_view text);  // an identifier as it is
std::string on_one_line(std::string_view text);      // in a comment or a sentence

}  // namespace takt::config

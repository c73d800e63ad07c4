// SPDX-License-Identifier: Apache-2.0
// Text of others in a robot file, whatever is in it, on one line.
#pragma once

#include <string>
#include <string_view>
#include <vector>

namespace takt::config {

std::string in_quotes(std::string_view text);        // "so", quotes, backslashes and control characters escaped
std::string plain_or_quoted(std::string_view text);  // an identifier as it is
std::string on_one_line(std::string_view text);      // in a comment or a sentence

// `text` as a name: what is no letter, digit, _ or - becomes _, and `prefix`, which begins with a letter, goes before
// what does not begin with one. Of 63 letters at most.
std::string as_identifier(std::string_view text, std::string_view prefix);

// Joints of a model or an export, as a robot file calls them: `robot0:WRJ1` is robot0_WRJ1.
std::vector<std::string> joint_names_of(const std::vector<std::string>& elsewhere);

}  // namespace takt::config

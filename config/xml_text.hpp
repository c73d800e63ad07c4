// SPDX-License-Identifier: Apache-2.0
// Text that others wrote (names in robot files, sentences about runs), fit for XML and HTML: between tags, and inside
// double quotes.
#pragma once

#include <string>
#include <string_view>

namespace takt::config {

// `<`, `&` and `"` become references. Control characters, which XML 1.0 has no way to write, become `?`, but for
// tab, newline and carriage return.
std::string xml_text(std::string_view text);

}  // namespace takt::config

// SPDX-License-Identifier: Apache-2.0
// Text that others wrote (robot files, manifests, drives), fit for a terminal.
#pragma once

#include <cstddef>
#include <string>
#include <string_view>

namespace takt::config {

// Control characters (C0 but the newline, DEL, C1) and bytes that are no UTF-8 become \xNN, so that nothing moves the
// cursor, colours or titles the window; characters beyond ASCII stay.
std::string printable(std::string_view text);

// Bytes of the UTF-8 character that begins `text`, 1 to 4; 0: none, or it is not whole.
std::size_t utf8_length(std::string_view text);

}  // namespace takt::config

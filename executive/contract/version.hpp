// SPDX-License-Identifier: Apache-2.0
// Which Takt this is. A program says what it was built of; a test's program, which no commit relinks, says `+unknown`.
#pragma once

#include <string_view>

namespace takt {

// "0.1.0": what attestations and artifacts name.
std::string_view release();
// "0.1.0+git834.feebbd09a1b2", and ".dirty" after it where files differed from the commit; "0.1.0+src.45d7c9006040":
// built outside a checkout, of sources with that hash. dpkg orders two of them as their commits.
std::string_view version();
// SHA-256 over the sources that decide what a rollout computes, 64 hex digits.
std::string_view source_sha256();

}  // namespace takt

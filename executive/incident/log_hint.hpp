// SPDX-License-Identifier: Apache-2.0
// Where to look when commands stay away and the record cannot say why. What knows better (events.jsonl) replaces it.
#pragma once

#include <string_view>

namespace takt {

inline constexpr std::string_view kPolicyLogHint =
    "the policy host's log says whether a sensor, the policy or the way between failed";

}  // namespace takt

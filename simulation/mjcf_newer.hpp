// SPDX-License-Identifier: Apache-2.0
// What MuJoCo added to its format since 2.2.2 and Takt does not use: left out by name, each kind in one sentence. What
// is on no list stays, for MuJoCo to refuse: a mistyped word is not a newer one. Newlines stay. Pure.
#pragma once

#include <string>
#include <vector>

namespace takt::simulation {

// One sentence for each kind that was left out, or replaced, with the first line it was in.
std::vector<std::string> leave_out_newer(std::string& text);

}  // namespace takt::simulation

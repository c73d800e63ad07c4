// SPDX-License-Identifier: Apache-2.0
// A picture under stable names, for scripts. Times in nanoseconds, angles rad, torques Nm, rates per second, shares
// 0..1.
#pragma once

#include <nlohmann/json_fwd.hpp>

#include "cli/top/picture.hpp"

namespace takt::monitor::top {

nlohmann::ordered_json to_json(const Picture& picture);

}  // namespace takt::monitor::top

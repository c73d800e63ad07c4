// SPDX-License-Identifier: Apache-2.0
// What is known of the output that permits the robot's torque (safety.safe_torque_off of the robot file).
#pragma once

#include <array>
#include <cstddef>
#include <cstdint>
#include <string_view>

namespace takt {

enum class TorqueOutputState : std::uint8_t {
  none,     // the robot has none, or it has not been told anything yet
  as_told,  // set by the previous tick, and read back
  failed,   // it could not be set, or reads otherwise
};
inline constexpr std::size_t kTorqueOutputStateCount = 3;
inline constexpr std::array<std::string_view, kTorqueOutputStateCount> kTorqueOutputStateNames{"none", "as_told",
                                                                                               "failed"};

}  // namespace takt

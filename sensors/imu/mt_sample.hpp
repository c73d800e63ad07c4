// SPDX-License-Identifier: Apache-2.0
// What an Xsens MTi says of one instant, by whichever of its protocols. Frames and units are Xsens': sensor frame S,
// local frame L with z up.
#pragma once

#include <array>
#include <cstdint>
#include <optional>

namespace takt::sensors {

struct MtSample {
  std::uint16_t counter = 0;                 // one more with every sample, modulo 65536
  std::optional<std::uint32_t> ticks{};      // the part's own time, 0.1 ms, modulo 2^32; CAN: none
  std::array<double, 4> rotation{};          // S in L, w x y z
  std::array<double, 3> angular_velocity{};  // rad/s, in S
  std::array<double, 3> acceleration{};      // m/s^2, in S; specific force
};

}  // namespace takt::sensors

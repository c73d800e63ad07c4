// SPDX-License-Identifier: Apache-2.0
// The MTi's own side of a CAN bus, written from the description of its frames and not from our decoder.
#pragma once

#include <array>
#include <cmath>
#include <cstdint>
#include <vector>

#include "drivers/bus/can_bus.hpp"
#include "tests/sensors/imu/mti_encoder.hpp"

namespace takt::test {

inline drivers::CanFrame mti_frame(std::uint32_t id, const std::vector<std::uint16_t>& words) {
  drivers::CanFrame frame{.id = id, .extended = id > 0x7FF};
  for (const std::uint16_t word : words) {
    frame.data[frame.length++] = static_cast<std::uint8_t>(word >> 8);
    frame.data[frame.length++] = static_cast<std::uint8_t>(word);
  }
  return frame;
}

inline std::uint16_t fixed_point(float value, int fraction_bits) {
  return static_cast<std::uint16_t>(static_cast<std::int16_t>(std::lround(std::ldexp(value, fraction_bits))));
}

// Group Counter, Quaternion, Rate of Turn, Acceleration. A quaternion's fifteen fraction bits cannot represent 1.
inline std::array<drivers::CanFrame, 4> mti_group(const MtiSays& says,
                                                  const std::array<std::uint32_t, 4>& ids = {6, 0x21, 0x32, 0x34}) {
  const auto unit = [&says](int i) { return fixed_point(std::min(says.q[i], 32767.0F / 32768), 15); };
  const auto all = [](const float* values, int bits) {
    return std::vector{fixed_point(values[0], bits), fixed_point(values[1], bits), fixed_point(values[2], bits)};
  };
  return {mti_frame(ids[0], {says.counter}), mti_frame(ids[1], {unit(0), unit(1), unit(2), unit(3)}),
          mti_frame(ids[2], all(says.rate, 9)), mti_frame(ids[3], all(says.acceleration, 8))};
}

}  // namespace takt::test

// SPDX-License-Identifier: Apache-2.0
// Frames as protocol notes write them, and any float there is.
#pragma once

#include <rapidcheck.h>

#include <bit>
#include <cstdio>
#include <limits>
#include <string>
#include <string_view>

#include "drivers/bus/can_bus.hpp"

namespace takt::test {

inline std::string hex(const drivers::CanFrame& frame) {
  std::string text;
  char two[3];
  for (std::size_t i = 0; i < frame.length; ++i) {
    std::snprintf(two, sizeof two, "%02x", frame.data[i]);
    text += two;
  }
  return text;
}

inline drivers::CanFrame frame_of(std::uint32_t id, std::string_view hex_bytes, bool fd = false,
                                  bool extended = false) {
  drivers::CanFrame frame;
  frame.id = id;
  frame.fd = frame.bit_rate_switch = fd;
  frame.extended = extended;
  for (std::size_t i = 0; i + 1 < hex_bytes.size(); i += 2)
    frame.data[frame.length++] = static_cast<std::uint8_t>(std::stoi(std::string(hex_bytes.substr(i, 2)), nullptr, 16));
  return frame;
}

// Every bit pattern, and often the ones that hurt.
inline float any_float() {
  using Limits = std::numeric_limits<float>;
  const float hostile =
      *rc::gen::element(Limits::quiet_NaN(), Limits::infinity(), -Limits::infinity(), Limits::max(), Limits::lowest(),
                        Limits::denorm_min(), 1e30F, -1e30F, 0.0F, -0.0F, 1.0F, -1.0F, 40.0F);
  return *rc::gen::arbitrary<bool>() ? hostile : std::bit_cast<float>(*rc::gen::arbitrary<std::uint32_t>());
}

}  // namespace takt::test

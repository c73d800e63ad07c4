// SPDX-License-Identifier: Apache-2.0
// Angles as people type and read them.
#pragma once

#include <array>
#include <cstdio>
#include <numbers>
#include <string>

namespace takt::drivers {

inline constexpr double kDegree = std::numbers::pi / 180;  // rad

// "12.3 deg" of an angle in rad.
inline std::string degrees(double rad) {
  std::array<char, 32> text{};
  std::snprintf(text.data(), text.size(), "%.1f deg", rad / kDegree);
  return text.data();
}

}  // namespace takt::drivers

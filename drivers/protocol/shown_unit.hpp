// SPDX-License-Identifier: Apache-2.0
// A joint's place as people type and read it: a hinge's in degrees, a slide's in millimetres.
#pragma once

#include <array>
#include <cstdio>
#include <numbers>
#include <string>
#include <string_view>

#include "config/robot_config.hpp"

namespace takt::drivers {

inline constexpr double kDegree = std::numbers::pi / 180;  // rad
inline constexpr double kMillimetre = 1e-3;                // m

struct ShownUnit {
  std::string_view symbol;
  double size = 0;  // rad; of a slide m
};

constexpr ShownUnit shown_unit(config::JointKind kind) {
  return kind == config::JointKind::slide ? ShownUnit{"mm", kMillimetre} : ShownUnit{"deg", kDegree};
}

// "12.3 deg", "12.3 mm". `q`: rad; of a slide m.
inline std::string shown(config::JointKind kind, double q) {
  const ShownUnit unit = shown_unit(kind);
  std::array<char, 40> text{};
  std::snprintf(text.data(), text.size(), "%.1f %s", q / unit.size, unit.symbol.data());
  return text.data();
}

}  // namespace takt::drivers

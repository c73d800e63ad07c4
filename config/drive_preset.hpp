// SPDX-License-Identifier: Apache-2.0
// One row of drive_presets.hpp, of which drive_preset_table.hpp has all.
#pragma once

#include <string_view>

namespace takt::config {

inline constexpr double kUnsettled = 0;

struct DrivePreset {
  std::string_view model;
  double position, velocity, torque, kp, kd;  // kUnsettled: not known well enough
  std::string_view source;
  std::string_view unsettled{};  // what the sources say of the range that is kUnsettled; empty: there is none
};

}  // namespace takt::config

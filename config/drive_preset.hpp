// SPDX-License-Identifier: Apache-2.0
// One row of drive_presets.hpp, of which drive_preset_table.hpp has all, and other names of such rows.
#pragma once

#include <string_view>

namespace takt::config {

inline constexpr double kUnsettled = 0;

struct DrivePreset {
  std::string_view model;
  std::string_view variant;                   // mit: tmotor or damiao; empty: another protocol
  double position, velocity, torque, kp, kd;  // kUnsettled: not known well enough
  std::string_view source;
  std::string_view unsettled{};  // what the sources say of the range that is kUnsettled; empty: there is none
};

struct ModelAlias {
  std::string_view name, model;
};

}  // namespace takt::config

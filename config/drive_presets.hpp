// Ranges of the packed fields of drives that speak the MIT or the RobStride protocol: +-position, +-velocity, +-torque,
// 0..kp, 0..kd.
//
// A wrong range scales every command, and public tables conflict, so a robot file either names a model of this table
// or gives all five ranges itself. Sources: protocol tables published with TMotorCANControl (neurobionics,
// src/TMotorCANControl/mit_can.py), openarm_can (enactic, dm_motor_constants.hpp) and RobStride's Python SDK; the
// tables for RS00 and RS05 conflict: check them against the drive's manual. Units: rad, rad/s, Nm, Nm/rad, Nms/rad.
#pragma once

#include <array>
#include <numbers>
#include <span>
#include <string_view>

#include "config/robot_config.hpp"

namespace takt::config {

struct DrivePreset {
  std::string_view model;
  double position, velocity, torque, kp, kd;
};

inline constexpr std::array kMitPresets{
    DrivePreset{"AK80-9", 12.5, 50, 18, 500, 5}, DrivePreset{"AK10-9", 12.5, 50, 65, 500, 5},
    DrivePreset{"AK60-6", 12.5, 50, 15, 500, 5}, DrivePreset{"AK70-10", 12.5, 50, 25, 500, 5},
    DrivePreset{"AK80-6", 12.5, 76, 12, 500, 5}, DrivePreset{"AK80-64", 12.5, 8, 144, 500, 5},
    DrivePreset{"DM4310", 12.5, 30, 10, 500, 5}, DrivePreset{"DM4340", 12.5, 10, 28, 500, 5},
    DrivePreset{"DM6006", 12.5, 45, 20, 500, 5}, DrivePreset{"DM8009", 12.5, 45, 54, 500, 5},
};

inline constexpr double kFourPi = 4 * std::numbers::pi;
inline constexpr std::array kRobstridePresets{
    DrivePreset{"CyberGear", kFourPi, 30, 12, 500, 5}, DrivePreset{"RS00", kFourPi, 50, 17, 500, 5},
    DrivePreset{"RS01", kFourPi, 44, 17, 500, 5},      DrivePreset{"RS02", kFourPi, 44, 17, 500, 5},
    DrivePreset{"RS03", kFourPi, 50, 60, 5000, 100},   DrivePreset{"RS04", kFourPi, 15, 120, 5000, 100},
    DrivePreset{"RS05", kFourPi, 33, 17, 500, 5},      DrivePreset{"RS06", kFourPi, 20, 60, 5000, 100},
};

constexpr std::span<const DrivePreset> presets_of(DriveProtocol protocol) {
  switch (protocol) {
    case DriveProtocol::mit:
      return kMitPresets;
    case DriveProtocol::robstride:
      return kRobstridePresets;
    case DriveProtocol::odrive:
    case DriveProtocol::moteus:
    case DriveProtocol::cia402:
      return {};
  }
  return {};
}

constexpr const DrivePreset* find_drive_preset(DriveProtocol protocol, std::string_view model) {
  for (const DrivePreset& preset : presets_of(protocol))
    if (preset.model == model) return &preset;
  return nullptr;
}

}  // namespace takt::config

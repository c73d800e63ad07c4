// Ranges of the packed fields of drives that speak the MIT or the RobStride protocol: +-position, +-velocity, +-torque,
// 0..kp, 0..kd.
//
// A wrong range scales every command, so a number stands here only where its sources agree, and names them. Where they
// do not, it is 0 (kUnsettled): the robot file must give that range itself, from the drive's own manual, though the
// model gives the others. A maker's manual outweighs a seller's table. Units: rad, rad/s, Nm, Nm/rad, Nms/rad.
#pragma once

#include <array>
#include <numbers>
#include <span>
#include <string_view>

#include "config/robot_config.hpp"

namespace takt::config {

inline constexpr double kUnsettled = 0;

struct DrivePreset {
  std::string_view model;
  double position, velocity, torque, kp, kd;  // kUnsettled: not known well enough
  std::string_view source;
  std::string_view unsettled{};  // what the sources say of the range that is kUnsettled; empty: there is none
};

inline constexpr std::string_view kTmotorTable = "neurobionics/TMotorCANControl src/TMotorCANControl/mit_can.py";
inline constexpr std::string_view kDamiaoTable =
    "enactic/openarm_can dm_motor_constants.hpp; compared with the drive's "
    "registers 21 to 23 before arming";
inline constexpr std::string_view kSellersTable = "RobStride's Python SDK; contradicted by no manual we know";

inline constexpr std::array kMitPresets{
    DrivePreset{"AK80-9", 12.5, 50, 18, 500, 5, kTmotorTable},
    DrivePreset{"AK10-9", 12.5, 50, 65, 500, 5, kTmotorTable},
    DrivePreset{"AK60-6", 12.5, kUnsettled, 15, 500, 5, kTmotorTable, "45 or 50 rad/s"},
    DrivePreset{"AK70-10", 12.5, 50, 25, 500, 5, kTmotorTable},
    DrivePreset{"AK80-6", 12.5, 76, 12, 500, 5, kTmotorTable},
    DrivePreset{"AK80-64", 12.5, 8, 144, 500, 5, kTmotorTable},
    DrivePreset{"DM4310", 12.5, 30, 10, 500, 5, kDamiaoTable},
    DrivePreset{"DM4340", 12.5, 10, 28, 500, 5, kDamiaoTable},
    DrivePreset{"DM6006", 12.5, 45, 20, 500, 5, kDamiaoTable},
    DrivePreset{"DM8009", 12.5, 45, 54, 500, 5, kDamiaoTable},
};

inline constexpr double kFourPi = 4 * std::numbers::pi;
inline constexpr std::array kRobstridePresets{
    DrivePreset{"CyberGear", kFourPi, 30, 12, 500, 5,
                "belovictor/cybergear-docs instructionmanual/instructionmanual.md, section 4"},
    DrivePreset{"RS00", kFourPi, 33, 14, 500, 5, "the maker's manual of RS00"},
    DrivePreset{"RS01", kFourPi, 44, 17, 500, 5, kSellersTable},
    DrivePreset{"RS02", kFourPi, 44, 17, 500, 5, kSellersTable},
    DrivePreset{
        "RS03", kFourPi, 20, 60, 5000, 100,
        "the maker's manual of RS03, 4.1.2 and the sample in 4.4 (251112, 260112, 260713); a bench fit gives 20.05"},
    DrivePreset{"RS04", kFourPi, 15, 120, 5000, 100, kSellersTable},
    DrivePreset{"RS05", kFourPi, 50, kUnsettled, 500, 5, "the maker's manual of RS05", "5.5 or 6 Nm"},
    DrivePreset{"RS06", kFourPi, 50, 36, 5000, 100, "the maker's manual of RS06, as a driver quotes it"},
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

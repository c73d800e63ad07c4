// SPDX-License-Identifier: Apache-2.0
// Made of config/drives/*.yaml by config/drives/make_presets.py: change those.
#pragma once

#include <array>
#include <numbers>

#include "config/drive_preset.hpp"

namespace takt::config {

// clang-format off
inline constexpr double kFourPi = 4 * std::numbers::pi;
inline constexpr std::array kMitPresets{
    DrivePreset{"AK80-9", 12.5, kUnsettled, 18, 500, 5, "neurobionics/TMotorCANControl src/TMotorCANControl/mit_can.py; dfki-ric-underactuated-lab/mini-cheetah-tmotor-can README.md, firmware V1.1 says 22.5 rad/s, 18 Nm; dfki-ric-underactuated-lab/mini-cheetah-tmotor-can README.md, firmware V2 says 25.64 rad/s, 18 Nm", "22.5 or 25.64 or 50 rad/s"},
    DrivePreset{"AK10-9", 12.5, 50, 65, 500, 5, "neurobionics/TMotorCANControl src/TMotorCANControl/mit_can.py; dfki-ric-underactuated-lab/mini-cheetah-tmotor-can README.md, firmware V1.1"},
    DrivePreset{"AK60-6", 12.5, kUnsettled, 15, 500, 5, "neurobionics/TMotorCANControl src/TMotorCANControl/mit_can.py; other public code for AK drives says 45 rad/s", "45 or 50 rad/s"},
    DrivePreset{"AK70-10", 12.5, 50, 25, 500, 5, "neurobionics/TMotorCANControl src/TMotorCANControl/mit_can.py"},
    DrivePreset{"AK80-6", 12.5, kUnsettled, 12, 500, 5, "neurobionics/TMotorCANControl src/TMotorCANControl/mit_can.py; dfki-ric-underactuated-lab/mini-cheetah-tmotor-can README.md, firmware V1.1 says 22.5 rad/s, 12 Nm; dfki-ric-underactuated-lab/mini-cheetah-tmotor-can README.md, firmware V2 says 38.2 rad/s, 12 Nm", "22.5 or 38.2 or 76 rad/s"},
    DrivePreset{"AK80-64", 12.5, 8, 144, 500, 5, "neurobionics/TMotorCANControl src/TMotorCANControl/mit_can.py"},
    DrivePreset{"DM4310", 12.5, 30, 10, 500, 5, "enactic/openarm_can dm_motor_constants.hpp; compared with the drive's registers 21 to 23 before arming"},
    DrivePreset{"DM4340", 12.5, 10, 28, 500, 5, "enactic/openarm_can dm_motor_constants.hpp; compared with the drive's registers 21 to 23 before arming"},
    DrivePreset{"DM6006", 12.5, 45, 20, 500, 5, "enactic/openarm_can dm_motor_constants.hpp; compared with the drive's registers 21 to 23 before arming"},
    DrivePreset{"DM8009", 12.5, 45, 54, 500, 5, "enactic/openarm_can dm_motor_constants.hpp; compared with the drive's registers 21 to 23 before arming"},
};
inline constexpr std::array kRobstridePresets{
    DrivePreset{"CyberGear", kFourPi, 30, 12, 500, 5, "belovictor/cybergear-docs instructionmanual/instructionmanual.md, section 4"},
    DrivePreset{"RS00", kFourPi, 33, 14, 500, 5, "the maker's manual of RS00; a seller's SDK table says 50 rad/s, 17 Nm"},
    DrivePreset{"RS01", kFourPi, 44, 17, 500, 5, "RobStride's Python SDK"},
    DrivePreset{"RS02", kFourPi, 44, 17, 500, 5, "RobStride's Python SDK"},
    DrivePreset{"RS03", kFourPi, 20, 60, 5000, 100, "the maker's manual of RS03, 4.1.2 and the sample in 4.4 (251112, 260112, 260713); a bench fit of a deployed drive says 20.05 rad/s; a seller's SDK table says 50 rad/s"},
    DrivePreset{"RS04", kFourPi, 15, 120, 5000, 100, "RobStride's Python SDK"},
    DrivePreset{"RS05", kFourPi, 50, kUnsettled, 500, 5, "the maker's manual of RS05; some code for it says 6 Nm", "5.5 or 6 Nm"},
    DrivePreset{"RS06", kFourPi, 50, 36, 5000, 100, "the maker's manual of RS06, as a driver quotes it; a seller's SDK table says 20 rad/s, 60 Nm"},
};
// clang-format on

}  // namespace takt::config

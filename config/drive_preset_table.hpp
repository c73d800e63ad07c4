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
    DrivePreset{"AK80-9", "tmotor", 12.5, kUnsettled, 18, 500, 5, "neurobionics/TMotorCANControl src/TMotorCANControl/mit_can.py; dfki-ric-underactuated-lab/mini-cheetah-tmotor-can README.md, firmware V1.1 says 22.5 rad/s, 18 Nm; dfki-ric-underactuated-lab/mini-cheetah-tmotor-can README.md, firmware V2 says 25.64 rad/s, 18 Nm; CubeMars, AK Series Actuator Driver Manual V1.0.8 (AK80-64), 5.3", "22.5 or 25.64 or 50 rad/s"},
    DrivePreset{"AK10-9", "tmotor", 12.5, 50, 65, 500, 5, "neurobionics/TMotorCANControl src/TMotorCANControl/mit_can.py; dfki-ric-underactuated-lab/mini-cheetah-tmotor-can README.md, firmware V1.1; CubeMars, AK Series Actuator Driver Manual V1.0.8 (AK80-64), 5.3"},
    DrivePreset{"AK60-6", "tmotor", 12.5, kUnsettled, 15, 500, 5, "neurobionics/TMotorCANControl src/TMotorCANControl/mit_can.py; CubeMars, AK Series Actuator Driver Manual V1.0.8 (AK80-64), 5.3", "45 or 50 rad/s"},
    DrivePreset{"AK70-10", "tmotor", 12.5, 50, kUnsettled, 500, 5, "neurobionics/TMotorCANControl src/TMotorCANControl/mit_can.py; CubeMars, AK Series Actuator Driver Manual V1.0.8 (AK80-64), 5.3; dfki-ric-underactuated-lab/mini-cheetah-tmotor-python-can src/motor_driver/canmotorlib.py, firmware V1.1", "24 or 25 Nm"},
    DrivePreset{"AK80-6", "tmotor", 12.5, kUnsettled, 12, 500, 5, "neurobionics/TMotorCANControl src/TMotorCANControl/mit_can.py; dfki-ric-underactuated-lab/mini-cheetah-tmotor-can README.md, firmware V1.1 says 22.5 rad/s, 12 Nm; dfki-ric-underactuated-lab/mini-cheetah-tmotor-can README.md, firmware V2 says 38.2 rad/s, 12 Nm; CubeMars, AK Series Actuator Driver Manual V1.0.8 (AK80-64), 5.3", "22.5 or 38.2 or 76 rad/s"},
    DrivePreset{"AK80-64", "tmotor", 12.5, 8, 144, 500, 5, "neurobionics/TMotorCANControl src/TMotorCANControl/mit_can.py; CubeMars, AK Series Actuator Driver Manual V1.0.8 (AK80-64), 5.3, column AK80-80"},
    DrivePreset{"DM3507", "damiao", 12.5, kUnsettled, kUnsettled, 500, 5, "enactic/openarm_can dm_motor_constants.hpp; compared with the drive's registers 21 to 23 before arming; huggingface/lerobot src/lerobot/motors/damiao/tables.py", "30 or 50 rad/s; 5 or 10 Nm"},
    DrivePreset{"DM4310", "damiao", 12.5, 30, 10, 500, 5, "enactic/openarm_can dm_motor_constants.hpp; compared with the drive's registers 21 to 23 before arming; huggingface/lerobot src/lerobot/motors/damiao/tables.py; the maker's name: DM-J4310-2EC"},
    DrivePreset{"DM4310_48V", "damiao", 12.5, 50, 10, 500, 5, "enactic/openarm_can dm_motor_constants.hpp; compared with the drive's registers 21 to 23 before arming; huggingface/lerobot src/lerobot/motors/damiao/tables.py"},
    DrivePreset{"DM4310P", "damiao", kUnsettled, kUnsettled, kUnsettled, kUnsettled, kUnsettled, "jia-xie/python-damiao-driver damiao_motor/core/motor.py, 4310P; compared with the drive's registers 21 to 23 before arming", "12.5 rad, one source; 50 rad/s, one source; 10 Nm, one source; 500 Nm/rad, one source; 5 Nm s/rad, one source"},
    DrivePreset{"DM4340", "damiao", 12.5, kUnsettled, 28, 500, 5, "enactic/openarm_can dm_motor_constants.hpp; compared with the drive's registers 21 to 23 before arming; huggingface/lerobot src/lerobot/motors/damiao/tables.py; the maker's name: DM-J4340P-2EC", "8 or 10 rad/s"},
    DrivePreset{"DM4340_48V", "damiao", 12.5, 10, 28, 500, 5, "enactic/openarm_can dm_motor_constants.hpp; compared with the drive's registers 21 to 23 before arming; huggingface/lerobot src/lerobot/motors/damiao/tables.py"},
    DrivePreset{"DM6006", "damiao", 12.5, 45, 20, 500, 5, "enactic/openarm_can dm_motor_constants.hpp; compared with the drive's registers 21 to 23 before arming; huggingface/lerobot src/lerobot/motors/damiao/tables.py"},
    DrivePreset{"DM6248P", "damiao", kUnsettled, 20, 120, 500, 5, "i2rt-robotics/i2rt i2rt/motor_drivers/utils.py, DM6248; compared with the drive's registers 21 to 23 before arming; jia-xie/python-damiao-driver damiao_motor/core/motor.py, 6248P", "12.5 or 12.566 rad"},
    DrivePreset{"DM8006", "damiao", 12.5, 45, 40, 500, 5, "enactic/openarm_can dm_motor_constants.hpp; compared with the drive's registers 21 to 23 before arming; huggingface/lerobot src/lerobot/motors/damiao/tables.py"},
    DrivePreset{"DM8009", "damiao", 12.5, 45, 54, 500, 5, "enactic/openarm_can dm_motor_constants.hpp; compared with the drive's registers 21 to 23 before arming; huggingface/lerobot src/lerobot/motors/damiao/tables.py; the maker's name: DM-J8009P-2EC"},
    DrivePreset{"DM10010L", "damiao", 12.5, 25, 200, 500, 5, "enactic/openarm_can dm_motor_constants.hpp; compared with the drive's registers 21 to 23 before arming; huggingface/lerobot src/lerobot/motors/damiao/tables.py"},
    DrivePreset{"DM10010", "damiao", 12.5, 20, 200, 500, 5, "enactic/openarm_can dm_motor_constants.hpp; compared with the drive's registers 21 to 23 before arming; huggingface/lerobot src/lerobot/motors/damiao/tables.py"},
    DrivePreset{"DM10422P", "damiao", kUnsettled, kUnsettled, kUnsettled, kUnsettled, kUnsettled, "wing-kit/DM_Control_Python DM_CAN.py; compared with the drive's registers 21 to 23 before arming", "12.566 rad, one source; 20 rad/s, one source; 500 Nm, one source; 500 Nm/rad, one source; 5 Nm s/rad, one source"},
    DrivePreset{"DMH3510", "damiao", 12.5, 280, 1, 500, 5, "enactic/openarm_can dm_motor_constants.hpp; compared with the drive's registers 21 to 23 before arming; huggingface/lerobot src/lerobot/motors/damiao/tables.py"},
    DrivePreset{"DMH6215", "damiao", 12.5, 45, 10, 500, 5, "enactic/openarm_can dm_motor_constants.hpp; compared with the drive's registers 21 to 23 before arming; huggingface/lerobot src/lerobot/motors/damiao/tables.py"},
    DrivePreset{"DMG6220", "damiao", 12.5, 45, 10, 500, 5, "enactic/openarm_can dm_motor_constants.hpp; compared with the drive's registers 21 to 23 before arming; huggingface/lerobot src/lerobot/motors/damiao/tables.py"},
    DrivePreset{"DMJH11", "damiao", kUnsettled, kUnsettled, kUnsettled, kUnsettled, kUnsettled, "jia-xie/python-damiao-driver damiao_motor/core/motor.py, JH11; compared with the drive's registers 21 to 23 before arming", "12.5 rad, one source; 10 rad/s, one source; 12 Nm, one source; 500 Nm/rad, one source; 5 Nm s/rad, one source"},
};
inline constexpr std::array kRobstridePresets{
    DrivePreset{"CyberGear", "", kFourPi, 30, 12, 500, 5, "belovictor/cybergear-docs instructionmanual/instructionmanual.md, section 4"},
    DrivePreset{"RS00", "", kFourPi, 33, 14, 500, 5, "the maker's manual of RS00; a seller's SDK table says 50 rad/s, 17 Nm"},
    DrivePreset{"RS01", "", kUnsettled, kUnsettled, kUnsettled, kUnsettled, kUnsettled, "RobStride's Python SDK; kscalelabs/actuator actuator/robstride/src/actuators/robstride01.rs", "12.5664 rad, one source; 44 rad/s, one source; 17 Nm, one source; 500 Nm/rad, one source; 5 Nm s/rad, one source"},
    DrivePreset{"RS02", "", kUnsettled, kUnsettled, kUnsettled, kUnsettled, kUnsettled, "RobStride's Python SDK; kscalelabs/actuator actuator/robstride/src/actuators/robstride02.rs", "12.5664 rad, one source; 44 rad/s, one source; 17 Nm, one source; 500 Nm/rad, one source; 5 Nm s/rad, one source"},
    DrivePreset{"RS03", "", kFourPi, 20, 60, 5000, 100, "the maker's manual of RS03, 4.1.2 and the sample in 4.4 (251112, 260112, 260713); a bench fit of a deployed drive says 20.05 rad/s; a seller's SDK table says 50 rad/s"},
    DrivePreset{"RS04", "", kUnsettled, kUnsettled, kUnsettled, kUnsettled, kUnsettled, "RobStride's Python SDK; kscalelabs/actuator actuator/robstride/src/actuators/robstride04.rs", "12.5664 rad, one source; 15 rad/s, one source; 120 Nm, one source; 5000 Nm/rad, one source; 100 Nm s/rad, one source"},
    DrivePreset{"RS05", "", kFourPi, 50, kUnsettled, 500, 5, "the maker's manual of RS05; some code for it says 6 Nm", "5.5 or 6 Nm"},
    DrivePreset{"RS06", "", kFourPi, 50, 36, 5000, 100, "the maker's manual of RS06, as a driver quotes it; a seller's SDK table says 20 rad/s, 60 Nm"},
};
inline constexpr std::array kModelAliases{
    ModelAlias{"DM-J4310-2EC", "DM4310"},
    ModelAlias{"DM-J4340P-2EC", "DM4340"},
    ModelAlias{"DM-J8009P-2EC", "DM8009"},
};
// clang-format on

}  // namespace takt::config

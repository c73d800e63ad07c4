// SPDX-License-Identifier: Apache-2.0
// The MIT mini-cheetah protocol, host side (T-Motor AK, Damiao DM, a RobStride that was switched to it): one 8-byte
// classic frame commands position, velocity, stiffness, damping and torque; one reply reports position, velocity and
// torque. Pure.
//
// Command, standard id = motor id, big-endian bits p16 | v12 | kp12 | kd12 | t12. Reply on the master id: motor id,
// p16, v12, t12; Damiao puts its state into the id byte's upper half and appends two temperatures, RobStride appends
// one. The reply is sent
// before the command is read: it reports the earlier state. Units: motor side, rad, rad/s, Nm/rad, Nm s/rad, Nm. Zero
// is not representable: over symmetric ranges it comes out half a quantum below. Sources: bgkatz/motorcontrol
// Core/Src/can.c, math_ops.c; enactic/openarm_can dm_motor_control.cpp; neurobionics/TMotorCANControl mit_can.py;
// for 8-byte T-Motor replies and 0x29xx the maker's AK series manual; for RobStride the maker's manual of RS00, MIT
// protocol.
#pragma once

#include <array>
#include <cstddef>
#include <cstdint>
#include <optional>

#include "drivers/bus/can_bus.hpp"

namespace takt::drivers {

// What the packed fields span: +-p, +-v, +-t, 0..kp, 0..kd; each finite and > 0. Must equal what the drive was set to.
struct MitRange {
  float p = 0, v = 0, kp = 0, kd = 0, t = 0;
};

struct MitCommand {
  float p = 0, v = 0, kp = 0, kd = 0, t = 0;
};

using MitPayload = std::array<std::uint8_t, 8>;

// Clamps to the range, then truncates in float32 as the firmware does. A command with a value that is not finite
// becomes "no stiffness, no torque" with what damping it has. Never yields six FF, which start a special frame
// (RobStride) or may start one (the others, seven): such a command loses one quantum of stiffness.
MitPayload encode_mit_command(const MitRange& range, const MitCommand& command) noexcept;

// The last byte after seven FF.
enum class MitSpecial : std::uint8_t {
  clear_error = 0xFB,  // Damiao, RobStride
  enter_motor_mode = 0xFC,
  exit_motor_mode = 0xFD,
  set_zero = 0xFE
};
MitPayload encode_mit_special(MitSpecial special) noexcept;

enum class MitVariant : std::uint8_t { tmotor, damiao, robstride };

struct MitReply {
  std::uint8_t id = 0;  // Damiao: the lower four bits only
  float p = 0, v = 0, t = 0;
  // Damiao's state (0 disabled, 1 enabled, 8.. errors); T-Motor's error code when the reply has 8 bytes, else 0. A
  // RobStride tells neither: 0.
  std::uint8_t status = 0;
  float temperature_C = 0;   // the hotter of what is reported; 0 when nothing is
  std::uint8_t stage_C = 0;  // of the output stage, where it is told apart (Damiao); 0: it is not
};
// T-Motor: 6 bytes, or 8 with temperature (unsigned, 0 is -40 deg C) and error code. Damiao: 8 bytes. RobStride: 8
// bytes, the last two its temperature in 0.1 deg C, signed, high byte first. Anything else is no reply.
// `fd`: the drive speaks CAN FD, and a classic frame is no reply of it; otherwise the other way round.
std::optional<MitReply> decode_mit_reply(const MitRange& range, MitVariant variant, const CanFrame& frame,
                                         bool fd = false) noexcept;

// Damiao states; values of the protocol.
inline constexpr std::uint8_t kDamiaoDisabled = 0x0;
inline constexpr std::uint8_t kDamiaoEnabled = 0x1;
inline constexpr float kTmotorColdest_C = 40;

// AK drives with V3 firmware, and older ones in servo mode, speak another protocol: commands with 29-bit ids (MIT ones
// 0x800 | drive, stiffness first), feedback with id 0x2900 | drive, 8 bytes. It is not spoken here, only known by
// sight.
inline constexpr std::uint32_t kAkV3Feedback = 0x2900;
bool is_ak_v3_feedback(std::uint32_t drive_id, const CanFrame& frame) noexcept;

// A RobStride's reply, read as a T-Motor drive's, has a temperature of -37 deg C or less and an error code. Known by
// sight, where the robot file says T-Motor. SettingDetail::setting of it: no register, no id of feedback.
inline constexpr std::uint32_t kRobstrideInMit = 0x2901;
bool is_robstride_reply(std::uint32_t drive_id, const CanFrame& frame) noexcept;

}  // namespace takt::drivers

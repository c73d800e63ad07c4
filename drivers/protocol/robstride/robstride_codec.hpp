// SPDX-License-Identifier: Apache-2.0
// The private protocol of RobStride and CyberGear drives, host side: one classic frame with a 29-bit id commands
// position, velocity, stiffness, damping and torque; one frame reports position, velocity, torque and temperature.
// Pure.
//
// id = type << 24 | data << 8 | target. To the drive the target is its number and the data's low byte is ours, but for
// the motion command, whose data is the torque. From it the target is us and the data's low byte is the drive.
// Motion and feedback carry big-endian 16-bit codes over their ranges, parameters are little-endian. Units: side of the
// drive's output, rad, rad/s, Nm/rad, Nm s/rad, Nm. Zero is not representable: over symmetric ranges it comes out half
// a quantum below. Sources: belovictor/cybergear-docs instructionmanual/instructionmanual.md, section 4; for 7028, type
// 24, stall overload and the failed answer the makers' manuals of RS00 to RS06; for 7029
// motorbridge.seeedstudio.com reference/robstride-parameter-tables.
#pragma once

#include <cstdint>
#include <optional>

#include "drivers/bus/can_bus.hpp"

namespace takt::drivers {

// What the packed fields span: +-p, +-v, +-t, 0..kp, 0..kd; each finite and > 0. A property of the model.
struct RobstrideRange {
  float p = 0, v = 0, kp = 0, kd = 0, t = 0;
};

struct RobstrideCommand {
  float p = 0, v = 0, kp = 0, kd = 0, t = 0;
};

struct RobstrideAddress {
  std::uint8_t drive = 0;  // 1..127
  std::uint8_t host = 0;   // ours
};

// Frames of 8 bytes to the drive. Each is answered by feedback, a question by its answer.

// Clamps to the range, then truncates in float32 as the maker's example does. A command with a value that is not finite
// becomes "no stiffness, no torque" with what damping it has.
CanFrame encode_robstride_motion(const RobstrideRange& range, RobstrideAddress address,
                                 const RobstrideCommand& command) noexcept;
CanFrame encode_robstride_enable(RobstrideAddress address) noexcept;
CanFrame encode_robstride_stop(RobstrideAddress address, bool clear_faults) noexcept;

// "Who are you": answered with the drive's unique id.
CanFrame encode_robstride_get_id(RobstrideAddress address) noexcept;

// Values of the protocol.
enum class RobstrideParameter : std::uint16_t {
  stored_timeout = 0x200C,  // u32, in units of 50 us; 0: off, as it comes from the factory. CyberGear
  run_mode = 0x7005,        // u8; 0: obeys motion commands
  can_timeout = 0x7028,     // u32, 20000 is 1 s; 0: off, as after every power-on. RobStride, as the next one
  zero_state = 0x7029,      // u8; positions begin within a turn after power-on, 0: in 0 to 2 pi, 1: in -pi to pi
};
CanFrame encode_robstride_question(RobstrideAddress address, RobstrideParameter parameter) noexcept;
// Lost at power-off. `value`: the parameter's bits, the low byte first on the wire.
CanFrame encode_robstride_setting(RobstrideAddress address, RobstrideParameter parameter, std::uint32_t value) noexcept;

// Bits of RobstrideFeedback::faults.
inline constexpr int kRobstrideFaultBits = 6;
enum class RobstrideMode : std::uint8_t { reset = 0, calibration = 1, running = 2, reserved = 3 };

struct RobstrideFeedback {
  float p = 0, v = 0, t = 0;
  float temperature_C = 0;
  // From bit 0: undervoltage, overcurrent, over-temperature, magnetic encoder, stall overload (CyberGear: Hall
  // encoder), not calibrated.
  std::uint8_t faults = 0;
  RobstrideMode mode = RobstrideMode::reset;
};
struct RobstrideIdentity {
  std::uint32_t first = 0, second = 0;  // bytes 0 to 3 and 4 to 7 of the unique id, as they stand on the wire
};
struct RobstrideAnswer {
  std::uint16_t index = 0;  // a RobstrideParameter, when it is one of ours
  std::uint32_t value = 0;  // its bits
  bool failed = false;      // the drive has no such parameter, and `value` says nothing
};
struct RobstrideFaultReport {
  std::uint32_t faults = 0, warnings = 0;  // 0: none
};

// active_report: feedback that was not requested; a drive sends it when a maker's tool told it to.
enum class RobstrideKind : std::uint8_t { identity, feedback, answer, fault_report, active_report };
// What this drive says to us; nothing when it is another drive's, a request, or of no kind a drive sends by itself or
// as an answer. The length is the decoders' business.
std::optional<RobstrideKind> robstride_kind(RobstrideAddress address, const CanFrame& frame) noexcept;

// Preconditions: robstride_kind() named the kind. Nothing: the frame has not 8 bytes of classic data.
std::optional<RobstrideFeedback> decode_robstride_feedback(const RobstrideRange& range, const CanFrame& frame) noexcept;
std::optional<RobstrideIdentity> decode_robstride_identity(const CanFrame& frame) noexcept;
std::optional<RobstrideAnswer> decode_robstride_answer(const CanFrame& frame) noexcept;
std::optional<RobstrideFaultReport> decode_robstride_fault_report(const CanFrame& frame) noexcept;

}  // namespace takt::drivers

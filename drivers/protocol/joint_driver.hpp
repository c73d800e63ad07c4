// One joint's drive behind its protocol: pure encode / decode, no I/O, and no control law: who closes the joint's loop
// says config/drive_loop.hpp, and a setpoint for a drive that takes a torque or a velocity brings it finished. The
// cyclic loop asks every driver for its frame in joint order, sends it on the joint's bus, and offers every received
// frame to that bus's drivers.
//
// Conversions between joint side and motor side (direction, offset, gear ratio) happen here, and only here.
// Thread rule: control thread only, after construction. Nothing allocates or throws after construction.
#pragma once

#include <cmath>
#include <cstddef>
#include <cstdint>
#include <span>

#include "drivers/bus/can_bus.hpp"
#include "executive/contract/feedback.hpp"
#include "executive/contract/mono_time.hpp"

namespace takt::drivers {

inline constexpr std::size_t kMaxFramesPerDrive = 4;

// Joint side; same meaning as pipeline::JointSetpoint, which this room does not know.
struct DriveSetpoint {
  float q = 0, dq = 0, kp = 0, kd = 0, tau = 0;
};

inline bool is_finite(const DriveSetpoint& s) noexcept {
  return std::isfinite(s.q) && std::isfinite(s.dq) && std::isfinite(s.kp) && std::isfinite(s.kd) &&
         std::isfinite(s.tau);
}

// JointFeedback::error_code of what a driver finds out by itself, whatever the protocol; DriveState::fault goes with
// it. Drives' own codes stay below.
enum class SetupFault : std::uint32_t {
  settings_differ = 0x8000'0001,  // read back, and not what the robot file says
  settings_unread,                // the drive does not answer the question
  setup_refused,                  // the drive did not take a setting
};

// Which setting, when the protocol numbers them (1..0xFFFF), stands in bits 8..23.
constexpr std::uint32_t setup_fault_code(SetupFault fault, std::uint32_t setting = 0) noexcept {
  return static_cast<std::uint32_t>(fault) | (setting & 0xFFFFU) << 8U;
}
// 0: not a SetupFault, or one that names no setting.
constexpr std::uint32_t setting_of(std::uint32_t error_code) noexcept {
  return (error_code & 0x8000'0000U) != 0 ? error_code >> 8U & 0xFFFFU : 0;
}

// q_joint = direction * q_motor / gear_ratio + offset; torque the other way round, gains by the ratio's square.
struct JointMapping {
  float ratio = 1;   // direction * gear_ratio: motor angle per joint angle
  float offset = 0;  // rad, joint side
};

// Side of the motor: rad, rad/s, Nm, Nm/rad, Nm s/rad.
constexpr DriveSetpoint to_motor(const JointMapping& mapping, const DriveSetpoint& joint) noexcept {
  return {.q = (joint.q - mapping.offset) * mapping.ratio,
          .dq = joint.dq * mapping.ratio,
          .kp = joint.kp / (mapping.ratio * mapping.ratio),
          .kd = joint.kd / (mapping.ratio * mapping.ratio),
          .tau = joint.tau / mapping.ratio};
}

// What the drive measured, motor side, becomes the joint's feedback, and counts as one more reply.
constexpr void take_reading(const JointMapping& mapping, float q, float dq, float tau, MonoTime received_at,
                            JointFeedback& feedback) noexcept {
  feedback.received_at = received_at;
  feedback.q = q / mapping.ratio + mapping.offset;
  feedback.dq = dq / mapping.ratio;
  feedback.tau = tau * mapping.ratio;
  ++feedback.replies;
}

class JointDriver {
 public:
  virtual ~JointDriver() = default;
  // Frames for this tick; returns how many were written: at most kMaxFramesPerDrive, which `out` has room for.
  // `enable` false: whatever takes the drive's power away, keeps it away and makes the drive report. `now`: just before
  // the frames are written. `valid_until`: when the command in use dies; a drive-side watchdog is told what is left of
  // it at `now`. Unset: no command is in use, the executive itself holds or damps.
  virtual std::size_t encode(bool enable, const DriveSetpoint& setpoint, MonoTime now, MonoTime valid_until,
                             std::span<CanFrame> out) noexcept = 0;
  // For a listener beside the host that set the drive up: its reports mean from now on what they mean to that host.
  virtual void assume_set_up() noexcept {}
  // True when the frame is this drive's; updates feedback.
  virtual bool decode(const ReceivedFrame& received) noexcept = 0;
  [[nodiscard]] virtual const JointFeedback& feedback() const noexcept = 0;
};

}  // namespace takt::drivers

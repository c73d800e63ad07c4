// SPDX-License-Identifier: Apache-2.0
// One joint's drive behind its protocol: pure encode / decode, no I/O, and no control law: who closes the joint's loop
// says config/drive_loop.hpp, and a setpoint for a drive that takes a torque or a velocity brings it finished. The
// cyclic loop asks every driver for its frame in joint order, sends it on the joint's bus, and offers every received
// frame to that bus's drivers.
//
// Conversions between joint side and motor side (direction, offset, gear ratio) happen here, and only here.
// Thread rule: control thread only, after construction. Nothing allocates or throws after construction.
#pragma once

#include <algorithm>
#include <cmath>
#include <cstddef>
#include <cstdint>
#include <limits>
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
  watchdog_off,                   // nothing in the drive would stop it when this computer dies
  watchdog_unknown,               // perhaps something would: it does not tell
  other_protocol,                 // what it says is known, and not spoken here
  home_unknown,                   // where the joint is since power-on is not known
};

// Where the protocol numbers its settings: which one (bits 8..23), which part of it (bits 3..7), and what the drive
// said about it (bits 24..30; what the numbers mean is the protocol's business). 0: none of these.
struct SettingDetail {
  std::uint32_t setting = 0;  // 1..0xFFFF
  std::uint32_t part = 0;     // 0..31
  std::uint32_t said = 0;     // 0..127
};
constexpr std::uint32_t setup_fault_code(SetupFault fault, const SettingDetail& about) noexcept {
  return static_cast<std::uint32_t>(fault) | (about.setting & 0xFFFFU) << 8U | (about.part & 0x1FU) << 3U |
         (about.said & 0x7FU) << 24U;
}
constexpr std::uint32_t setup_fault_code(SetupFault fault, std::uint32_t setting = 0) noexcept {
  return setup_fault_code(fault, SettingDetail{.setting = setting});
}
// Nothing of it set: not a SetupFault, or one that names no setting.
constexpr SettingDetail detail_of(std::uint32_t error_code) noexcept {
  if ((error_code & 0x8000'0000U) == 0) return {};
  return {error_code >> 8U & 0xFFFFU, error_code >> 3U & 0x1FU, error_code >> 24U & 0x7FU};
}
constexpr std::uint32_t setting_of(std::uint32_t error_code) noexcept {
  return detail_of(error_code).setting;
}
constexpr SetupFault kind_of(std::uint32_t setup_error_code) noexcept {
  return static_cast<SetupFault>(setup_error_code & 0x8000'0007U);
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

// A number too large for the joint's side is the largest there is; NaN stays NaN.
constexpr float bounded(float value) noexcept {
  constexpr float kMost = std::numeric_limits<float>::max();
  return std::clamp(value, -kMost, kMost);
}

// What the drive measured, motor side, becomes the joint's feedback, and counts as one more reply. A reading older than
// the newest one (its stamp says so, or is none) only counts: what is known is not replaced by what was. False then.
constexpr bool take_reading(const JointMapping& mapping, float q, float dq, float tau, MonoTime received_at,
                            JointFeedback& feedback) noexcept {
  ++feedback.replies;
  if (received_at < feedback.received_at) return false;
  feedback.received_at = received_at;
  feedback.q = bounded(q / mapping.ratio + mapping.offset);
  feedback.dq = bounded(dq / mapping.ratio);
  feedback.tau = bounded(tau * mapping.ratio);
  return true;
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
  // Everything that is asked of it before it may be enabled was answered, and fits. What does not fit is a fault once
  // it was heard, and none before; where the joint is may be unknown still.
  [[nodiscard]] virtual bool is_set_up() const noexcept = 0;
  // For a listener beside the host that set the drive up: its reports mean from now on what they mean to that host.
  virtual void assume_set_up() noexcept {}
  // For a caller that knows where the joint is (SetupFault::home_unknown), of drives that do not know it themselves: it
  // holds if the next reading is within `tolerance` of q, and until the drive may have lost it. rad, joint side; an
  // infinite tolerance: wherever it is. Set-up only.
  virtual void assume_home(float /*q*/, float /*tolerance*/) noexcept {}
  // What it adds to the robot file's offset since power-on (PlacedDriver); rad, joint side.
  [[nodiscard]] virtual float shift() const noexcept { return 0; }
  // True when the frame is this drive's; updates feedback.
  virtual bool decode(const ReceivedFrame& received) noexcept = 0;
  [[nodiscard]] virtual const JointFeedback& feedback() const noexcept = 0;
  // What the drive told of itself that is no fault, as error_name() takes it; 0: nothing. For a person's tools.
  [[nodiscard]] virtual std::uint32_t remark() const noexcept { return 0; }
};

}  // namespace takt::drivers

// One joint's drive behind its protocol: pure encode / decode, no I/O. The cyclic loop asks every driver for its
// frame in joint order, sends it on the joint's bus, and offers every received frame to that bus's drivers.
//
// Conversions between joint side and motor side (direction, offset, gear ratio) happen here, and only here.
// Thread rule: control thread only, after construction. Nothing allocates or throws after construction.
#pragma once

#include <cstddef>
#include <cstdint>
#include <span>

#include "drivers/can_bus.hpp"
#include "executive/contract/feedback.hpp"
#include "executive/contract/mono_time.hpp"

namespace takt::drivers {

// Joint side; same meaning as pipeline::JointSetpoint, which this room does not know.
struct DriveSetpoint {
  float q = 0, dq = 0, kp = 0, kd = 0, tau = 0;
};

class JointDriver {
 public:
  virtual ~JointDriver() = default;
  // Frames for this tick; returns how many were written (at most out.size(), at least 2). `enable` false: whatever
  // keeps the drive disabled and makes it report. `budget`: remaining life of the command, for a drive-side watchdog.
  virtual std::size_t encode(bool enable, const DriveSetpoint& setpoint, Duration budget,
                             std::span<CanFrame> out) noexcept = 0;
  // True when the frame is this drive's; updates feedback.
  virtual bool decode(const ReceivedFrame& received) noexcept = 0;
  [[nodiscard]] virtual const JointFeedback& feedback() const noexcept = 0;
};

}  // namespace takt::drivers

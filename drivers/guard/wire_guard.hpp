// SPDX-License-Identifier: Apache-2.0
// The last guard on the wire: reads every frame that is about to leave the way its drive will read it, and lets it pass
// only if what it asks for keeps the contract. It shares no code with the encoders (tests/house/arrows_test.py: this
// room may not include drivers/protocol); the protocols' facts come from docs/drives.md and the makers' papers named in
// each decoder.
//
// frame                                           passes if
// switches off, clears errors, asks, synchronises always
// switches on                                     the joint is to be enabled
// changes a drive's settings                      the joint is to be disabled, and the setting is one we know, with the
//                                                 value that we give it; a drive's own time-out and its motion mode:
//                                                 always
// asks for nothing: no stiffness, no torque, no   the joint is to be enabled, and its gains are within their limits; to
//   motion but what the drive damps by its own      be disabled: without damping, where the frame switches nothing on
//   measurement
// pushes                                          the joint is to be enabled, now <= valid_until, the newest feedback
//                                                 was no older than feedback.timeout when the tick decided, every
//                                                 limit holds, and it is what the tick's record says was decided
// anything else                                   never
//
// Limits, joint side: position within [q_min, q_max] and its margin, |velocity|, gains, |torque| at the tick's estimate
// (kp (q - estimate) + kd (dq - estimate) + tau), and |torque - last frame's torque| <= torque_rate * period. After
// frames that asked for nothing, a torque may start from theirs or from none. A torque that brakes is one that pushes:
// it would push, were the estimate wrong.
// A position told to a drive with a position loop of its own goes no further in a period than the velocity limit says,
// from the one told before, or from where the joint was heard; nearer to where the joint is it may come. A drive with a
// velocity loop of its own moves no further than that by the limit on the speed it is told.
// What a protocol cannot say is not judged: torque of drives in CSP and CSV, gains of those that get a torque.
//
// Tolerances are what the wire rounds away, derived in joint_facts.cpp, and a thousandth of the torque limit for the
// arithmetic of two float32 programs.
//
// A frame that does not pass is replaced in place: damping for a joint that is to be enabled, else disable, written
// here too, inside the same torque and slew limits (replace.hpp). Pure, no allocation after construction, 9 to 23 ns a
// frame (`./dev bench codec`). Thread rule: one thread at a time.
#pragma once

#include <cstddef>
#include <vector>

#include "config/robot_config.hpp"
#include "drivers/bus/can_bus.hpp"
#include "drivers/guard/joint_facts.hpp"
#include "executive/contract/tick_record.hpp"
#include "executive/contract/wire_verdict.hpp"

namespace takt::drivers {

struct GuardedMoment {
  MonoTime decided_at;   // of the tick
  MonoTime now;          // of the write
  MonoTime valid_until;  // until when the decision may be obeyed
  bool enabled = false;  // this joint's drive
  float shift = 0;       // rad, joint side: what its drive's readings are off by since power-on
};

// The port that the edge to the drives sends through.
class FrameGuard {
 public:
  virtual ~FrameGuard() = default;
  // `frame` is about to leave on `bus` for the drive of `joint`, whose feedback, estimate and setpoint `record` holds.
  // Afterwards `frame` may leave, whatever it was before. Precondition: joint is one of the robot's.
  virtual WireVerdict pass(std::size_t joint, std::size_t bus, const GuardedMoment& moment, const JointRecord& record,
                           CanFrame& frame) noexcept = 0;
};

class WireGuard final : public FrameGuard {
 public:
  explicit WireGuard(const config::RobotConfig& robot);
  WireVerdict pass(std::size_t joint, std::size_t bus, const GuardedMoment& moment, const JointRecord& record,
                   CanFrame& frame) noexcept override;

 private:
  struct Guarded {
    guard::JointFacts facts;  // its offset: with the shift of the newest frame
    guard::LastTold last;
    float offset = 0;  // by the robot file
  };
  std::vector<Guarded> joints_;
  Duration feedback_timeout_;
};

}  // namespace takt::drivers

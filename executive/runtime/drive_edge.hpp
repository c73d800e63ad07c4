// SPDX-License-Identifier: Apache-2.0
// The edge to the drives: frames in become feedback, setpoints become frames. Every frame that crosses is recorded.
//
// Order on the wire, every tick: bus by bus in configuration order, on each bus its joints in configuration order, each
// joint's frames in the order its driver wrote them; a joint whose turn it is not is left out, but for changes of mode
// (is_written in contract/tick_record.hpp). Receiving is bounded: at most kMaxFramesPerBus per bus and tick;
// the rest waits in the kernel's queue for the next tick. A drive answers each of its frames once: more than
// kMaxFramesPerDrive per joint, or a full portion, is more than our drives can say, and the bus's health says `flooded`
// for that tick.
//
// Looks again before sending: the clock is read before each joint's frames. A setpoint that is too late by then
// (TickOutput::send_by) stays here, and the drive gets the tick's damping in its place. Once the computer was suspended
// since the tick began, nothing of that tick leaves any more: its age is unknown. Thread rule: control thread,
// after construction. No allocation or lock; system calls: the buses' send and receive, and the torque output's.
//
// The output that permits torque, where the robot has one, is told before the tick's first frame, in every tick: power
// that is to go does not wait for a bus.
#pragma once

#include <cstddef>
#include <cstdint>
#include <memory>
#include <span>
#include <vector>

#include "drivers/bus/can_bus.hpp"
#include "drivers/guard/wire_guard.hpp"
#include "drivers/protocol/joint_driver.hpp"
#include "drivers/torque_output/torque_output.hpp"
#include "executive/pipeline/control_tick.hpp"
#include "executive/runtime/clock.hpp"
#include "executive/runtime/published_segments.hpp"
#include "executive/runtime/suspend_watch.hpp"

namespace takt::runtime {

inline constexpr std::size_t kMaxFramesPerBus = 64;

struct JointOnBus {
  std::unique_ptr<drivers::JointDriver> driver;
  std::size_t bus = 0;
  Turns turns{};
};

// What became of a tick's setpoints; inputs of the next tick.
struct Departure {
  MonoTime at;           // just before the first frame; unset: the robot has no joint
  JointMask damped = 0;  // joints whose setpoint was too late
  TorqueOutputState torque_output = TorqueOutputState::none;
};

class DriveEdge {
 public:
  // Preconditions: at most kMaxBuses buses and kMaxJoints joints, every joint's bus exists.
  DriveEdge(std::vector<std::unique_ptr<drivers::CanBus>> buses, std::vector<JointOnBus> joints,
            std::unique_ptr<drivers::FrameGuard> guard, std::unique_ptr<drivers::TorqueOutput> torque = nullptr);

  // Everything that arrived, decoded into input.joints and input.buses. Returns the number of frames.
  std::size_t receive(pipeline::TickInput& input, PublishedSegments& records) noexcept;
  // One setpoint per joint, as TickOutput has them. A drive that is not enabled is kept de-energised and reporting.
  // Every frame passes the guard: one that it refuses is recorded as such, its replacement leaves, and the next
  // receive() tells the tick. Drives with a watchdog are told what is left of `valid_until` just before their frames
  // are written. `suspend`: as the tick read it when it began.
  Departure send(const pipeline::TickOutput& output, Clock& clock, const SuspendWatch& suspend,
                 PublishedSegments& records) noexcept;

 private:
  [[nodiscard]] bool is_flood(std::size_t bus, std::size_t frames) const noexcept;
  void send_joint(std::size_t joint, const pipeline::TickOutput& output, bool damped, MonoTime now, Clock& clock,
                  const SuspendWatch& suspend, PublishedSegments& records) noexcept;
  void send_guarded(std::size_t joint, const drivers::GuardedMoment& moment, const JointRecord& decided,
                    drivers::CanFrame& frame, std::uint64_t tick, PublishedSegments& records) noexcept;
  void offer(std::size_t bus, const drivers::ReceivedFrame& received) noexcept;

  std::vector<std::unique_ptr<drivers::CanBus>> buses_;
  std::vector<JointOnBus> joints_;
  std::unique_ptr<drivers::FrameGuard> guard_;
  std::unique_ptr<drivers::TorqueOutput> torque_;  // null: the robot has none
  std::vector<WireVerdict> refused_;               // per joint, the first since the last receive()
  std::vector<std::vector<std::size_t>> joints_of_bus_;
  std::vector<std::uint32_t> foreign_frames_;  // per bus, since start
  std::vector<drivers::ReceivedFrame> received_;
  std::vector<drivers::CanFrame> encoded_;
};

}  // namespace takt::runtime

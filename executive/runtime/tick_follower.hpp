// SPDX-License-Identifier: Apache-2.0
// The service thread's view of the ticks: reads the executive's own tick ring behind the control thread's back, finds
// mode transitions, and watches whether the robot rests. Thread rule: service thread.
#pragma once

#include <array>
#include <cstdint>
#include <functional>

#include "executive/contract/joints.hpp"
#include "executive/contract/tick_record.hpp"
#include "executive/incident/incident.hpp"
#include "executive/ipc/slot_ring.hpp"
#include "executive/pipeline/rest_watch.hpp"
#include "executive/pipeline/tick_config.hpp"
#include "executive/runtime/bus_shares.hpp"
#include "executive/runtime/queue_watch.hpp"

namespace takt::runtime {

class TickFollower {
 public:
  using OnTransition = std::function<void(const TickRecord&)>;

  // Passive joints of `config`, which outlives the follower, are not asked whether they rest. on_transition is called
  // for every record in which the mode changed.
  TickFollower(ipc::SlotReader ticks, const pipeline::TickConfig& config, OnTransition on_transition);
  // Called for every record in which a change of policy was asked for, came, or did not.
  void on_policy_change(OnTransition called) { on_policy_change_ = std::move(called); }
  // Called once for every joint that reads elsewhere after a silence (ReplyFault::moved_unheard).
  using OnJoint = std::function<void(const TickRecord&, std::size_t joint)>;
  void on_moved_unheard(OnJoint called) { on_moved_unheard_ = std::move(called); }

  // Stops and faults, and what waits on the buses, are followed with these from now on; they outlive the follower.
  void tell(incident::IncidentWatch& incidents) { incidents_ = &incidents; }
  void tell(QueueWatch& queues) { queues_ = &queues; }
  [[nodiscard]] const incident::IncidentWatch* incidents() const { return incidents_; }  // null: told to none
  // Reads everything published so far.
  void catch_up();
  // All zero before the first tick.
  [[nodiscard]] const TickRecord& latest() const { return latest_; }
  [[nodiscard]] const BusShares& buses() const { return buses_; }
  // Every joint, but passive ones and those whose drives a latched fault gave up, rests by the rule of
  // pipeline/rest_watch.hpp.
  [[nodiscard]] bool rests() const;
  [[nodiscard]] JointMask asked_for_rest() const;
  // The newest tick that read this request; 0: none did.
  [[nodiscard]] std::uint64_t last_read(OperatorRequest request) const {
    return last_read_.at(static_cast<std::size_t>(request));
  }
  // A tick later than `after_tick` read this request.
  [[nodiscard]] bool noticed(OperatorRequest request, std::uint64_t after_tick) const;
  // Records overwritten before they were read.
  [[nodiscard]] std::uint64_t lost() const { return lost_; }

 private:
  void follow();
  void follow_places();

  ipc::SlotReader ticks_;
  const pipeline::TickConfig& config_;
  OnTransition on_transition_;
  OnTransition on_policy_change_;
  OnJoint on_moved_unheard_;
  JointMask moved_unheard_ = 0;
  incident::IncidentWatch* incidents_ = nullptr;
  QueueWatch* queues_ = nullptr;
  BusShares buses_;
  TickRecord latest_{};
  pipeline::RestWatch rest_;
  std::array<std::uint64_t, kOperatorRequestCount> last_read_{};  // tick that last read each request; 0 never
  std::uint64_t lost_ = 0;
};

}  // namespace takt::runtime

// SPDX-License-Identifier: Apache-2.0
// The executive's log: mode transitions with their causes as they happen; missed periods and refused commands counted
// by cause, at most once a second. Written by the service thread from what the control thread published; the control
// thread never logs.
#pragma once

#include <optional>
#include <string>

#include "config/robot_config.hpp"
#include "executive/contract/mono_time.hpp"
#include "executive/contract/session.hpp"
#include "executive/incident/incident.hpp"

namespace takt::runtime {

class Journal {
 public:
  // `incident`: that the transition is, if it is one.
  static void transition(const TickRecord& record, const std::optional<incident::Incident>& incident);
  // A change of policy that was asked for, came, or did not.
  static void policy_change(const TickRecord& record);
  // A joint that reads elsewhere after a silence of its drive.
  static void moved_unheard(const TickRecord& record, std::size_t index, const config::Joint& joint);
  // Call it often; it says what is new since it last spoke.
  void summarise(MonoTime now, const StatusSnapshot& status);

 private:
  MonoTime spoke_at_;
  StatusSnapshot said_;
};

// "tracking, command fresh, skipped periods 0": the service manager's status line. Changes rarely, so that it is sent
// rarely.
std::string status_line(const StatusSnapshot& status);

}  // namespace takt::runtime

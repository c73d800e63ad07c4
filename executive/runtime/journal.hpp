// The executive's log: mode transitions with their causes as they happen; missed periods and refused commands counted
// by cause, at most once a second. Written by the service thread from what the control thread published; the control
// thread never logs.
#pragma once

#include <string>

#include "config/robot_config.hpp"
#include "executive/contract/mono_time.hpp"
#include "executive/contract/session.hpp"

namespace takt::runtime {

class Journal {
 public:
  static void transition(const TickRecord& record, const config::RobotConfig& robot);
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

// SPDX-License-Identifier: Apache-2.0
// Keeps a LiveView fed from a running executive: attaches as a viewer, attaches again after a restart, and asks once a
// second what only the service thread knows. Reads only; the executive's loop never learns of it.
// Thread rule: one thread at a time. look() may wait up to kPatience for a service thread that is busy.
#pragma once

#include <chrono>
#include <optional>
#include <string>

#include "cli/top/live_view.hpp"
#include "config/robot_config.hpp"
#include "monitor/executive_session.hpp"
#include "monitor/record/record_stream.hpp"

namespace takt::monitor::top {

inline constexpr std::chrono::milliseconds kPatience{200};

class Attachment {
 public:
  // Both outlive this.
  Attachment(const config::RobotConfig& robot, std::string runtime_directory, LiveView& view);
  Attachment(const Attachment&) = delete;
  Attachment& operator=(const Attachment&) = delete;

  // Takes in what happened since. The first look after attaching brings up to 8 s of the past.
  void look(MonoTime now);

 private:
  void attach(MonoTime now);
  void ask_status(MonoTime now);

  const config::RobotConfig& robot_;
  std::string runtime_directory_;
  LiveView& view_;
  RecordSink sink_;
  std::optional<ExecutiveSession> session_;
  std::optional<RecordStream> stream_;
  MonoTime tried_at_, asked_at_;
};

}  // namespace takt::monitor::top

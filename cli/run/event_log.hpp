// SPDX-License-Identifier: Apache-2.0
// Writes events.jsonl (monitor/record/run_events.hpp) while a robot runs: into the run folder as soon as the monitor
// has made it, before that into memory. Thread rule: one thread.
#pragma once

#include <nlohmann/json_fwd.hpp>
#include <string>
#include <string_view>

#include "executive/contract/mono_time.hpp"
#include "executive/contract/monotonic_clock.hpp"

namespace takt::cli {

class EventLog {
 public:
  // `run_folder`: not there yet.
  explicit EventLog(std::string run_folder) : run_folder_(std::move(run_folder)) {}
  EventLog(const EventLog&) = delete;
  EventLog& operator=(const EventLog&) = delete;
  ~EventLog();

  // A line with this `event`, its instant, and the members of `more`, an object. It is in the file before this returns,
  // if there is a run folder that takes it.
  void note(std::string_view event, const nlohmann::ordered_json& more, MonoTime at = monotonic_now());
  // What waits for its file.
  void flush();

 private:
  std::string run_folder_;
  std::string waiting_;
  int file_ = -1;
};

}  // namespace takt::cli

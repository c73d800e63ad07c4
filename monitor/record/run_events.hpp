// SPDX-License-Identifier: Apache-2.0
// events.jsonl of a run folder: what was done to the robot from outside, one JSON object per line, written by `takt
// run` while it does it (docs/run-folder.md). A run that something else supervises has none.
#pragma once

#include <cstddef>
#include <string>
#include <string_view>
#include <vector>

#include "executive/contract/mono_time.hpp"
#include "monitor/record/run_folder.hpp"

namespace takt::monitor {

inline constexpr std::string_view kEventsFile = "events.jsonl";

// More than any script has. A reader takes no more, whatever a file holds: each stop is held against each of them.
inline constexpr std::size_t kMostRunEvents = 1000;

struct RunEvent {
  std::string event;  // run, scenario, started, tracking, script, fault, missed, ended, ending
  MonoTime at;
  std::string given;    // script, missed: as its user wrote it: "--at '3 s: kill policy'"
  std::string action;   // script: "kill"
  std::string process;  // script: that it strikes; started, ended: "takt-policy-host"
  std::string what;     // fault: "elbow: silent for 200 ms"
  std::string how;      // ended: "was killed by SIGKILL"
  Duration length;      // script: of what ends by itself
  bool is_sealed = false;
};

// In file order, the first kMostRunEvents. What is no such line is passed over. Of a run without a closed seal every
// line counts as sealed: nothing can tell which of them was added later.
std::vector<RunEvent> read_run_events(const RunFolder& folder);

}  // namespace takt::monitor

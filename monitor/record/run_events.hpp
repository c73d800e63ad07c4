// SPDX-License-Identifier: Apache-2.0
// events.jsonl of a run folder: what was done to the robot from outside, what its policies' hosts say of themselves,
// and who asked for what, one JSON object per line (docs/run-folder.md). The first is written by `takt run` while it
// does it, and missing where something else supervises the robot; the others by the monitor.
#pragma once

#include <cstddef>
#include <cstdint>
#include <nlohmann/json_fwd.hpp>
#include <string>
#include <string_view>
#include <vector>

#include "executive/contract/mono_time.hpp"
#include "monitor/record/run_folder.hpp"

namespace takt::monitor {

inline constexpr std::string_view kEventsFile = "events.jsonl";

// More than any script has. A reader takes no more, whatever a file holds: each stop is held against each of them. As
// many words of policies are written and read, and as many requests of operators.
inline constexpr std::size_t kMostRunEvents = 1000;

struct RunEvent {
  std::string event;  // run, scenario, started, tracking, script, fault, missed, ended, ending, policy, operator
  MonoTime at;
  std::string given;    // script, missed: as its user wrote it: "--at '3 s: kill policy'"
  std::string action;   // script: "kill"; operator: "arm"
  std::string process;  // script: that it strikes; started, ended: "takt-policy-host"; operator: that asked
  std::string role;     // policy: "policy", "fallback policy", "candidate policy"
  std::string kind;     // policy: PolicyWordKind
  std::string what;     // fault: "elbow: silent for 200 ms"; policy: its sentence; operator: the answer
  std::string how;      // ended: "was killed by SIGKILL"
  Duration length;      // script: of what ends by itself
  std::uint64_t first_sequence = 0;  // policy: of a source's first command
  std::uint64_t superseded = 0;      // policy: words that came before it and are not in the file
  std::int64_t pid = 0, uid = 0;     // operator
  bool done = false;                 // operator
  bool is_sealed = false;
};

// A line of the file, with its end: an event, its instant and the members of `more`, an object.
std::string event_line(std::string_view event, MonoTime at, const nlohmann::ordered_json& more);

// In file order, the first kMostRunEvents of each of the three kinds. What is no such line is passed over. Of a run
// without a closed seal every line counts as sealed: nothing can tell which of them was added later.
std::vector<RunEvent> read_run_events(const RunFolder& folder);

}  // namespace takt::monitor

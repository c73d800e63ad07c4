// SPDX-License-Identifier: Apache-2.0
// What of a run's stops and losses its script asked for, which process had ended by then, and what a policy's host said
// kept it from answering: events.jsonl (monitor/record/run_events.hpp) beside the ticks. What acts, on what, and until
// when decides: a killed policy explains a lost command and no drive's fault, and a process that was started again
// explains nothing any more.
#pragma once

#include <optional>
#include <string>
#include <vector>

#include "config/robot_config.hpp"
#include "executive/incident/incident.hpp"
#include "monitor/judge/fault_classifier.hpp"
#include "monitor/record/run_events.hpp"

namespace takt::monitor {

struct ScriptFinding {
  std::string scripted;  // "--at '3 s: kill policy', 612 ms before"; empty: nothing scripted explains it
  std::string ended;     // "takt-policy-host was killed by SIGKILL, 611 ms before"; empty: what it needs ran
  std::string said;      // "policy: its policy left, 140 ms before"; empty: its host said nothing
};

class Script {
 public:
  Script(std::vector<RunEvent> events, const config::RobotConfig& robot);

  // Of a stop by `cause`, at that instant.
  [[nodiscard]] ScriptFinding of(Cause cause, MonoTime at) const;
  // How the process ended first after `since`: "takt-monitor was killed by SIGKILL"; empty: it did not.
  [[nodiscard]] std::string end_of(std::string_view process, MonoTime since) const;
  // Puts what was found into the sentence. A scripted stop is asked for.
  ScriptFinding explain(incident::Incident& incident) const;
  void explain(FaultSummary& faults) const;

 private:
  [[nodiscard]] std::string sensors_end(std::string_view problem, MonoTime at) const;
  [[nodiscard]] std::string problem_at(MonoTime at) const;
  [[nodiscard]] MonoTime over_at(const RunEvent& event) const;  // unset: it lasts to the end
  [[nodiscard]] const RunEvent* next(std::string_view event, const RunEvent& since) const;

  std::vector<RunEvent> events_;
  Duration grace_;  // from what acts to the stop that it leads to
};

}  // namespace takt::monitor

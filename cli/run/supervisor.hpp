// SPDX-License-Identifier: Apache-2.0
// `takt run` from start to end: starts a robot's processes and waits for each, arms, follows the run and its scenario,
// and ends everything in the order that loses neither the robot nor the evidence. Nothing outlives it.
//
// A policy host, monitor or sensor's program that dies is reported (and restarted, when asked for); the executive or
// the plant dying ends the run, and so does an executive that answers nothing for some seconds. Times of the scenario
// and the duration count from the moment tracking began (without `arm` the duration counts from readiness). Thread
// rule: one thread, which has SIGINT, SIGTERM, SIGHUP and SIGCHLD blocked.
#pragma once

#include <array>
#include <expected>
#include <map>
#include <optional>
#include <set>
#include <string>
#include <vector>

#include "cli/run/contention.hpp"
#include "cli/run/event_log.hpp"
#include "cli/run/live_display.hpp"
#include "cli/run/plant_log.hpp"
#include "cli/run/rearming.hpp"
#include "cli/run/robot_processes.hpp"
#include "cli/run/scenario.hpp"

namespace takt::cli {

struct RunOptions {
  RobotPlace place;
  std::optional<Duration> duration;
  std::vector<Event> events;  // in order of time
  bool arm = false;
  bool restart = false;
  std::optional<Duration> rearm_after = {};    // from a stop or fault; empty: they are not ended
  bool to_the_end = false;                     // for the whole duration, even if the robot rests after a scripted stop
  std::string plant_scenario = {};             // file that takt-plant plays; empty: none
  std::vector<std::string> plant_faults = {};  // that are in it: "elbow: silent for 200 ms"
};

class Supervisor {
 public:
  Supervisor(const config::RobotConfig& robot, RunOptions options);
  ~Supervisor();
  Supervisor(const Supervisor&) = delete;
  Supervisor& operator=(const Supervisor&) = delete;
  // Exit code.
  int run();

 private:
  // Why the run ended, or is to end.
  struct End {
    int exit_code = 0;
    std::string sentence;
  };
  using Outcome = std::expected<void, End>;

  Outcome start_all();
  Outcome wait_ready(ProcessName process);
  Outcome start_sensors();
  Outcome arm();
  Outcome follow();
  Outcome look_after_children();
  Outcome fire_due_events();
  Outcome fire(const Event& event);
  void send(const Event& event, int signal);
  // Why it could not; empty: it runs.
  std::string restart(ProcessName process);
  void request(const Event& event, OperatorVerb verb);
  // What was asked for, in the words of its user, and did not happen.
  void miss(const std::string& given, const std::string& why);
  void miss_the_rest();
  // For events.jsonl.
  void note_beginning();
  void note_started(const std::string& label, const ChildProcess* child);
  void note_ended(const std::string& label, const ChildProcess* child);
  void note_plant_faults();
  void rearm(Mode mode, bool stopped_by_another);
  void see(const OperatorReply& reply);
  // Of the incident that stands: a process that is gone needs no look at its log. Empty: none stands.
  [[nodiscard]] std::string incident_text(const IncidentNote& incident);
  // The last word about a robot that stands: in which stop or fault, and the exit code that it calls for.
  void tell_incident(End& end);
  // What the recorder found of the robot itself.
  void tell_loads() const;
  [[nodiscard]] int exit_code_of_the_dead();
  void look_after_sensors();
  // A process that dies as soon as it runs would otherwise be started hundreds of times a second, beside the robot.
  [[nodiscard]] bool is_restart_due(const std::string& label) const;
  // Says once that no command finds the executive any more.
  void look_for_socket();
  // What ends the run, whether or not the executive answers.
  Outcome judge_time() const;
  Outcome judge_progress(const StatusSnapshot& status);
  // Sleeps until `until`, a child's death or a signal; an error when asked to end.
  Outcome pause(Duration until);
  [[nodiscard]] Duration now() const;  // since the supervisor was made

  const config::RobotConfig& robot_;
  RunOptions options_;
  RobotProcesses processes_;
  LiveDisplay display_;
  Contention contention_;
  EventLog events_;
  PlantLog plant_log_;
  Rearming person_;
  int signals_ = -1;  // signalfd
  Duration made_at_;
  std::size_t next_event_ = 0;
  std::optional<Duration> ready_at_, tracking_since_, stopped_at_;
  Duration answered_at_;       // the newest status
  bool was_recorded_ = false;  // at some instant, in a run folder
  bool socket_is_gone_ = false;
  IncidentNote incident_;  // as of then
  std::set<ProcessName> reported_dead_, killed_by_script_;
  std::map<std::string, Duration> started_at_;  // by label: the newest try
  std::set<std::size_t> dead_sensors_;          // reported, and not restarted since
  std::vector<std::string> never_happened_;     // sentences
  std::set<pid_t> noted_ended_;
  bool script_ends_run_ = false;  // it killed the policy or asked for a stop
  bool asked_to_stop_ = false;    // by the script, since the robot last tracked
};

}  // namespace takt::cli

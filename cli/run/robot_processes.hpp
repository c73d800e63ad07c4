// SPDX-License-Identifier: Apache-2.0
// The processes of one robot, as `takt run` starts and ends them: takt-plant (when the robot file has `simulation`),
// takt-executive, takt-monitor, takt-policy-host (when it has `policy`) and a second one of it (when it has a fallback
// policy), all found beside the `takt` program; instead of the last two another program may stand, a
// policy in Python or C. Programs that serve sensors are its user's. Thread rule: one thread.
#pragma once

#include <array>
#include <expected>
#include <optional>
#include <string>
#include <vector>

#include "cli/run/child_process.hpp"
#include "cli/run/scenario.hpp"
#include "config/robot_config.hpp"
#include "executive/contract/session.hpp"
#include "policy_host/boundary.hpp"

namespace takt::cli {

// A program that serves a sensor of the robot (docs/sensors.md).
struct SensorProgram {
  std::string sensor;   // its name in the robot file
  std::string command;  // of the shell; `--robot FILE --runtime-dir DIR` follow it
};

struct RobotPlace {
  std::string robot_file;
  std::string runtime_directory;
  std::string run_directory;  // must not exist yet: the monitor makes it
  bool allow_non_realtime = false;
  std::vector<std::string> plant_arguments = {};   // further ones of takt-plant
  std::string policy_host = {};                    // path of a program instead of takt-policy-host; empty: itself
  std::vector<std::string> policy_arguments = {};  // of the policy host
  policy_host::Grants policy_grants = {};
  std::vector<SensorProgram> sensors = {};
};

class RobotProcesses {
 public:
  // Both outlive this object.
  RobotProcesses(const config::RobotConfig& robot, const RobotPlace& place);

  // In the order in which they start; only those the robot has.
  [[nodiscard]] std::vector<ProcessName> wanted() const;
  // Replaces a dead predecessor.
  std::expected<void, std::string> start(ProcessName process);
  // Does it serve, as far as can be seen from outside? `status`: the executive's, if it answers.
  [[nodiscard]] bool is_ready(ProcessName process, const std::optional<StatusSnapshot>& status) const;
  // nullptr: never started.
  [[nodiscard]] ChildProcess* find(ProcessName process);
  // The same of place.sensors[index].
  std::expected<void, std::string> start_sensor(std::size_t index);
  [[nodiscard]] bool is_sensor_ready(std::size_t index) const;
  [[nodiscard]] ChildProcess* find_sensor(std::size_t index);
  // What a policy started and left, and what has ended since. Called often: it would stay in the process table for
  // good.
  void reap_orphans();
  // The executive first (damped stop), then policy host, plant, and the monitor last, so that it records the end.
  void end_all();
  // Log files move into the run folder, if there is one; returns the folder they are in now.
  [[nodiscard]] std::string settle_logs() const;

  [[nodiscard]] std::optional<StatusSnapshot> ask_status() const;
  [[nodiscard]] std::expected<OperatorReply, std::string> ask(OperatorVerb verb) const;

 private:
  [[nodiscard]] std::string log_directory() const;
  std::expected<void, std::string> start(ChildProcess::Options options, std::optional<ChildProcess>& child) const;
  [[nodiscard]] std::string path_of(ProcessName process) const;
  void end_left_behind();
  [[nodiscard]] bool is_known(pid_t pid) const;
  [[nodiscard]] policy_host::Grants granted_to(const std::string& program) const;
  const config::RobotConfig& robot_;
  const RobotPlace& place_;
  std::array<std::optional<ChildProcess>, kProcessCount> children_;
  std::vector<std::optional<ChildProcess>> sensors_;  // as place.sensors
};

// Path of a program that is installed with this one.
std::string beside_this_program(std::string_view program_name);
// "takt-policy-host"
std::string_view program(ProcessName process);
// The same, but where one program runs twice: "takt-policy-host-fallback". Names its log.
std::string label(ProcessName process);
// "sensor-cam0"
std::string label(const SensorProgram& program);

}  // namespace takt::cli

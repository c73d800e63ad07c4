// SPDX-License-Identifier: Apache-2.0
#include "cli/run/robot_processes.hpp"

#include <fmt/format.h>
#include <signal.h>
#include <sys/prctl.h>
#include <sys/socket.h>
#include <sys/un.h>
#include <sys/wait.h>
#include <unistd.h>

#include <algorithm>
#include <cstring>
#include <filesystem>
#include <fstream>

#include "config/paths.hpp"
#include "executive/ipc/rendezvous.hpp"
#include "executive/ipc/unix_socket.hpp"

namespace takt::cli {
namespace {

namespace fs = std::filesystem;

constexpr std::array<std::string_view, kProcessCount> kPrograms{"takt-plant", "takt-executive", "takt-monitor",
                                                                "takt-policy-host", "takt-policy-host"};
// A damped stop may take a while; the recorder compresses what is left.
constexpr auto kExecutiveEndsWithin = std::chrono::seconds(15);
constexpr auto kOthersEndWithin = std::chrono::seconds(5);
constexpr auto kMonitorEndsWithin = std::chrono::seconds(20);

// When the supervisor dies: the executive stops softly and the recorder closes its files; a policy host may be frozen
// and a simulator has nothing to lose.
int parent_death_signal(ProcessName process) {
  switch (process) {
    case ProcessName::executive:
    case ProcessName::monitor:
      return SIGTERM;
    case ProcessName::plant:
    case ProcessName::policy:
    case ProcessName::fallback:
      return SIGKILL;
  }
  return SIGKILL;
}

bool is_served(const std::string& path) {
  sockaddr_un address{};
  address.sun_family = AF_UNIX;
  if (path.size() >= sizeof address.sun_path) return false;
  path.copy(address.sun_path, sizeof address.sun_path - 1);
  const int fd = socket(AF_UNIX, SOCK_SEQPACKET | SOCK_CLOEXEC | SOCK_NONBLOCK, 0);
  if (fd < 0) return false;
  const bool connected =
      connect(fd, static_cast<const sockaddr*>(static_cast<const void*>(&address)), sizeof address) == 0;
  close(fd);
  return connected;
}

}  // namespace

std::string beside_this_program(std::string_view program_name) {
  std::error_code error;
  const fs::path self = fs::read_symlink("/proc/self/exe", error);
  return (self.parent_path() / program_name).string();
}

std::string_view program(ProcessName process) {
  return kPrograms[static_cast<std::size_t>(process)];
}

std::string label(ProcessName process) {
  return std::string(program(process)) + (process == ProcessName::fallback ? "-fallback" : "");
}

std::string label(const SensorProgram& program) {
  return "sensor-" + program.sensor;
}

RobotProcesses::RobotProcesses(const config::RobotConfig& robot, const RobotPlace& place)
    : robot_(robot), place_(place), sensors_(place.sensors.size()) {
  prctl(PR_SET_CHILD_SUBREAPER, 1);
}

std::vector<ProcessName> RobotProcesses::wanted() const {
  std::vector<ProcessName> processes;
  if (robot_.simulation) processes.push_back(ProcessName::plant);
  processes.push_back(ProcessName::executive);
  processes.push_back(ProcessName::monitor);
  if (robot_.policy) processes.push_back(ProcessName::policy);
  if (config::fallback_policy_of(robot_) != nullptr) processes.push_back(ProcessName::fallback);
  return processes;
}

std::string RobotProcesses::log_directory() const {
  return place_.runtime_directory + "/logs";
}

std::string RobotProcesses::path_of(ProcessName process) const {
  const bool is_host = process == ProcessName::policy || process == ProcessName::fallback;
  const bool is_own = is_host && !place_.policy_host.empty();
  return is_own ? place_.policy_host : beside_this_program(program(process));
}

// Our own bridge is no policy: it brings one from another machine.
policy_host::Grants RobotProcesses::granted_to(const std::string& program) const {
  policy_host::Grants grants = place_.policy_grants;
  grants.runtime_directory = place_.runtime_directory;
  std::error_code error;
  if (fs::equivalent(program, beside_this_program("takt-policy-bridge"), error)) grants.network = true;
  return grants;
}

std::expected<void, std::string> RobotProcesses::start(ProcessName process) {
  ChildProcess::Options options;
  options.name = label(process);
  options.arguments = {path_of(process), "--robot", place_.robot_file, "--runtime-dir", place_.runtime_directory};
  if (access(options.arguments[0].c_str(), X_OK) != 0)
    return std::unexpected(fmt::format("{} is not there: {}; build or install it beside takt", options.arguments[0],
                                       std::strerror(errno)));
  if (process == ProcessName::executive && place_.allow_non_realtime)
    options.arguments.emplace_back("--allow-non-realtime");
  if (process == ProcessName::plant)
    options.arguments.insert(options.arguments.end(), place_.plant_arguments.begin(), place_.plant_arguments.end());
  if (process == ProcessName::policy)
    options.arguments.insert(options.arguments.end(), place_.policy_arguments.begin(), place_.policy_arguments.end());
  if (process == ProcessName::fallback) options.arguments.emplace_back("--fallback");
  if (process == ProcessName::monitor) {
    options.arguments.emplace_back("--run-dir");
    options.arguments.push_back(place_.run_directory);
  }
  options.parent_death_signal = parent_death_signal(process);
  if (process == ProcessName::policy || process == ProcessName::fallback)
    options.place = place_of_policy(robot_, granted_to(options.arguments[0]));
  return start(std::move(options), children_[static_cast<std::size_t>(process)]);
}

// The shell becomes the program, so that signals reach it.
std::expected<void, std::string> RobotProcesses::start_sensor(std::size_t index) {
  const SensorProgram& program = place_.sensors[index];
  ChildProcess::Options options;
  options.name = label(program);
  options.arguments = {"/bin/sh",
                       "-c",
                       "exec " + program.command + " \"$@\"",
                       "sh",
                       "--robot",
                       place_.robot_file,
                       "--runtime-dir",
                       place_.runtime_directory};
  options.parent_death_signal = SIGTERM;
  options.with_its_group = true;
  return start(std::move(options), sensors_[index]);
}

std::expected<void, std::string> RobotProcesses::start(ChildProcess::Options options,
                                                       std::optional<ChildProcess>& child) const {
  std::error_code error;
  fs::create_directories(log_directory(), error);
  if (error)
    return std::unexpected(
        fmt::format("{} cannot be made: {}; choose another --runtime-dir", log_directory(), error.message()));
  options.log_path = fmt::format("{}/{}.log", log_directory(), options.name);
  if (!child) fs::remove(options.log_path, error);  // of an earlier run; a restart adds to this run's
  auto started = ChildProcess::start(std::move(options));
  if (!started) return std::unexpected(started.error());
  child = std::move(*started);
  return {};
}

bool RobotProcesses::is_ready(ProcessName process, const std::optional<StatusSnapshot>& status) const {
  const auto is_pid = [&](std::uint64_t pid) {
    const auto& child = children_[static_cast<std::size_t>(process)];
    return child && pid == static_cast<std::uint64_t>(child->pid());
  };
  switch (process) {
    case ProcessName::plant: {
      const bool buses = std::ranges::all_of(robot_.buses, [&](const config::Bus& bus) {
        return fs::exists("/sys/class/net/" + bus.interface) ||
               is_served(config::loopback_socket(place_.runtime_directory, bus.interface));
      });
      const std::string& camera = robot_.simulation->camera_sensor;
      return buses && (camera.empty() || is_served(config::sensor_socket(place_.runtime_directory, camera)));
    }
    case ProcessName::executive:
      return status.has_value();
    case ProcessName::monitor:
      return status && is_pid(status->monitor_pid);
    case ProcessName::policy:
      return status && is_pid(status->policy_pids[Seat::policy]);
    case ProcessName::fallback:
      return status && is_pid(status->policy_pids[Seat::fallback]);
  }
  return false;
}

bool RobotProcesses::is_sensor_ready(std::size_t index) const {
  return is_served(config::sensor_socket(place_.runtime_directory, place_.sensors[index].sensor));
}

ChildProcess* RobotProcesses::find_sensor(std::size_t index) {
  return sensors_[index] ? &*sensors_[index] : nullptr;
}

ChildProcess* RobotProcesses::find(ProcessName process) {
  auto& child = children_[static_cast<std::size_t>(process)];
  return child ? &*child : nullptr;
}

bool RobotProcesses::is_known(pid_t pid) const {
  const auto is_it = [pid](const auto& child) { return child && child->pid() == pid; };
  return std::ranges::any_of(children_, is_it) || std::ranges::any_of(sensors_, is_it);
}

// One of ours that has ended is for its ChildProcess to see; the call after that goes on.
void RobotProcesses::reap_orphans() {
  constexpr int kAtOnce = 1000;
  for (int i = 0; i < kAtOnce; ++i) {
    siginfo_t ended{};
    if (waitid(P_ALL, 0, &ended, WEXITED | WNOHANG | WNOWAIT) != 0 || ended.si_pid == 0 || is_known(ended.si_pid))
      return;
    waitpid(ended.si_pid, nullptr, 0);
  }
}

// It became this process's child, and is in a policy's user namespace still.
void RobotProcesses::end_left_behind() {
  constexpr int kRounds = 100;  // each may leave others behind
  for (int round = 0; round < kRounds; ++round) {
    std::ifstream children(fmt::format("/proc/self/task/{}/children", getpid()));
    bool any = false;
    for (pid_t pid = 0; children >> pid;) {
      if (is_known(pid) || ipc::user_namespace_of(pid) != ipc::UserNamespace::another) continue;
      kill(pid, SIGKILL);
      any = waitpid(pid, nullptr, 0) == pid;
    }
    if (!any) return;
  }
}

void RobotProcesses::end_all() {
  const auto end = [this](ProcessName process, std::chrono::milliseconds limit) {
    if (ChildProcess* child = find(process)) child->end(limit);
  };
  end(ProcessName::executive, kExecutiveEndsWithin);
  end(ProcessName::policy, kOthersEndWithin);
  end(ProcessName::fallback, kOthersEndWithin);
  end_left_behind();
  for (std::optional<ChildProcess>& sensor : sensors_)
    if (sensor) sensor->end(kOthersEndWithin);
  end(ProcessName::plant, kOthersEndWithin);
  end(ProcessName::monitor, kMonitorEndsWithin);
}

std::string RobotProcesses::settle_logs() const {
  std::error_code error;
  std::string there = place_.run_directory + "/logs";
  if (!fs::is_directory(place_.run_directory, error)) return log_directory();
  fs::copy(log_directory(), there, fs::copy_options::recursive, error);
  if (error && fs::is_directory(log_directory())) return log_directory();
  fs::create_directory(there, error);
  const auto rescue = [&](const std::optional<ChildProcess>& child) {  // a log that lost its name with the directory
    if (!child || fs::exists(child->options().log_path, error)) return;
    std::ofstream(there + "/" + child->options().name + ".log", std::ios::app)
        << std::ifstream(child->log_file()).rdbuf();
  };
  std::ranges::for_each(children_, rescue);
  std::ranges::for_each(sensors_, rescue);
  fs::remove_all(log_directory(), error);
  return there;
}

std::optional<StatusSnapshot> RobotProcesses::ask_status() const {
  const auto reply = ask(OperatorVerb::status);
  if (!reply) return std::nullopt;
  return reply->status;
}

std::expected<OperatorReply, std::string> RobotProcesses::ask(OperatorVerb verb) const {
  const auto patience = std::chrono::milliseconds(verb == OperatorVerb::status ? 200 : 2000);
  return ipc::ask(config::executive_socket(place_.runtime_directory), verb, patience);
}

}  // namespace takt::cli

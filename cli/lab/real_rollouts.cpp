// SPDX-License-Identifier: Apache-2.0
#include "cli/lab/real_rollouts.hpp"

#include <fmt/format.h>
#include <fmt/ranges.h>
#include <signal.h>
#include <stdlib.h>
#include <sys/resource.h>

#include <chrono>
#include <cmath>
#include <filesystem>
#include <set>
#include <thread>
#include <vector>

#include "cli/command.hpp"
#include "cli/run/child_process.hpp"
#include "cli/run/robot_processes.hpp"
#include "cli/run/scenario.hpp"
#include "evidence/rollout/arm_world.hpp"
#include "evidence/rollout/real_perturbation.hpp"
#include "evidence/rollout/robot_copy.hpp"
#include "lab/panel/recorded_row.hpp"
#include "monitor/record/bounded_file.hpp"

namespace takt::cli {
namespace {

namespace fs = std::filesystem;

constexpr Duration kBeyondTheEnd = milliseconds(200);       // recorded, so that the rollout surely is whole
constexpr auto kOverheadWithin = std::chrono::seconds(90);  // starting, arming, ending, on a busy machine
constexpr auto kEndsWithin = std::chrono::seconds(40);
constexpr auto kChildrenLookEvery = std::chrono::milliseconds(20);

// A short path for sockets, gone with this object.
class RuntimeDirectory {
 public:
  RuntimeDirectory() : path_((fs::temp_directory_path() / "takt-panel.XXXXXX").string()) {
    if (mkdtemp(path_.data()) == nullptr) path_.clear();
  }
  RuntimeDirectory(const RuntimeDirectory&) = delete;
  RuntimeDirectory& operator=(const RuntimeDirectory&) = delete;
  ~RuntimeDirectory() {
    std::error_code ignored;
    if (!path_.empty()) fs::remove_all(path_, ignored);
  }
  [[nodiscard]] const std::string& path() const { return path_; }

 private:
  std::string path_;
};

double cpu_seconds(const rusage& usage) {
  const auto seconds_of = [](const timeval& time) {
    return static_cast<double>(time.tv_sec) + 1e-6 * static_cast<double>(time.tv_usec);
  };
  return seconds_of(usage.ru_utime) + seconds_of(usage.ru_stime);
}

// Of the processes that a rollout started.
class ChildMeter {
 public:
  ChildMeter() { getrusage(RUSAGE_CHILDREN, &before_); }
  void fill(Duration lived, evidence::HostMeasured& host) const {
    rusage now{};
    getrusage(RUSAGE_CHILDREN, &now);
    host.wall_s = std::chrono::duration<double>(std::chrono::steady_clock::now() - began_).count();
    host.cpu_s = cpu_seconds(now) - cpu_seconds(before_);
    host.peak_rss_kib = static_cast<std::uint64_t>(now.ru_maxrss);
    host.realtime_factor = lived.seconds() / host.wall_s;
  }

 private:
  rusage before_{};
  std::chrono::steady_clock::time_point began_ = std::chrono::steady_clock::now();
};

std::expected<void, std::string> run_to_its_end(ChildProcess& process, std::chrono::nanoseconds limit) {
  const auto give_up = std::chrono::steady_clock::now() + limit;
  while (process.alive()) {
    if (std::chrono::steady_clock::now() > give_up) {
      process.end(kEndsWithin);
      return std::unexpected("takt run did not end in time\n" + process.last_words());
    }
    std::this_thread::sleep_for(kChildrenLookEvery);
  }
  // A robot that stands at the end is a result.
  if (process.exit_code() == kExitOk || process.exit_code() == kExitStopped) return {};
  return std::unexpected(fmt::format("takt run {}\n{}", process.how_it_ended(), process.last_words()));
}

// Every sentence about what a real robot cannot be made to do.
std::set<std::string> obstacles(const lab::Contest& contest, const std::string& policy_host) {
  std::set<std::string> found;
  const lab::Panel& panel = contest.panel();
  for (const lab::PlannedRollout& planned : lab::plan_of(panel, {})) {
    const lab::PanelMethod& method = panel.methods[planned.method];
    const evidence::Perturbation perturbation = panel.perturbations[planned.perturbation].resolved();
    const config::RobotConfig& robot = contest.contestant(planned).robot;
    if (method.repeat_last)
      found.insert(fmt::format("method {}: `link: repeat_last` exists in virtual time only", method.name));
    if (method.method.built_in != evidence::BuiltIn::takt)
      found.insert(fmt::format("method {}: it is built in for virtual time; name another by --method", method.name));
    if (!robot.simulation) found.insert(robot.file + ": no `simulation`, so what the robot really did is unknown");
    const auto real = evidence::real_trouble_of(perturbation, robot, planned.seed);
    if (!real) found.insert(real.error());
    if (real && !real->policy_faults.empty() && !policy_host.empty())
      found.insert(fmt::format("perturbation {}: takt-policy-host does that, and --policy-host names another program",
                               panel.perturbations[planned.perturbation].kind));
  }
  return found;
}

std::string plant_file(const std::string& folder) {
  return folder + "/plant.yaml";
}

// A policy that would come back after the rollout does not: takt run refuses what cannot happen.
bool is_within(const std::string& action, Duration duration) {
  const auto events = parse_scenario({action});
  return !events || check_instants(*events, duration).has_value();
}

// Of the rollout that lives in `folder`: everything but where its sockets are.
std::vector<std::string> arguments_of(const lab::Panel& panel, const evidence::RealTrouble& trouble, std::uint64_t seed,
                                      const std::string& folder) {
  const auto microseconds_text = [](Duration time) { return fmt::format("{}us", time.ns / 1000); };
  std::vector<std::string> arguments{
      beside_this_program("takt"),
      "run",
      folder + "/robot.yaml",
      "--run-dir",
      folder + "/run",
      "--arm",
      "--to-the-end",
      "--duration",
      microseconds_text(panel.duration + kBeyondTheEnd),
      fmt::format("--plant=--seed={}", seed),
      fmt::format("--plant=--target-entry={:.3f}", evidence::target_entry(seed).seconds()),
      fmt::format("--plant=--truth={}/truth.jsonl", folder)};
  if (panel.rearm_after) arguments.insert(arguments.end(), {"--rearm-after", microseconds_text(*panel.rearm_after)});
  for (const std::string& action : trouble.actions)
    if (is_within(action, panel.duration + kBeyondTheEnd)) arguments.insert(arguments.end(), {"--at", action});
  for (const std::string& fault : trouble.policy_faults) arguments.push_back("--policy=--fault=" + fault);
  if (!trouble.policy_faults.empty()) arguments.push_back(fmt::format("--policy=--fault-seed={}", seed));
  if (!trouble.plant_scenario.empty()) arguments.push_back("--plant=--scenario=" + plant_file(folder));
  return arguments;
}

}  // namespace

std::expected<RealRollouts, std::string> RealRollouts::make(const lab::Contest& contest, std::string out,
                                                            evidence::OutsideProcesses outside,
                                                            bool allow_non_realtime) {
  std::set<std::string> sentences = obstacles(contest, outside.policy);
  if (!sentences.empty())
    return std::unexpected(fmt::format("{0}: {1}\nleave --real-time out, or them", contest.panel().file,
                                       fmt::join(sentences, "\n" + contest.panel().file + ": ")));
  return RealRollouts(contest, std::move(out), std::move(outside), allow_non_realtime);
}

std::expected<void, std::string> RealRollouts::live_through(const lab::PlannedRollout& planned,
                                                            const std::string& folder) const {
  const lab::Panel& panel = contest_.panel();
  const config::RobotConfig& robot = contest_.contestant(planned).robot;
  const auto trouble =
      evidence::real_trouble_of(panel.perturbations[planned.perturbation].resolved(), robot, planned.seed);
  if (!trouble) return std::unexpected(trouble.error());
  if (auto done = evidence::write_robot(robot, folder); !done) return done;
  const RuntimeDirectory runtime;
  if (runtime.path().empty()) return std::unexpected("no temporary folder for sockets can be made; set TMPDIR");
  if (!trouble->plant_scenario.empty())
    if (auto done = monitor::replace_file(plant_file(folder), trouble->plant_scenario); !done) return done;
  std::vector<std::string> arguments = arguments_of(panel, *trouble, planned.seed, folder);
  arguments.insert(arguments.end(), {"--runtime-dir", runtime.path()});
  if (!outside_.policy.empty()) arguments.insert(arguments.end(), {"--policy-host", outside_.policy});
  for (std::string& word : policy_host::grant_options(outside_.policy_may)) arguments.push_back(std::move(word));
  if (allow_non_realtime_) arguments.emplace_back("--allow-non-realtime");
  if (auto done = monitor::replace_file(folder + "/command.txt", fmt::format("'{}'\n", fmt::join(arguments, "' '")));
      !done)
    return done;
  auto process = ChildProcess::start({.name = "takt run",
                                      .arguments = std::move(arguments),
                                      .log_path = folder + "/run.log",
                                      .parent_death_signal = SIGTERM});
  if (!process) return std::unexpected(process.error());
  return run_to_its_end(*process, std::chrono::nanoseconds(panel.duration.ns) + kOverheadWithin);
}

std::expected<lab::RanRollout, std::string> RealRollouts::run(const lab::PlannedRollout& planned) const {
  const lab::Panel& panel = contest_.panel();
  evidence::RolloutRow row = contest_.identity(planned);
  const std::string place = "runs/" + evidence::rollout_id(row);
  const std::string folder = fs::absolute(out_ + "/" + place).string();
  const auto fail = [&](const std::string& why) {
    return std::unexpected(fmt::format("rollout {}: {}", evidence::rollout_id(row), why));
  };
  std::error_code error;
  fs::remove_all(folder, error);
  fs::create_directories(folder, error);
  if (error) return fail(fmt::format("cannot make {}: {}", folder, error.message()));
  const ChildMeter meter;
  if (const auto lived = live_through(planned, folder); !lived) return fail(lived.error());
  lab::RolloutWatch watch(contest_.contestant(planned).robot);
  const auto measured = lab::measure_recorded(lab::recorded_rollout(panel, planned, folder), watch, row);
  if (!measured) return fail(measured.error());
  row.run_folder = place + "/run";
  meter.fill(panel.duration, row.host);
  return contest_.conclude(std::move(row), watch);
}

}  // namespace takt::cli

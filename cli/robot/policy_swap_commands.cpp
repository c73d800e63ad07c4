// SPDX-License-Identifier: Apache-2.0
// takt policy shadow, swap, back: another policy beside the one in charge of a live robot, in its place, and back.
#include <fmt/format.h>

#include <algorithm>
#include <csignal>
#include <cstdio>
#include <memory>
#include <thread>

#include "cli/command.hpp"
#include "cli/run/child_process.hpp"
#include "cli/run/policy_host_option.hpp"
#include "cli/run/robot_processes.hpp"
#include "cli/run/status_text.hpp"
#include "cli/running_robots.hpp"
#include "config/load.hpp"
#include "config/paths.hpp"
#include "executive/ipc/rendezvous.hpp"

namespace takt::cli {
namespace {

using namespace std::chrono_literals;

constexpr auto kAnswersWithin = 2000ms;
constexpr auto kCompareEvery = 50ms;
constexpr auto kHostEndsWithin = 2000ms;
constexpr auto kHostAttachesWithin = 15s;  // as `takt run` waits for a policy's
constexpr int kLooksPerLine = 20;

volatile std::sig_atomic_t g_shadow_interrupted = 0;

struct SwapOptions {
  std::string file;
  std::string runtime_dir;
  std::string robot_file;
  policy_host::Grants policy_may;
  std::string policy_host;  // path of a program instead of takt-policy-host; empty: itself
};

// A robot that runs, and who answers for it.
class LiveRobot {
 public:
  static std::expected<LiveRobot, Refusal> find(const SwapOptions& options) {
    std::string name;
    if (!options.robot_file.empty()) {
      const auto robot = config::load(options.robot_file);
      if (!robot) return std::unexpected(Refusal{config::kExitBadConfiguration, robot.error()});
      name = robot->robot;
    }
    if (!options.runtime_dir.empty()) return LiveRobot(options.runtime_dir);
    auto running = the_running_robot(places_of_this_user(), name);
    if (!running) return std::unexpected(running.error());
    return LiveRobot(running->runtime_directory);
  }

  [[nodiscard]] const std::string& directory() const { return directory_; }
  [[nodiscard]] std::expected<OperatorReply, Refusal> ask(OperatorVerb verb, std::uint64_t policy_hash = 0) const {
    auto reply = ipc::ask(config::executive_socket(directory_), verb, kAnswersWithin, policy_hash);
    if (!reply)
      return std::unexpected(
          Refusal{kExitUnavailable, fmt::format("no executive answers in {}: {}", directory_, reply.error())});
    return *reply;
  }
  // Asks for the change and waits for it: until it came, or was given up.
  [[nodiscard]] std::expected<void, Refusal> change(OperatorVerb verb, std::uint64_t policy_hash = 0) const {
    auto reply = ask(verb, policy_hash);
    if (!reply) return std::unexpected(reply.error());
    if (reply->done == 0) {
      const auto sentences = sentences_of(*reply);
      return std::unexpected(Refusal{kExitFailed, sentences.empty() ? "refused" : sentences.front()});
    }
    while (reply->status.tick.candidate.is_asked != 0) {
      std::this_thread::sleep_for(kCompareEvery);
      reply = ask(OperatorVerb::status);
      if (!reply) return std::unexpected(reply.error());
    }
    const bool in_charge = reply->status.tick.candidate.in_charge != 0;
    if (in_charge == (verb == OperatorVerb::swap)) return {};
    return std::unexpected(
        Refusal{kExitFailed, in_charge ? "the robot's own policy gave no answer in time: the candidate stays in charge"
                                       : "the candidate is not in charge: it gave no answer in time, or went back from "
                                         "probation at once (takt report says which)"});
  }

 private:
  explicit LiveRobot(std::string directory) : directory_(std::move(directory)) {}
  std::string directory_;
};

int refuse_with(const Refusal& refusal) {
  return refuse(refusal.exit_code, refusal.sentence);
}

// What was seen of the candidate since the last line.
class Comparison {
 public:
  void look(const StatusSnapshot& status) {
    const CandidateRecord& candidate = status.tick.candidate;
    const SeatRecord& seat = status.tick.seats[Seat::candidate];
    ++looks_;
    fresh_ += is_usable(seat.freshness) ? 1 : 0;
    range_ += candidate.beyond_range != 0 ? 1 : 0;
    limits_ += candidate.beyond_limits != 0 ? 1 : 0;
    age_ = std::max(age_, seat.age);
    distance_ = std::max(distance_, candidate.distance);
    refused_ = seat.last_refusal;
    in_charge_ = candidate.in_charge != 0;
    on_probation_ = candidate.on_probation != 0;
  }
  [[nodiscard]] bool is_due() const { return looks_ >= kLooksPerLine; }
  // And begins anew.
  std::string line() {
    const std::string text = fmt::format(
        "{}: fresh {}/{}, age up to {:.1f} ms, differs by up to {:.4f} rad, out of range {}, beyond limits {}{}",
        in_charge_ ? (on_probation_ ? "in charge, on probation; the robot's own" : "in charge; the robot's own")
                   : "beside the policy",
        fresh_, looks_, age_.milliseconds(), distance_, range_, limits_,
        refused_ == Arrival::none ? "" : fmt::format("; refused: {}", name(refused_)));
    *this = {};
    return text;
  }

 private:
  int looks_ = 0, fresh_ = 0, range_ = 0, limits_ = 0;
  Duration age_;
  float distance_ = 0;
  Arrival refused_ = Arrival::none;
  bool in_charge_ = false, on_probation_ = false;
};

std::expected<ChildProcess, Refusal> start_host(const SwapOptions& options, const LiveRobot& robot) {
  const std::string robot_file =
      options.robot_file.empty() ? remembered_robot_file(robot.directory()) : options.robot_file;
  if (robot_file.empty())
    return std::unexpected(Refusal{kExitUsage, "the run left no name of its robot file: say it with --robot"});
  const auto config = config::load(robot_file);
  if (!config) return std::unexpected(Refusal{config::kExitBadConfiguration, config.error()});
  ChildProcess::Options child;
  child.name = "candidate host";
  child.arguments = {options.policy_host.empty() ? beside_this_program("takt-policy-host") : options.policy_host,
                     "--robot",
                     robot_file,
                     "--runtime-dir",
                     robot.directory(),
                     "--candidate",
                     options.file};
  child.log_path = robot.directory() + "/candidate.log";
  std::remove(child.log_path.c_str());  // of an earlier candidate
  child.parent_death_signal = SIGTERM;
  child.place = place_of_policy(*config, options.policy_may);
  child.place->grants.runtime_directory = robot.directory();
  auto started = ChildProcess::start(std::move(child));
  if (!started) return std::unexpected(Refusal{kExitFailed, started.error()});
  for (const std::string& gap : started->gaps()) fmt::print(stderr, "warning: candidate: {}\n", gap);
  return std::move(*started);
}

bool is_attached(const StatusSnapshot& status, std::uint64_t policy_hash) {
  return status.policy_pids[Seat::candidate] != 0 && status.tick.candidate.policy_hash == policy_hash;
}

// Says once a second how far apart the two are, until it is interrupted. The error: why it cannot go on.
std::expected<void, Refusal> watch(const LiveRobot& robot, ChildProcess& host, std::uint64_t policy_hash) {
  const auto give_up_at = std::chrono::steady_clock::now() + kHostAttachesWithin;
  Comparison comparison;
  for (bool attached = false; g_shadow_interrupted == 0; std::this_thread::sleep_for(kCompareEvery)) {
    if (!host.alive())
      return std::unexpected(
          Refusal{kExitFailed, fmt::format("the candidate's host {}:\n{}", host.how_it_ended(), host.last_words())});
    const auto reply = robot.ask(OperatorVerb::status);
    if (!reply) return std::unexpected(reply.error());
    attached |= is_attached(reply->status, policy_hash);
    if (!attached && std::chrono::steady_clock::now() > give_up_at)
      return std::unexpected(
          Refusal{kExitFailed, fmt::format("the executive does not take the candidate:\n{}", host.last_words())});
    if (!attached) continue;
    comparison.look(reply->status);
    if (!comparison.is_due()) continue;
    fmt::print("{}\n", comparison.line());
    std::fflush(stdout);
  }
  return {};
}

// The policy in charge is never taken away: the robot gets its own back first.
int end_shadow(const LiveRobot& robot, ChildProcess& host) {
  const auto reply = robot.ask(OperatorVerb::status);
  if (host.alive() && reply && reply->status.tick.candidate.in_charge != 0) {
    if (const auto back = robot.change(OperatorVerb::back); back)
      fmt::print("back: the robot's own policy is in charge\n");
    else
      fmt::print(stderr, "{}\n", back.error().sentence);
  }
  host.end(kHostEndsWithin);
  return kExitOk;
}

int shadow(const SwapOptions& options) {
  const auto robot = LiveRobot::find(options);
  if (!robot) return refuse_with(robot.error());
  const auto hash = config::policy_hash(options.file);
  if (!hash) return refuse(config::kExitBadConfiguration, hash.error());
  const auto reply = robot->ask(OperatorVerb::status);
  if (!reply) return refuse_with(reply.error());
  if (const std::uint64_t other = reply->status.policy_pids[Seat::candidate]; other != 0)
    return refuse(kExitFailed, fmt::format("a candidate runs already, pid {}: end it first", other));
  std::signal(SIGINT, [](int) { g_shadow_interrupted = 1; });
  std::signal(SIGTERM, [](int) { g_shadow_interrupted = 1; });
  auto host = start_host(options, *robot);
  if (!host) return refuse_with(host.error());
  fmt::print("candidate {:016x}, pid {}: `takt policy swap` puts it in charge, Ctrl-C ends it\n", *hash, host->pid());
  std::fflush(stdout);
  if (const auto watched = watch(*robot, *host, *hash); !watched) {
    host->end(kHostEndsWithin);
    return refuse_with(watched.error());
  }
  return end_shadow(*robot, *host);
}

int swap_in(const SwapOptions& options) {
  const auto robot = LiveRobot::find(options);
  if (!robot) return refuse_with(robot.error());
  const auto reply = robot->ask(OperatorVerb::status);
  if (!reply) return refuse_with(reply.error());
  std::uint64_t wanted = reply->status.tick.candidate.policy_hash;
  if (!options.file.empty()) {
    const auto hash = config::policy_hash(options.file);
    if (!hash) return refuse(config::kExitBadConfiguration, hash.error());
    wanted = *hash;
  }
  if (const auto changed = robot->change(OperatorVerb::swap, wanted); !changed) return refuse_with(changed.error());
  fmt::print("candidate {:016x} is in charge, on probation: `takt policy back` undoes it\n", wanted);
  return kExitOk;
}

int give_back(const SwapOptions& options) {
  const auto robot = LiveRobot::find(options);
  if (!robot) return refuse_with(robot.error());
  if (const auto changed = robot->change(OperatorVerb::back); !changed) return refuse_with(changed.error());
  fmt::print("the robot's own policy is in charge\n");
  return kExitOk;
}

std::shared_ptr<SwapOptions> add_where(CLI::App& command) {
  auto options = std::make_shared<SwapOptions>();
  command.add_option("--runtime-dir", options->runtime_dir, "the running robot's runtime directory");
  command.add_option("--robot", options->robot_file, "its robot file: the running robot of that name");
  return options;
}

}  // namespace

void add_policy_shadow(CLI::App& policy, int& exit_code) {
  CLI::App* command = policy.add_subcommand(
      "shadow", "Run another policy beside the one in charge of a live robot: judged, recorded, compared, not played.");
  auto options = add_where(*command);
  command->add_option("FILE", options->file, "policy for the same observation and action")
      ->required()
      ->check(CLI::ExistingFile);
  command
      ->add_option("--policy-host", options->policy_host,
                   "program to start instead of takt-policy-host: a policy in Python or C")
      ->check(CLI::ExistingFile);
  add_policy_may(*command, options->policy_may);
  command->footer(
      "Example: takt policy shadow new_policy.onnx\n"
      "Runs until Ctrl-C, which gives the robot its own policy back first. Its log: candidate.log in the runtime "
      "directory.\n"
      "Exit codes: 0 ended as asked, 1 its host ended, or was not taken (its last words), or another candidate runs, "
      "64 no such file or several robots run, 65 configuration or "
      "policy, 69 none runs.");
  command->callback([options, &exit_code] { exit_code = shadow(*options); });
}

void add_policy_swap(CLI::App& policy, int& exit_code) {
  CLI::App* command =
      policy.add_subcommand("swap", "Put the policy that runs beside the one in charge in its place, on probation.");
  auto options = add_where(*command);
  command->add_option("FILE", options->file, "refused unless it is this file that runs beside it")
      ->check(CLI::ExistingFile);
  command->footer(
      "Example: takt policy swap\n"
      "For policy.probation of tracking it goes back by itself when it uses up half of what the contract allows.\n"
      "Exit codes: 0 in charge, 1 refused or not in charge (why), 64 no such file or several robots run, 65 "
      "configuration or policy, "
      "69 none runs.");
  command->callback([options, &exit_code] { exit_code = swap_in(*options); });
}

void add_policy_back(CLI::App& policy, int& exit_code) {
  CLI::App* command = policy.add_subcommand("back", "Switch back to the robot's own policy.");
  auto options = add_where(*command);
  command->footer(
      "Example: takt policy back\n"
      "Exit codes: 0 in charge, 1 refused or not in charge (why), 64 several robots run, 65 configuration, 69 none "
      "runs.");
  command->callback([options, &exit_code] { exit_code = give_back(*options); });
}

}  // namespace takt::cli

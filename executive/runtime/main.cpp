// SPDX-License-Identifier: Apache-2.0
// takt-executive: the only place where the executive's parts are put together.
#include <spdlog/spdlog.h>

#include <CLI/CLI.hpp>
#include <algorithm>
#include <cstdio>
#include <cstdlib>
#include <exception>
#include <expected>
#include <optional>

#include "config/hash.hpp"
#include "config/load.hpp"
#include "config/observation_shape.hpp"
#include "config/paths.hpp"
#include "config/policy_signature.hpp"
#include "drivers/protocol/bus_load.hpp"
#include "executive/ipc/unix_socket.hpp"
#include "executive/program/program.hpp"
#include "executive/runtime/control_thread.hpp"
#include "executive/runtime/executive_file.hpp"
#include "executive/runtime/journal.hpp"
#include "executive/runtime/open_edge.hpp"
#include "executive/runtime/reception.hpp"
#include "executive/runtime/service.hpp"
#include "executive/runtime/stop_thread.hpp"
#include "executive/setup/tick_config_of.hpp"
#include "executive/trace/trace.hpp"

namespace takt::runtime {
namespace {

using namespace std::chrono_literals;

struct Options : program::RobotOptions {
  bool allow_non_realtime = false;
};

using program::refuse;

void log_steps(const std::vector<SetupStep>& steps) {
  for (const SetupStep& step : steps) {
    if (step.ok) {
      spdlog::info("set-up {}: {}", step.name, step.detail);
    } else {
      spdlog::warn("set-up {} FAILED{}: {}", step.name, step.essential ? "" : " (not essential)", step.detail);
    }
  }
}

std::string essential_failures(const std::vector<SetupStep>& steps) {
  std::string sentence = "refusing to run without real-time guarantees (--allow-non-realtime overrides):";
  for (const SetupStep& step : steps) {
    if (step.essential && !step.ok) sentence += "\n  " + step.name + ": " + step.detail;
  }
  return sentence;
}

std::uint32_t keyframe_ticks(const config::RobotConfig& robot) {
  const std::int64_t ticks = robot.record.keyframe_period.ns / robot.control.period.ns;
  return static_cast<std::uint32_t>(std::max<std::int64_t>(1, ticks));
}

std::vector<std::string> interfaces_of(const std::vector<config::Bus>& buses) {
  std::vector<std::string> all;
  for (const config::Bus& bus : buses) all.push_back(bus.interface);
  return all;
}

int run(const Options& options) {
  const auto robot = config::load(options.robot);
  if (!robot) return refuse(config::kExitBadConfiguration, robot.error());
  if (const auto loads = drivers::check_bus_load(*robot); !loads)
    return refuse(config::kExitBadConfiguration, loads.error());
  const auto guest = program::policy_user_of(options);
  if (!guest) return refuse(kExitUsage, guest.error());
  std::string policy_sha256;
  if (robot->policy) {
    auto sha256 = config::accepted_policy_sha256(*robot->policy);
    if (!sha256) return refuse(config::kExitBadConfiguration, sha256.error());
    policy_sha256 = *std::move(sha256);
  }
  const std::uint64_t policy_hash = config::leading_64_bits(policy_sha256);  // 0: no policy
  const config::Fallback* const fallback = config::fallback_policy_of(*robot);
  const config::RobotConfig fallback_robot = fallback != nullptr ? config::seen_by_fallback(*robot, *fallback) : *robot;
  std::uint64_t fallback_hash = 0;
  if (fallback != nullptr) {
    const auto sha256 = config::accepted_policy_sha256(*fallback_robot.policy);
    if (!sha256) return refuse(config::kExitBadConfiguration, sha256.error());
    fallback_hash = config::leading_64_bits(*sha256);
  }
  const std::string directory = program::runtime_directory_of(options, *robot);
  const auto tick_config =
      std::make_unique<pipeline::TickConfig>(setup::tick_config_of(*robot, policy_hash, fallback_hash));

  block_shutdown_signals();
  ProcessSetup process = prepare_process(robot->control);
  auto published = PublishedSegments::create(robot->joints.size(), tick_config->largest_command);
  if (!published) return refuse(kExitSetUpRefused, published.error());
  PerSeat<MailboxHandover> mailboxes;
  const AdmissionRules rules = admission_rules(*robot, policy_hash);
  OperatorInbox requests;
  RecordedThrough recorded;
  StatusBoard board;
  incident::IncidentWatch incidents(*robot);
  TickFollower follower(published->tick_reader(), *tick_config, [&](const TickRecord& record) {
    Journal::transition(record, incidents.stands() ? incidents.latest() : std::nullopt);
  });
  follower.tell(incidents);
  follower.on_policy_change(&Journal::policy_change);
  follower.on_moved_unheard([&robot](const TickRecord& record, std::size_t joint) {
    Journal::moved_unheard(record, joint, robot->joints[joint]);
  });
  TransmitQueues queues(robot->freshness.max_age, interfaces_of(robot->buses));
  follower.tell(queues.watch());

  // The socket first: a second executive is turned away before it touches a bus.
  auto reception = Reception::open(config::executive_socket(directory),
                                   {*robot,
                                    *tick_config,
                                    {{rules, admission_rules(fallback_robot, fallback_hash), rules}},
                                    *published,
                                    mailboxes,
                                    requests,
                                    recorded,
                                    board,
                                    follower,
                                    *guest});
  if (!reception) return refuse(kExitSetUpRefused, reception.error());
  auto stops = StopThread::start(ipc::stop_socket_beside(config::executive_socket(directory)), requests);
  if (!stops) return refuse(kExitSetUpRefused, stops.error());
  auto opened = open_edge(*robot, directory, 5s);
  if (!opened) return refuse(opened.error().exit_code, opened.error().sentence);

  SystemClock clock;
  std::optional<ImuLink> imu;
  if (robot->imu) imu.emplace(config::sensor_socket(directory, robot->imu->sensor), robot->imu->sensor);
  CyclicLoop loop({*tick_config, clock, opened->edge, mailboxes, requests, recorded, *published, board,
                   imu ? &imu->mailboxes() : nullptr},
                  {robot->control.wake, robot->control.spin, keyframe_ticks(*robot)});
  auto thread = ControlThread::start(robot->control, loop);
  if (!thread) return refuse(kExitSetUpRefused, thread.error());

  std::vector<SetupStep> steps = process.steps;
  steps.insert(steps.end(), thread->steps().begin(), thread->steps().end());
  log_steps(steps);
  const bool realtime = is_realtime(steps);
  if (!realtime && !options.allow_non_realtime) return refuse(kExitSetUpRefused, essential_failures(steps));
  if (!realtime) spdlog::warn("running WITHOUT real-time guarantees, as asked: every artifact says so");
  (*reception)->set_realtime(realtime, options.allow_non_realtime);
  auto file = ExecutiveFile::write(
      directory, {*robot, policy_sha256, fallback_hash, options.allow_non_realtime, steps, opened->buses});
  if (!file) return refuse(kExitSetUpRefused, file.error());
  for (const OpenedBusFacts& bus : opened->buses) spdlog::info("bus {}", bus.description);
  if (!opened->torque_output.empty()) spdlog::info("torque is permitted by {}", opened->torque_output);

  DriveCards cards(*robot, published->frame_reader(), directory);
  trace::Introduction introduction("takt-executive", robot->hash, policy_hash, robot->joints);
  thread->go();
  serve(**reception, follower, cards, board, requests, queues, introduction, imu ? &*imu : nullptr);
  if (!thread->finish(1s)) {
    // Its memory is still in use: nothing may be destroyed. The socket stays behind; the next executive replaces it.
    spdlog::critical("the control thread hangs: ending without it");
    spdlog::default_logger()->flush();
    std::_Exit(kExitInternal);
  }
  spdlog::info("drives disabled, ending");
  return 0;
}

}  // namespace
}  // namespace takt::runtime

int main(int argc, char** argv) {
  namespace program = takt::program;
  takt::runtime::Options options;
  CLI::App app("Takt's real-time control loop for one robot.\nExample: takt-executive --robot config/arm6.yaml");
  program::add_robot(app, options, "robot file");
  program::add_runtime_directory(app, options);
  program::add_policy_user(app, options, "may lend a policy, but not arm");
  app.add_flag("--allow-non-realtime", options.allow_non_realtime,
               "run although real-time set-up failed; every artifact says so");
  app.footer(
      "Exit codes: 0 ended as asked, 64 command line, 65 configuration, 69 a bus is missing, 70 bug, 71 set-up "
      "refused\n"
      "(real time, permissions, another executive, another controller of the drives).");
  if (const auto ended = program::parse(app, argc, argv)) return *ended;
  return program::run("takt-executive", [&] { return takt::runtime::run(options); });
}

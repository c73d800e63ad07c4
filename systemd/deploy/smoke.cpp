// SPDX-License-Identifier: Apache-2.0
#include "systemd/deploy/smoke.hpp"

#include <fmt/format.h>

#include "config/hash.hpp"
#include "config/load.hpp"
#include "config/observation_shape.hpp"
#include "config/policy_signature.hpp"
#include "evidence/rollout/rollout.hpp"
#include "executive/incident/incident.hpp"
#include "policy_host/engines/load_policy.hpp"
#include "policy_host/fenced_load.hpp"
#include "policy_host/policy_fit.hpp"

namespace takt::deploy {
namespace {

// The last part of the rollout, which the row's measures are about; the task's error is not judged here.
constexpr Duration kScored = seconds(1);
constexpr double kAnyError_m = 1e9;

// The first stop or fault, and the first tick that was degraded, in their own sentences.
class Troubles {
 public:
  explicit Troubles(const config::RobotConfig& robot) : robot_(robot), incidents_(robot) {}
  void look(const TickRecord& record) {
    const TickRecordHeader& header = record.header;
    if (const auto incident = incidents_.tick(record); incident && stop_.empty()) stop_ = incident->sentence;
    if (header.mode == Mode::degraded && header.previous_mode != Mode::degraded && degraded_.empty())
      degraded_ = incident::degraded_sentence(record, robot_);
  }
  // The worse of the two; empty: neither.
  [[nodiscard]] const std::string& worst() const { return stop_.empty() ? degraded_ : stop_; }

 private:
  const config::RobotConfig& robot_;
  incident::IncidentWatch incidents_;
  std::string stop_, degraded_;
};

std::string trouble_in(const evidence::RolloutRow& row, const Troubles& troubles) {
  if (!troubles.worst().empty()) return troubles.worst();
  if (row.safety.envelope_violations > 0)
    return fmt::format("measured values left the envelope in {} ticks", row.safety.envelope_violations);
  if (row.final_mode != Mode::tracking)
    return fmt::format("it never came to tracking, and ended in {}", name(row.final_mode));
  return {};
}

std::expected<std::string, std::string> roll_out(const config::RobotConfig& robot, const evidence::Answering& policy,
                                                 evidence::WorldProcess* world) {
  const auto sha256 = config::accepted_policy_sha256(*robot.policy);
  if (!sha256) return std::unexpected(sha256.error());
  const auto fallback = evidence::load_fallback_host(robot);
  if (!fallback) return std::unexpected(fallback.error());
  const auto task = evidence::task_of(robot, world);
  if (!task) return std::unexpected(task.error());
  evidence::RolloutRow row;
  Troubles troubles(robot);
  std::string end;
  const evidence::RolloutSetup setup{.robot = robot,
                                     .policy = policy,
                                     .policy_hash = config::leading_64_bits(*sha256),
                                     .fallback = fallback->get(),
                                     .task = *task,
                                     .timing = {},
                                     .perturbation = {},
                                     .duration = kSmokeLength,
                                     .scored = kScored,
                                     .bound_m = kAnyError_m,
                                     .on_tick = [&](const TickRecord& record) { troubles.look(record); },
                                     .world = world,
                                     .on_world_end =
                                         [&](const simulation::WorldEnd& ended) {
                                           if (ended.kind != simulation::WorldEndKind::succeeded) end = ended.sentence;
                                         },
                                     .on_silence = [&](const std::string& why) { end = why; }};
  if (const auto ran = evidence::run_rollout(setup, row); !ran) return std::unexpected(ran.error());
  if (!end.empty()) return std::unexpected(end);
  if (const std::string trouble = trouble_in(row, troubles); !trouble.empty())
    return std::unexpected(fmt::format("{:.0f} s in virtual time: {}", kSmokeLength.seconds(), trouble));
  return fmt::format("tracked for {:.0f} s in virtual time", kSmokeLength.seconds());
}

// Of a policy that is there, and takes the robot.
std::expected<std::string, std::string> try_out(const config::RobotConfig& robot, const evidence::Answering& policy,
                                                const std::string& world) {
  if (!robot.simulation) return "the policy loads and fits; no `simulation`, so nothing was run";
  if (world.empty() && config::sees_images(robot))
    return "the policy loads and fits; the images that it sees are not rendered, so nothing was run: give it a world "
           "that "
           "does (--world)";
  if (world.empty()) return roll_out(robot, policy, nullptr);
  evidence::WorldProcess process(world);
  return roll_out(robot, policy, &process);
}

}  // namespace

std::expected<std::string, std::string> smoke_run(const config::RobotConfig& robot,
                                                  const evidence::OutsideProcesses& outside) {
  if (!robot.policy) return "no policy: nothing to try before the robot itself";
  if (const auto fine = policy_host::check_policy_section(robot); !fine) return std::unexpected(fine.error());
  if (!outside.policy.empty()) {
    const auto sha256 = config::accepted_policy_sha256(*robot.policy);
    if (!sha256) return std::unexpected(sha256.error());
    // It inherits where it may run.
    if (const auto fence = policy_host::keep_off_processor(robot.control.cpu); !fence)
      return std::unexpected(fence.error());
    policy_host::limit_thread_pools(robot.policy->engine.value_or(config::Engine{}).threads,
                                    policy_host::PoolSize::unless_set);
    evidence::PolicyProcess program(outside.policy, outside.policy_may);
    if (const auto begun = program.begin(robot, config::leading_64_bits(*sha256)); !begun)
      return std::unexpected(begun.error());
    return try_out(robot, program, outside.world);
  }
  const auto loaded = policy_host::load_fenced(robot, 1, policy_host::load_policy);
  if (!loaded) return std::unexpected(loaded.error());
  return try_out(robot, *loaded->policies.front(), outside.world);
}

}  // namespace takt::deploy

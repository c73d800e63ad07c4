// SPDX-License-Identifier: Apache-2.0
// One rollout in virtual time: the real decision, the real drivers, the real network, against a simulated plant, in one
// thread and from one seed. The same setup gives the same bytes: of every tick record, and of the row.
//
// What is real: pipeline::control_tick with the robot file's configuration (of method plain: plain_loop.hpp instead),
// the host side of every drive's protocol, observation, inference and chunk building. What is modelled: when things
// happen (virtual_policy.hpp, virtual_bus.hpp, the wake-up's lateness), the drives' other side, the mechanics. What is
// absent: shared memory, sockets, the kernel. A rollout starts disabled at home and arms as soon as nothing blocks it;
// whether a stop is ended, the setup says (operator.hpp). Thread rule: one thread.
#pragma once

#include <array>
#include <cstdint>
#include <expected>
#include <functional>
#include <optional>
#include <string>
#include <string_view>

#include "config/robot_config.hpp"
#include "evidence/rollout/base_velocity_world.hpp"
#include "evidence/rollout/fallback_host.hpp"
#include "evidence/rollout/method.hpp"
#include "evidence/rollout/perturbation.hpp"
#include "evidence/rollout/rollout_row.hpp"
#include "evidence/rollout/virtual_policy.hpp"
#include "executive/contract/command_chunk.hpp"
#include "executive/contract/tick_record.hpp"
#include "policy_host/policy.hpp"
#include "simulation/world_process.hpp"

namespace takt::evidence {

enum class Task : std::uint8_t { arm_tracking, cart_pole_balance, base_velocity, world };
inline constexpr std::array<std::string_view, 4> kTaskNames{"arm_tracking", "cart_pole_balance", "base_velocity",
                                                            "world"};
// What a robot's simulation is made for; `world`: not declared.
Task task_of(const config::RobotConfig& robot);
using WorldProcess = simulation::WorldProcess;
// The same in a world of another process, which is asked; null: there is none. That world's own task where it judges
// one. The error is one sentence.
std::expected<Task, std::string> task_of(const config::RobotConfig& robot, WorldProcess* world);

struct RolloutSetup {
  const config::RobotConfig& robot;  // as the method wants it
  Answering policy;                  // a network that fits the robot, or a program
  std::uint64_t policy_hash = 0;
  FallbackHost* fallback = nullptr;  // of a robot that has a fallback policy; its timing is the policy's
  Task task = Task::arm_tracking;
  PolicyTiming timing;
  Method method{};
  bool repeat_last = false;  // repeat_last.hpp stands between policy and executive, whatever the method
  Perturbation perturbation;
  std::uint64_t seed = 1;
  Duration duration;
  Duration scored;                                           // last part of the duration, judged
  double bound_m = 0;                                        // rms error of the scored part
  std::optional<Duration> rearm_after = {};                  // from a stop or fault; empty: no re-arming
  BaseVelocityTask base_velocity = {};                       // of that task only
  std::function<void(const CommandChunk&)> on_command = {};  // before the tick that reads it
  std::function<void(const TickRecord&)> on_tick = {};
  std::function<void(const ShownSample&)> on_shown = {};  // to the policy, not to its fallback
  WorldProcess* world = nullptr;                          // plays the mechanics; null: the robot file's own
  std::function<void(const simulation::WorldEnd&)> on_world_end = {};
  std::function<void(const std::string& why)> on_silence = {};  // of a program that ended or hung
};

// Fills everything of the row but its identity and host fields. A world that hangs, dies, answers wrongly or gives up
// ends the rollout, and the row's failure_label says so (world_hung, world_died, ...). The error is one sentence: what
// the robot lacks for the task, that its physics diverged, or that no world is to be had.
std::expected<void, std::string> run_rollout(const RolloutSetup& setup, RolloutRow& row);

}  // namespace takt::evidence

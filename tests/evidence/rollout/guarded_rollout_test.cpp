// SPDX-License-Identifier: Apache-2.0
// Goal: the last guard on the wire has nothing to say against the executive as it is: a refusal is a bug, of the
// executive or of the guard. Method: rollouts of every committed robot in virtual time, undisturbed and under every
// perturbation, whose buses are guarded as the executive's are; each tick's record says what was refused of the tick
// before. On the balancer's way from IMU and gamepad they are: cut (sensor_dropout 1), frozen (camera_freeze), late
// (sensor_burst) and lying (sensor_lies 1).
#include <gtest/gtest.h>

#include <map>
#include <memory>
#include <stdexcept>
#include <string>

#include "config/load.hpp"
#include "evidence/rollout/fallback_host.hpp"
#include "evidence/rollout/rollout.hpp"
#include "evidence/rollout/virtual_bus.hpp"
#include "policy_host/onnx_policy.hpp"

namespace takt::lab {
namespace {

struct Guarded {
  std::uint64_t ticks = 0, enabled_ticks = 0;
  std::map<std::string, int> refusals;  // by joint and verdict
};

Guarded run(const config::RobotConfig& robot, evidence::Task task, const evidence::Perturbation& perturbation) {
  const auto policy = policy_host::load_onnx_policy(robot.policy->file, robot.policy->input, robot.policy->output);
  if (!policy) throw std::runtime_error(policy.error());
  const auto fallback = evidence::load_fallback_host(robot);
  if (!fallback) throw std::runtime_error(fallback.error());
  Guarded guarded;
  evidence::RolloutRow row;
  const auto look = [&](const TickRecord& record) {
    ++guarded.ticks;
    guarded.enabled_ticks += record.header.drives_enabled;
    for (std::size_t j = 0; j < record.header.joint_count; ++j) {
      const WireVerdict refused = record.joints[j].feedback.refused;
      if (refused == WireVerdict::allowed) continue;
      ++guarded
            .refusals[robot.joints[j].name + " " + std::string(kWireVerdictNames[static_cast<std::size_t>(refused)])];
    }
  };
  const auto done = evidence::run_rollout({.robot = robot,
                                           .policy = **policy,
                                           .policy_hash = *config::policy_hash(robot.policy->file),
                                           .fallback = fallback->get(),
                                           .task = task,
                                           .timing = {},
                                           .perturbation = perturbation,
                                           .seed = 7,
                                           .duration = seconds(5),
                                           .scored = seconds(2),
                                           .bound_m = 0.02,
                                           .on_tick = look},
                                          row);
  if (!done) throw std::runtime_error(done.error());
  return guarded;
}

// What a rollout's guard refuses reaches the tick after, once, and never the drives: else a test that sees no refusal
// sees nothing. A joint is told a torque that its record does not say was decided.
TEST(GuardedBus, ARefusalReachesTheNextTickOnce) {
  const config::RobotConfig robot = config::load("config/arm6.yaml").value();
  auto plant = simulation::Plant::on_free_inertias(robot).value();
  const MonoTime start = plant.now();
  const evidence::Disturbance calm({}, start);
  evidence::VirtualBus bus = evidence::VirtualBus::make(robot, calm, 1).value();
  const auto output = std::make_unique<pipeline::TickOutput>();
  output->record.header.joint_count = static_cast<std::uint32_t>(robot.joints.size());
  std::uint64_t refusals = 0, enabled = 0;
  for (int tick = 1; tick <= 400; ++tick) {
    const MonoTime now = start + milliseconds(tick);
    while (plant.now() < now) plant.step();
    pipeline::TickInput input;
    bus.receive(plant, now, input);
    const bool is_lied_to = tick > 300 && tick % 10 == 1;
    output->record.header.now = now;
    output->record.header.tick = static_cast<std::uint64_t>(tick);
    for (std::size_t j = 0; j < robot.joints.size(); ++j) {
      EXPECT_EQ(input.joints[j].refused,
                tick > 300 && tick % 10 == 2 && j == 2 ? WireVerdict::differs : WireVerdict::allowed)
          << "joint " << j << ", tick " << tick;
      refusals += input.joints[j].refused != WireVerdict::allowed ? 1 : 0;
      enabled += input.joints[j].drive_state == DriveState::enabled ? 1 : 0;
      output->record.joints[j].feedback = input.joints[j];
      output->record.joints[j].q_estimate = input.joints[j].q;
      output->record.joints[j].dq_estimate = input.joints[j].dq;
      output->drive_enabled[j] = tick > 150;
      output->setpoints[j] = {.tau = j == 2 && is_lied_to ? 0.1F : 0.0F};
    }
    bus.send(plant, now, *output);
  }
  EXPECT_EQ(refusals, 10U);
  EXPECT_GT(enabled, 100 * robot.joints.size()) << "nothing was driven";
}

class GuardedRollout : public testing::TestWithParam<const char*> {};

TEST_P(GuardedRollout, NothingIsRefused) {
  const config::RobotConfig robot = config::load(std::string("config/") + GetParam() + ".yaml").value();
  const evidence::Task task = evidence::task_of(robot);
  for (const trouble::Row& kind : evidence::perturbation_kinds()) {
    const Guarded guarded = run(robot, task, {kind.as<evidence::Trouble>(), kind.dose.most, seconds(2), seconds(1)});
    for (const auto& [what, count] : guarded.refusals) ADD_FAILURE() << kind.name << ": " << what << ", " << count;
    EXPECT_GT(guarded.enabled_ticks, static_cast<std::uint64_t>(seconds(1).ns / robot.control.period.ns))
        << kind.name << ": little was guarded";
  }
}

INSTANTIATE_TEST_SUITE_P(EveryRobot, GuardedRollout,
                         testing::Values("arm6", "arm6_visuomotor", "cart_pole", "dual_arm12"),
                         [](const auto& robot) { return std::string(robot.param); });

#ifdef TAKT_HAS_MUJOCO
INSTANTIATE_TEST_SUITE_P(WithMujoco, GuardedRollout, testing::Values("balancer"),
                         [](const auto& robot) { return std::string(robot.param); });
#endif

}  // namespace
}  // namespace takt::lab

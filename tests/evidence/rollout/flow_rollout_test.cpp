// SPDX-License-Identifier: Apache-2.0
// Goal: an arm whose policy has two ways of doing its task, and answers late, does it where the policy is shown what
// will be played, and is torn where it is not; the same seed gives the same bits. Method: rollouts of the committed
// robots in virtual time with inferences of 150 ms, by the rules of config/panels/joins_flow_arm6.yaml.
#include <gtest/gtest.h>

#include <span>
#include <stdexcept>

#include "config/load.hpp"
#include "evidence/rollout/rollout.hpp"
#include "policy_host/engines/load_policy.hpp"

namespace takt::lab {
namespace {

constexpr double kBound_m = 0.02;  // as in the panels

config::RobotConfig robot_file(const std::string& name, std::span<const config::Override> rule) {
  auto loaded = config::load("config/" + name + ".yaml");
  if (!loaded) throw std::runtime_error(loaded.error());
  auto made = config::with_overrides(*loaded, rule);
  if (!made) throw std::runtime_error(made.error());
  return *std::move(made);
}

const std::vector<config::Override> kTrained{{"freshness.max_age", "600 ms"}, {"freshness.stop_after", "1 s"}};
const std::vector<config::Override> kReplace{{"freshness.max_age", "600 ms"},
                                             {"freshness.stop_after", "1 s"},
                                             {"policy.sampler.prefix", "none"},
                                             {"policy.action.join.kind", "replace"}};

// 6 s, the last 2 s are scored.
evidence::RolloutRow run(const config::RobotConfig& robot, Duration inference, std::uint64_t seed) {
  const auto policy = policy_host::load_policy(robot);
  if (!policy) throw std::runtime_error(policy.error());
  evidence::RolloutRow row;
  const auto done = evidence::run_rollout({.robot = robot,
                                           .policy = **policy,
                                           .policy_hash = *config::policy_hash(robot.policy->file),
                                           .timing = {.inference = inference, .spread = 0.05},
                                           .perturbation = {},
                                           .seed = seed,
                                           .duration = seconds(6),
                                           .scored = seconds(2),
                                           .bound_m = kBound_m},
                                          row);
  if (!done) throw std::runtime_error(done.error());
  return row;
}

class FlowArm : public testing::TestWithParam<const char*> {};

TEST_P(FlowArm, GoesOnInTheWayThatItBeganHoweverLateItsAnswers) {
  const config::RobotConfig trained = robot_file(GetParam(), kTrained), torn = robot_file(GetParam(), kReplace);
  for (std::uint64_t seed = 1; seed <= 3; ++seed) {
    const evidence::RolloutRow calm = run(trained, milliseconds(150), seed),
                               pulled = run(torn, milliseconds(150), seed);
    EXPECT_TRUE(calm.success) << calm.failure_label << ", seed " << seed;
    EXPECT_EQ(calm.safety.entered_degraded, 0U);
    EXPECT_GT(pulled.tracking_error_rms_m, 2 * calm.tracking_error_rms_m) << "seed " << seed;
  }
}

TEST_P(FlowArm, RepeatsItselfBitForBit) {
  const config::RobotConfig robot = robot_file(GetParam(), kTrained);
  const evidence::RolloutRow once = run(robot, milliseconds(100), 3);
  EXPECT_EQ(run(robot, milliseconds(100), 3).replay_hash, once.replay_hash);
  EXPECT_NE(run(robot, milliseconds(100), 4).replay_hash, once.replay_hash);
}

INSTANTIATE_TEST_SUITE_P(Arms, FlowArm, testing::Values("arm6_flow", "arm6_visuomotor_flow"),
                         [](const auto& robot) { return std::string(robot.param); });

}  // namespace
}  // namespace takt::lab

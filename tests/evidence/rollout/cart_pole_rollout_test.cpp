// SPDX-License-Identifier: Apache-2.0
// Goal: the balancing task is judged as it says, and there an old command is fatal: what saves the pole is the
// fallback, not luck. Method: rollouts of the committed cart and pole in virtual time, with the robot file as it is and
// with a method that keeps the last command.
#include <gtest/gtest.h>

#include <algorithm>
#include <stdexcept>

#include "config/load.hpp"
#include "evidence/rollout/rollout.hpp"
#include "policy_host/onnx_policy.hpp"

namespace takt::lab {
namespace {

const config::RobotConfig& robot_file() {
  static const config::RobotConfig robot = [] {
    auto loaded = config::load("config/cart_pole.yaml");
    if (!loaded) throw std::runtime_error(loaded.error());
    return *loaded;
  }();
  return robot;
}

policy_host::Policy& policy() {
  static const auto loaded = [] {
    const config::Policy& section = *robot_file().policy;
    auto made = policy_host::load_onnx_policy(section.file, section.input, section.output);
    if (!made) throw std::runtime_error(made.error());
    return std::move(*made);
  }();
  return *loaded;
}

// As the headline panel's method of that name.
const config::RobotConfig& blind_robot() {
  static const config::RobotConfig robot = [] {
    const std::vector<config::Override> overrides{{"freshness.max_age", "40 s"},
                                                  {"freshness.epsilon", "0.999999"},
                                                  {"freshness.recover_after", "1 ms"},
                                                  {"freshness.stop_after", "600 s"},
                                                  {"freshness.bad_command_limit", "1000000"},
                                                  {"freshness.clamped_share", "1"}};
    auto made = config::with_overrides(robot_file(), overrides);
    if (!made) throw std::runtime_error(made.error());
    return *made;
  }();
  return robot;
}

// 8 s; the perturbation acts from 3 s to 5 s, the last 2 s are scored.
evidence::RolloutRow run(std::string_view perturbation, double dose, std::uint64_t seed, bool blind = false) {
  const trouble::Row* const kind = evidence::find_perturbation(perturbation);
  const config::RobotConfig& robot = blind ? blind_robot() : robot_file();
  evidence::RolloutRow row;
  const auto done =
      evidence::run_rollout({.robot = robot,
                             .policy = policy(),
                             .policy_hash = *config::policy_hash(robot.policy->file),
                             .task = evidence::Task::cart_pole_balance,
                             .timing = {},
                             .repeat_last = blind,
                             .perturbation = {kind->as<evidence::Trouble>(), dose, seconds(3), seconds(2)},
                             .seed = seed,
                             .duration = seconds(8),
                             .scored = seconds(2),
                             .bound_m = 0.4},
                            row);
  if (!done) throw std::runtime_error(done.error());
  return row;
}

TEST(CartPoleRollout, NominalSucceedsAndStaysInsideItsConstraints) {
  for (std::uint64_t seed = 1; seed <= 5; ++seed) {
    const evidence::RolloutRow row = run("none", 0, seed);
    EXPECT_TRUE(row.success) << row.failure_label << ", seed " << seed;
    EXPECT_EQ(row.constraint_violations, 0U);
    EXPECT_EQ(row.safety.entered_degraded, 0U);
    EXPECT_GT(row.tracking_error_rms_m, 0.0);
  }
}

TEST(CartPoleRollout, RepeatsItselfBitForBit) {
  EXPECT_EQ(run("policy_crash", 2000, 3).replay_hash, run("policy_crash", 2000, 3).replay_hash);
  EXPECT_NE(run("none", 0, 3).replay_hash, run("none", 0, 4).replay_hash);
}

TEST(CartPoleRollout, ASilentPolicyIsSurvivedByTheFallbackAndFatalWithoutIt) {
  for (std::uint64_t seed = 1; seed <= 3; ++seed) {
    const evidence::RolloutRow takt = run("policy_crash", 2000, seed);
    EXPECT_TRUE(takt.success) << takt.failure_label << ", seed " << seed;
    EXPECT_EQ(takt.safety.entered_degraded, 1U);
    EXPECT_TRUE(takt.recovery_s.has_value());
    const evidence::RolloutRow blind = run("policy_crash", 2000, seed, true);
    EXPECT_FALSE(blind.success);
    EXPECT_EQ(blind.failure_label == "fell" || blind.failure_label == "envelope_exceeded", true) << blind.failure_label;
    EXPECT_GT(blind.constraint_violations, 0U);
  }
}

TEST(CartPoleRollout, PushAndPayloadTakeHoldOfThePole) {
  const evidence::RolloutRow calm = run("none", 0, 1), pushed = run("push", 0.2, 1), loaded = run("payload", 0.1, 1);
  EXPECT_NE(pushed.replay_hash, calm.replay_hash);
  EXPECT_NE(loaded.replay_hash, calm.replay_hash);
  EXPECT_FALSE(run("push", 100, 1).success) << "nothing balances against such a push";
}

TEST(CartPoleRollout, RefusesARobotThatIsNone) {
  auto arm = config::load("config/arm6.yaml");
  ASSERT_TRUE(arm);
  evidence::RolloutRow row;
  const auto done = evidence::run_rollout({.robot = *arm,
                                           .policy = policy(),
                                           .task = evidence::Task::cart_pole_balance,
                                           .timing = {},
                                           .perturbation = {},
                                           .duration = seconds(1),
                                           .scored = seconds(1),
                                           .bound_m = 1},
                                          row);
  ASSERT_FALSE(done);
  EXPECT_NE(done.error().find("task cart_pole_balance needs"), std::string::npos);
}

}  // namespace
}  // namespace takt::lab

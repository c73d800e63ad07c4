// SPDX-License-Identifier: Apache-2.0
// Goal: the arm whose policy decides once per two camera frames does its task at that rate: its chunks bridge the
// decisions, its contract leaves room for them, and what it foresees of the target is what makes it arrive. Method:
// rollouts of the committed robot in virtual time, judged by their rows, and the arithmetic of its robot file.
#include <gtest/gtest.h>

#include <bit>
#include <cstdio>
#include <stdexcept>

#include "config/load.hpp"
#include "evidence/rollout/rollout.hpp"
#include "policy_host/onnx_policy.hpp"

namespace takt::lab {
namespace {

constexpr double kBound_m = 0.02;  // as in the panels

config::RobotConfig robot_file() {
  auto loaded = config::load("config/arm6_visuomotor.yaml");
  if (!loaded) throw std::runtime_error(loaded.error());
  return *std::move(loaded);
}

// 5 s; the perturbation acts from 1 s on, the last 2 s are scored.
evidence::RolloutRow run(const config::RobotConfig& robot, std::string_view perturbation, double dose,
                         std::uint64_t seed, Duration lasting = seconds(1), const evidence::PolicyTiming& timing = {}) {
  const auto policy = policy_host::load_onnx_policy(robot.policy->file, robot.policy->input, robot.policy->output);
  if (!policy) throw std::runtime_error(policy.error());
  evidence::RolloutRow row;
  const auto done = evidence::run_rollout(
      {.robot = robot,
       .policy = **policy,
       .policy_hash = *config::policy_hash(robot.policy->file),
       .timing = timing,
       .perturbation = {evidence::find_perturbation(perturbation)->as<evidence::Trouble>(), dose, seconds(1), lasting},
       .seed = seed,
       .duration = seconds(5),
       .scored = seconds(2),
       .bound_m = kBound_m},
      row);
  if (!done) throw std::runtime_error(done.error());
  return row;
}

TEST(VisuomotorArm, DecidesOncePerTwoFramesAndItsChunksOutlastTheContract) {
  const config::RobotConfig robot = robot_file();
  const config::Policy& policy = *robot.policy;
  const config::Simulation& simulation = *robot.simulation;
  EXPECT_NEAR(policy.period.seconds() / simulation.camera_period.seconds(), 2.0, 0.05);
  // A command's age counts from its frame, its chunk from the observation: the youngest frame decides.
  EXPECT_GE(policy.step_period * policy.steps + simulation.camera_delay - simulation.camera_jitter,
            robot.freshness.max_age);
}

TEST(VisuomotorArm, TracksAtFifteenDecisionsPerSecond) {
  const config::RobotConfig robot = robot_file();
  for (std::uint64_t seed = 1; seed <= 5; ++seed) {
    const evidence::RolloutRow row = run(robot, "none", 0, seed);
    EXPECT_TRUE(row.success) << row.failure_label << ", seed " << seed;
    EXPECT_LT(row.tracking_error_rms_m, 0.5 * kBound_m) << "seed " << seed;
    EXPECT_EQ(row.misses_per_tick.misses, 0U);
    EXPECT_EQ(row.safety.entered_degraded, 0U);
    EXPECT_LE(row.misses_per_command.count, 5000U / 67U + 1);
    // Older than one period by its camera: ages that a policy at 50 Hz does not have.
    EXPECT_GT(row.age_per_tick.total.p99_ms.value_or(0), 100);
    EXPECT_LT(row.age_per_tick.total.p99_ms.value_or(1e9), 0.8 * robot.freshness.max_age.milliseconds());
  }
}

TEST(VisuomotorArm, ForeseesWhatALateDecisionNeeds) {
  const evidence::RolloutRow row = run(robot_file(), "publish_delay", 100, 1, seconds(4));
  EXPECT_GT(row.age_per_tick.total.p50_ms.value_or(0), 150);
  EXPECT_LT(row.tracking_error_rms_m, 0.5 * kBound_m) << "the target goes 16 mm further in 100 ms";
  EXPECT_EQ(row.safety.entered_degraded, 0U);
}

TEST(VisuomotorArm, ComesBackAfterASilentPolicy) {
  const evidence::RolloutRow row = run(robot_file(), "policy_freeze", 600, 2);
  EXPECT_EQ(row.safety.entered_degraded, 1U);
  EXPECT_TRUE(row.recovery_s.has_value());
  EXPECT_EQ(row.final_mode, Mode::tracking);
}

// Goal: an inference longer than two periods costs the arm its task with one request at a time, and nothing with three
// in flight. Method: 150 ms a piece, contracts widened as in config/panels/pipelined.yaml.
TEST(VisuomotorArm, ThreeRequestsInFlightMakeALongInferenceHarmless) {
  config::RobotConfig robot = robot_file();
  robot.freshness.max_age = milliseconds(600);
  robot.freshness.stop_after = seconds(1);
  const evidence::PolicyTiming slow{.inference = milliseconds(150), .spread = 0.1};
  const evidence::RolloutRow one = run(robot, "none", 0, 1, seconds(1), slow);
  robot.policy->requests_in_flight = 3;
  const evidence::RolloutRow three = run(robot, "none", 0, 1, seconds(1), slow);
  std::printf("rms error: one request %.1f mm, three in flight %.1f mm\n", one.tracking_error_rms_m * 1e3,
              three.tracking_error_rms_m * 1e3);
  EXPECT_FALSE(one.success);
  EXPECT_TRUE(three.success) << three.failure_label;
  EXPECT_LT(three.tracking_error_rms_m, 0.25 * one.tracking_error_rms_m);
  EXPECT_GT(three.misses_per_command.count, one.misses_per_command.count * 2) << "an answer per period";
  EXPECT_EQ(run(robot, "none", 0, 1, seconds(1), slow).replay_hash, three.replay_hash);
}

// Goal: a policy that samples contradicts itself from answer to answer, and the row says what the reference made of it.
// Method: two modes against none, with the join that takes each answer as it is.
TEST(VisuomotorArm, AnswersOfTwoModesPullTheReferenceAbout) {
  config::RobotConfig robot = robot_file();
  robot.policy->action.join.kind = config::JoinKind::replace;
  const evidence::RolloutRow calm = run(robot, "none", 0, 1);
  const evidence::RolloutRow torn = run(robot, "none", 0, 1, seconds(1), {.modes = 2, .mode_spread = 0.05});
  EXPECT_EQ(run(robot, "none", 0, 1, seconds(1), {.modes = 1, .mode_spread = 0.05}).replay_hash, calm.replay_hash);
  EXPECT_GT(torn.tracking_error_rms_m, 2 * calm.tracking_error_rms_m);
  const auto limited = static_cast<std::size_t>(std::countr_zero(bit(Intervention::acceleration_limit)));
  EXPECT_GT(torn.interventions[limited], 2 * calm.interventions[limited]);
  EXPECT_GT(calm.peak_reference_jerk, 0);
  EXPECT_GE(torn.peak_join_velocity_step, calm.peak_join_velocity_step);
}

}  // namespace
}  // namespace takt::lab

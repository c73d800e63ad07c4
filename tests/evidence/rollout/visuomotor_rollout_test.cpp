// Goal: the arm whose policy decides once per two camera frames does its task at that rate: its chunks bridge the
// decisions, its contract leaves room for them, and what it foresees of the target is what makes it arrive. Method:
// rollouts of the committed robot in virtual time, judged by their rows, and the arithmetic of its robot file.
#include <gtest/gtest.h>

#include <stdexcept>

#include "config/load.hpp"
#include "evidence/rollout/rollout.hpp"
#include "policy_host/onnx_policy.hpp"

namespace takt::panel {
namespace {

constexpr double kBound_m = 0.02;  // as in the panels

config::RobotConfig robot_file() {
  auto loaded = config::load("config/arm6_visuomotor.yaml");
  if (!loaded) throw std::runtime_error(loaded.error());
  return *std::move(loaded);
}

// 5 s; the perturbation acts from 1 s on, the last 2 s are scored.
RolloutRow run(const config::RobotConfig& robot, std::string_view perturbation, double dose, std::uint64_t seed,
               Duration lasting = seconds(1)) {
  const auto policy = policy_host::load_onnx_policy(robot.policy->file, robot.policy->input, robot.policy->output);
  if (!policy) throw std::runtime_error(policy.error());
  RolloutRow row;
  const auto done = run_rollout({.robot = robot,
                                 .policy = **policy,
                                 .policy_hash = *config::policy_hash(robot.policy->file),
                                 .timing = {},
                                 .perturbation = {find_perturbation(perturbation)->trouble, dose, seconds(1), lasting},
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
    const RolloutRow row = run(robot, "none", 0, seed);
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
  const RolloutRow row = run(robot_file(), "publish_delay", 100, 1, seconds(4));
  EXPECT_GT(row.age_per_tick.total.p50_ms.value_or(0), 150);
  EXPECT_LT(row.tracking_error_rms_m, 0.5 * kBound_m) << "the target goes 16 mm further in 100 ms";
  EXPECT_EQ(row.safety.entered_degraded, 0U);
}

TEST(VisuomotorArm, ComesBackAfterASilentPolicy) {
  const RolloutRow row = run(robot_file(), "policy_freeze", 600, 2);
  EXPECT_EQ(row.safety.entered_degraded, 1U);
  EXPECT_TRUE(row.recovery_s.has_value());
  EXPECT_EQ(row.final_mode, Mode::tracking);
}

}  // namespace
}  // namespace takt::panel

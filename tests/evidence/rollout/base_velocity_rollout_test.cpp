// SPDX-License-Identifier: Apache-2.0
// Goal: a robot whose base moves by itself rolls out in virtual time as it runs: its IMU reaches tick and policy, a
// person commands its velocity, it is judged by how it goes and whether it stands. Method: a box on two wheels of our
// own with a policy written here; the robot in config/ that falls unless it is balanced; Unitree's G1 by its
// published policy where ../shared has them.
#include <gtest/gtest.h>
#include <unistd.h>

#include <array>
#include <cmath>
#include <cstdio>
#include <stdexcept>

#include "config/load.hpp"
#include "config/observation_shape.hpp"
#include "evidence/rollout/rollout.hpp"
#include "policy_host/onnx_policy.hpp"
#include "tests/evidence/rollout/published_g1.hpp"
#include "tests/support/shared_files.hpp"

namespace takt::lab {
namespace {

// Wheels as fast as the command asks; keeps what the IMU's terms said.
class Driver final : public policy_host::Policy {
 public:
  [[nodiscard]] std::size_t input_size() const override { return 9; }
  [[nodiscard]] std::size_t output_size() const override { return 2; }
  void infer(std::span<const float> input, std::span<float> output) override {
    std::copy_n(input.begin(), 9, seen.begin());
    const float ahead = input[6] / 0.1F, turn = input[8] * 0.13F / 0.1F;
    output[0] = ahead - turn;
    output[1] = ahead + turn;
  }
  void reset() override {}
  std::array<float, 9> seen{};
};

const config::RobotConfig& rover() {
  static const config::RobotConfig robot = [] {
    auto loaded = config::load("tests/evidence/rollout/rover.yaml");
    if (!loaded) throw std::runtime_error(loaded.error());
    return *loaded;
  }();
  return robot;
}

evidence::RolloutSetup setup_of(const config::RobotConfig& robot, policy_host::Policy& policy,
                                std::string_view perturbation, double dose, std::uint64_t seed) {
  return {.robot = robot,
          .policy = policy,
          .policy_hash = 1,
          .task = evidence::Task::base_velocity,
          .timing = {},
          .perturbation = {evidence::find_perturbation(perturbation)->as<evidence::Trouble>(), dose, seconds(4),
                           seconds(3)},
          .seed = seed,
          .duration = seconds(8),
          .scored = seconds(2),
          .bound_m = 0.3};
}

evidence::RolloutRow run(const evidence::RolloutSetup& setup) {
  evidence::RolloutRow row;
  if (const auto done = evidence::run_rollout(setup, row); !done) throw std::runtime_error(done.error());
  return row;
}

evidence::RolloutRow drive(std::string_view perturbation = "none", double dose = 0, std::uint64_t seed = 1) {
  Driver driver;
  return run(setup_of(rover(), driver, perturbation, dose, seed));
}

TEST(BaseVelocityRollout, GoesAsCommandedAndStands) {
  for (std::uint64_t seed = 1; seed <= 3; ++seed) {
    const evidence::RolloutRow row = drive("none", 0, seed);
    EXPECT_TRUE(row.success) << row.failure_label << ", seed " << seed << ", " << row.tracking_error_rms_m;
    EXPECT_LT(row.tracking_error_rms_m, 0.1) << "m off, per second";
    EXPECT_EQ(row.safety.entered_degraded, 0U);
  }
}

TEST(BaseVelocityRollout, NotGoingIsATrackingError) {
  Driver driver;
  evidence::RolloutSetup setup = setup_of(rover(), driver, "policy_crash", 60'000, 1);
  const evidence::RolloutRow lost = run(setup);
  EXPECT_EQ(lost.failure_label, "command_lost");
  EXPECT_NEAR(lost.tracking_error_rms_m, 0.5, 0.05) << "it stands, and is told to go";
}

// Goal: a robot whose policy is gone stands by its fallback policy, for as long as it is gone. Method: the same driver
// as both; the fallback's command says stand still. The command ends with the policy, so that standing is what is
// asked.
TEST(BaseVelocityRollout, TheFallbackPolicyStandsInForOneThatIsGone) {
  config::RobotConfig robot = rover();
  robot.degraded.behaviour = config::Degraded::fallback;
  robot.degraded.fallback = "stand";
  Driver driver;
  evidence::FallbackHost host{config::seen_by_fallback(robot, robot.fallbacks.front()), std::make_unique<Driver>(), 2};
  for (const double gone_ms : {1'000.0, 60'000.0}) {
    evidence::RolloutSetup setup = setup_of(robot, driver, "policy_crash", gone_ms, 1);
    setup.base_velocity.until = seconds(5);
    setup.fallback = &host;
    std::uint64_t by_fallback = 0, by_policy_at_last = 0;
    setup.on_tick = [&](const TickRecord& record) {
      by_fallback += record.header.player == Player::fallback ? 1U : 0U;
      by_policy_at_last = record.header.player == Player::policy ? by_policy_at_last + 1 : 0;
    };
    const evidence::RolloutRow row = run(setup);
    EXPECT_TRUE(row.success) << row.failure_label << ", gone for " << gone_ms << " ms";
    EXPECT_EQ(row.safety.entered_damped_stop, 0U);
    EXPECT_GT(by_fallback, 500U);
    EXPECT_EQ(by_policy_at_last > 500U, gone_ms < 2000) << "handed back to a policy that came back";
  }
}

TEST(BaseVelocityRollout, RepeatsItselfBitForBit) {
  const evidence::RolloutRow one = drive("sensor_dropout", 0.5, 3), other = drive("sensor_dropout", 0.5, 3);
  EXPECT_EQ(one.replay_hash, other.replay_hash);
  EXPECT_EQ(one.tracking_error_rms_m, other.tracking_error_rms_m);
  EXPECT_NE(one.replay_hash, drive("sensor_dropout", 0.5, 4).replay_hash);
  EXPECT_NE(one.replay_hash, drive("sensor_dropout", 0.6, 3).replay_hash);
}

// Goal: what the IMU says reaches tick and policy with its stamp. Method: the records of a nominal rollout; the
// policy's newest input.
TEST(BaseVelocityRollout, TheImuReachesTickAndPolicy) {
  Driver driver;
  evidence::RolloutSetup setup = setup_of(rover(), driver, "none", 0, 1);
  std::uint64_t ticks = 0, usable = 0;
  Duration oldest;
  setup.on_tick = [&](const TickRecord& record) {
    ++ticks;
    usable += record.header.imu_verdict == ImuVerdict::usable ? 1U : 0U;
    oldest = std::max(oldest, record.header.now - record.header.imu.sensed_at);
  };
  run(setup);
  EXPECT_EQ(usable, ticks);
  EXPECT_LE(oldest, milliseconds(1));
  EXPECT_NEAR(driver.seen[5], -1, 0.01) << "down is down";
  EXPECT_NE(driver.seen[0], 0) << "noise";
  EXPECT_NEAR(driver.seen[0], 0, 0.2);
  EXPECT_FLOAT_EQ(driver.seen[6], 0.5F) << "the command";
}

// Goal: sensor troubles reach the IMU's way too. Method: every sample lost in the window; values frozen in it.
TEST(BaseVelocityRollout, AnImuThatIsLostStopsTheRobot) {
  EXPECT_EQ(drive("sensor_dropout", 1).failure_label, "imu_lost");
  EXPECT_EQ(drive("camera_freeze", 900).failure_label, "imu_lost");
  EXPECT_TRUE(drive("sensor_burst", 20).success);
}

TEST(BaseVelocityRollout, ARobotThatIsThrownOverHasFallenAndTheRolloutEnds) {
  const evidence::RolloutRow row = drive("push", 600);
  EXPECT_FALSE(row.success);
  EXPECT_TRUE(row.failure_label == "fell" || row.failure_label == "tilt") << row.failure_label;
  EXPECT_LT(row.ticks, drive().ticks);
}

// Goal: the command may end, and standing is then what is asked. Method: judged on the seconds after.
TEST(BaseVelocityRollout, StandsWhenTheCommandEnds) {
  Driver driver;
  evidence::RolloutSetup setup = setup_of(rover(), driver, "none", 0, 1);
  setup.base_velocity.until = seconds(4);
  const evidence::RolloutRow row = run(setup);
  EXPECT_TRUE(row.success) << row.failure_label;
  EXPECT_LT(row.tracking_error_rms_m, 0.02);
}

TEST(BaseVelocityRollout, WalkingBeginsWhenTheSeedSays) {
  EXPECT_NE(evidence::walk_begins(1), evidence::walk_begins(2));
  for (std::uint64_t seed = 0; seed < 20; ++seed) {
    EXPECT_GE(evidence::walk_begins(seed), seconds(2));
    EXPECT_LT(evidence::walk_begins(seed), seconds(3));
  }
}

TEST(BaseVelocityRollout, RefusesWhatItCannotPlay) {
  Driver driver;
  config::RobotConfig robot = rover();
  const auto refusal = [&](const evidence::BaseVelocityTask& task = {}) {
    evidence::RolloutSetup setup = setup_of(robot, driver, "none", 0, 1);
    setup.base_velocity = task;
    evidence::RolloutRow row;
    const auto done = evidence::run_rollout(setup, row);
    return done ? std::string() : done.error();
  };
  EXPECT_NE(refusal({.command = {2, 0, 0}}).find("outside the limits of sensor velocity"), std::string::npos);
  robot.simulation->mujoco->imu_site.clear();
  EXPECT_NE(refusal().find("simulation.mujoco.imu.site"), std::string::npos);
  robot.policy->observation.pop_back();
  EXPECT_NE(refusal().find("needs a policy with a term `command`"), std::string::npos);
  robot.simulation->mujoco.reset();
  EXPECT_NE(refusal().find("needs `simulation.mujoco`"), std::string::npos);
}

// --- robots that fall by themselves ---

// The parameter: balancer, the robot in config/; g1, Unitree's, as takt config import writes it from the published
// files, fallback policy included.
class WalkerRollout : public testing::TestWithParam<const char*> {
 protected:
  void SetUp() override {
    const bool published = std::string_view(GetParam()) == "g1";
    if (published) {
      TAKT_NEEDS_SHARED(test::kG1Model, test::kG1Policy + "policy.onnx", test::kG1Policy + "deploy.yaml");
      test::import_g1(path_);
    }
    auto robot = config::load(published ? path_ : "config/balancer.yaml");
    ASSERT_TRUE(robot) << robot.error();
    robot_ = *robot;
    policy_ = policy_host::load_onnx_policy(robot_.policy->file, "obs", "actions").value();
    fallback_ = std::move(evidence::load_fallback_host(robot_).value());
    ASSERT_NE(fallback_, nullptr);
  }
  ~WalkerRollout() override { std::remove(path_.c_str()); }
  evidence::RolloutRow walk(std::string_view perturbation, double dose) {
    evidence::RolloutSetup setup = setup_of(robot_, *policy_, perturbation, dose, 1);
    setup.fallback = fallback_.get();
    setup.base_velocity.until = seconds(5);
    return run(setup);
  }

  std::string path_ = testing::TempDir() + "takt-g1-" + std::to_string(getpid()) + ".yaml";
  config::RobotConfig robot_;
  std::unique_ptr<policy_host::Policy> policy_;
  std::unique_ptr<evidence::FallbackHost> fallback_;
};

TEST_P(WalkerRollout, WalksAsCommandedAndIsTheSameTwice) {
  const evidence::RolloutRow row = walk("none", 0);
  EXPECT_TRUE(row.success) << row.failure_label << ", " << row.tracking_error_rms_m;
  EXPECT_EQ(walk("none", 0).replay_hash, row.replay_hash);
  RecordProperty("error_mm", static_cast<int>(1e3 * row.tracking_error_rms_m));
}

TEST_P(WalkerRollout, StandsByItsFallbackPolicyWhenItsPolicyIsGone) {
  EXPECT_TRUE(walk("policy_freeze", 2000).success);
  EXPECT_TRUE(walk("policy_crash", 60'000).success);
}

TEST_P(WalkerRollout, FallsWhenItHoldsInstead) {
  robot_.degraded.behaviour = config::Degraded::hold;
  fallback_.reset();
  const evidence::RolloutRow row = walk("policy_freeze", 2000);
  EXPECT_FALSE(row.success);
  EXPECT_TRUE(row.failure_label == "fell" || row.failure_label == "command_lost" || row.failure_label == "tilt")
      << row.failure_label;
}

INSTANTIATE_TEST_SUITE_P(Robots, WalkerRollout, testing::Values("balancer", "g1"),
                         [](const auto& robot) { return std::string(robot.param); });

}  // namespace
}  // namespace takt::lab

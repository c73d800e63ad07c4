// SPDX-License-Identifier: Apache-2.0
// Goal: the methods that every panel knows do what their names say. Method: rollouts of the demo arm, tick by tick.
// What the plain loop tells a drive is computed here a second time, from the chunks and the robot file's words alone;
// of a time-out the tick in which the robot reacts is looked at; a protection that is off leaves no mark of its own.
#include <gtest/gtest.h>

#include <bit>
#include <cmath>
#include <map>
#include <numeric>
#include <optional>
#include <vector>

#include "evidence/rollout/plain_loop.hpp"
#include "executive/setup/tick_config_of.hpp"
#include "tests/evidence/rollout/arm_rollouts.hpp"

namespace takt::lab {
namespace {

evidence::RolloutSetup setup_of(evidence::Method method, std::string_view perturbation = "none", double dose = 0) {
  evidence::RolloutSetup setup = test::setup(perturbation);
  setup.method = method;
  if (dose > 0) setup.perturbation.dose = dose;
  return setup;
}

std::vector<TickRecordHeader> headers_of(evidence::RolloutSetup setup) {
  std::vector<TickRecordHeader> headers;
  setup.on_tick = [&](const TickRecord& record) { headers.push_back(record.header); };
  (void)test::run(setup);
  return headers;
}

// The arm's yaw joint, which gravity does not load: position on the straight line between the steps of the newest
// chunk, velocity its slope, the robot file's gains, no torque. Under lost commands, too.
TEST(PlainMethod, TellsTheDriveTheChunksTargetAndNothingElse) {
  const config::Joint& yaw = test::arm().joints[0];
  std::map<std::uint64_t, MonoTime> published;
  std::optional<CommandChunk> newest;
  std::size_t compared = 0, moving = 0;
  evidence::RolloutSetup setup = setup_of({evidence::BuiltIn::plain}, "policy_freeze", 800);
  setup.on_command = [&](const CommandChunk& chunk) { newest = chunk; };
  setup.on_tick = [&](const TickRecord& record) {
    const TickRecordHeader& header = record.header;
    if (header.observation_published != 0) published[header.observation_published] = header.now;
    if (header.mode != Mode::tracking) return;
    ASSERT_TRUE(newest.has_value());
    const CommandHeader& said = newest->header;
    const double at = (header.now - published.at(said.observation_id)).seconds() / said.step_period.seconds();
    const auto step = static_cast<std::size_t>(std::floor(at));
    const std::size_t last = said.step_count - 1U;
    const auto q = [&](std::size_t k) { return static_cast<double>(newest->values[k * said.joint_count]); };
    ASSERT_EQ(said.fields, static_cast<std::uint8_t>(CommandField::q)) << "the arm's policy gives positions alone";
    const bool over = step >= last;
    const double slope = over ? 0 : (q(step + 1) - q(step)) / said.step_period.seconds();
    const double wanted = over ? q(last) : q(step) + (at - static_cast<double>(step)) * (q(step + 1) - q(step));
    const JointRecord& joint = record.joints[0];
    ASSERT_NEAR(joint.q_command, wanted, 1e-5) << header.tick;
    ASSERT_NEAR(joint.dq_command, slope, 1e-4) << header.tick;
    ASSERT_FLOAT_EQ(joint.kp_command, static_cast<float>(yaw.kp));
    ASSERT_FLOAT_EQ(joint.kd_command, static_cast<float>(yaw.kd));
    ASSERT_NEAR(joint.tau_command, 0, 1e-4);
    ASSERT_EQ(joint.interventions, 0);
    ++compared;
    moving += std::abs(slope) > 0.01 ? 1U : 0U;
  };
  const evidence::RolloutRow row = test::run(setup);
  EXPECT_GT(compared, 4000U);
  EXPECT_GT(moving, 1000U);
  EXPECT_EQ(row.safety.entered_degraded + row.safety.entered_damped_stop, 0U);
  EXPECT_GT(row.misses_per_tick.misses, 0U) << "age is measured all the same";
}

// Targets are not clamped, pursued or refused: what a held step says is told in the tick that it begins in.
TEST(PlainMethod, AHeldStepGoesOutWhole) {
  pipeline::TickConfig config = setup::tick_config_of(test::arm(), 0, 0);
  config.interpolation = pipeline::Interpolation::hold;
  CommandChunk chunk;
  chunk.header.step_period = milliseconds(20);
  chunk.header.step_count = 2;
  chunk.header.joint_count = 1;
  chunk.header.fields = static_cast<std::uint8_t>(CommandField::q);
  chunk.values[0] = 0.5F;
  chunk.values[1] = 99.0F;
  const auto told = [&](Duration since) { return evidence::plain_setpoint(chunk, since, 0, 1.5F, {}, config); };
  EXPECT_EQ(told(microseconds(19'999)).q, 0.5F);
  EXPECT_EQ(told(milliseconds(20)).q, 99.0F);
  EXPECT_EQ(told(seconds(3)).q, 99.0F) << "the last one holds";
  EXPECT_EQ(told(milliseconds(20)).dq, 0.0F);
  EXPECT_EQ(told(milliseconds(20)).tau, 1.5F);
  config.joints[0].loop = pipeline::LoopAt::host_torque;
  JointFeedback said;
  said.q = 0.25F;
  said.dq = -1.0F;
  const pipeline::JointSetpoint finished = evidence::plain_setpoint(chunk, Duration{}, 0, 1.5F, said, config);
  EXPECT_FLOAT_EQ(finished.tau, config.joints[0].kp * 0.25F + config.joints[0].kd + 1.5F);
  EXPECT_EQ(finished.kp, 0.0F);
}

TEST(PlainMethod, KeepsAHealthyArmOnItsTaskAndObeysThePersonsStop) {
  const evidence::RolloutRow row = test::run(setup_of({evidence::BuiltIn::plain}));
  EXPECT_TRUE(row.success) << row.failure_label;
  EXPECT_EQ(std::accumulate(row.interventions.begin(), row.interventions.end(), std::uint64_t{0}), 0U);
  const evidence::RolloutRow stopped = test::run(setup_of({evidence::BuiltIn::plain}, "operator_stop"));
  EXPECT_EQ(stopped.failure_label, "operator_stop");
}

// The first tick without a usable command is degraded, the first with one tracks again.
TEST(TimeoutMethod, ReactsWithinATickAndComesBackWithTheNextCommand) {
  std::size_t left = 0, back = 0;
  const TickRecordHeader* before = nullptr;
  const auto headers = headers_of(setup_of({evidence::BuiltIn::timeout}, "policy_freeze", 400));
  for (const TickRecordHeader& header : headers) {
    if (before != nullptr && before->mode != Mode::arming && header.now > before->now && header.mode != Mode::standby) {
      const bool relies = header.mode == Mode::tracking || header.mode == Mode::degraded;
      if (relies) {
        EXPECT_EQ(header.mode == Mode::tracking, is_usable(header.seats[Seat::policy].freshness)) << header.tick;
      }
      left += header.mode == Mode::degraded && before->mode == Mode::tracking ? 1U : 0U;
      back += header.mode == Mode::tracking && before->mode == Mode::degraded ? 1U : 0U;
    }
    before = &header;
  }
  EXPECT_EQ(left, 1U);
  EXPECT_EQ(back, 1U);
  // The contract itself waits for its window and comes back later.
  std::size_t tolerated = 0;
  for (const TickRecordHeader& header : headers_of(setup_of({}, "policy_freeze", 400)))
    tolerated += header.mode == Mode::tracking && !is_usable(header.seats[Seat::policy].freshness) ? 1U : 0U;
  EXPECT_GT(tolerated, 0U);
}

TEST(TimeoutMethod, OfASecondHoldsTheNewestCommandForThatLong) {
  std::optional<Duration> age;
  for (const TickRecordHeader& header : headers_of(setup_of({evidence::BuiltIn::timeout_1s}, "policy_freeze", 2000))) {
    if (header.mode != Mode::degraded) continue;
    age = header.age.total();
    break;
  }
  ASSERT_TRUE(age.has_value()) << "two seconds are too long";
  EXPECT_GT(*age, seconds(1));
  EXPECT_LE(*age, seconds(1) + milliseconds(2));
}

TEST(HoldLastMethod, NeverDegradesNorStops) {
  const evidence::RolloutRow row = test::run(setup_of({evidence::BuiltIn::hold_last}, "policy_freeze", 2000));
  EXPECT_EQ(row.safety.entered_degraded + row.safety.entered_damped_stop, 0U);
  EXPECT_EQ(row.final_mode, Mode::tracking);
}

std::uint64_t marks(const evidence::RolloutRow& row, Intervention kind) {
  return row.interventions[static_cast<std::size_t>(std::countr_zero(static_cast<unsigned>(bit(kind))))];
}

// The arm with inertias so far apart that the brake's reserve and the barriers act all the time.
evidence::RolloutRow run_strained(std::optional<evidence::Protection> without) {
  static const config::RobotConfig robot = [] {
    config::RobotConfig strained = test::arm();
    for (config::Joint& joint : strained.joints) {
      joint.inertia = 1e-4;
      joint.inertia_max = 20;
    }
    return strained;
  }();
  const evidence::RolloutSetup arm = setup_of({evidence::BuiltIn::takt, without}, "push");
  return test::run({.robot = robot,
                    .policy = arm.policy,
                    .policy_hash = arm.policy_hash,
                    .timing = arm.timing,
                    .method = arm.method,
                    .perturbation = arm.perturbation,
                    .duration = arm.duration,
                    .scored = arm.scored,
                    .bound_m = arm.bound_m});
}

// A protection that is off leaves no mark of its own, and the rollout is another one where it acted.
TEST(Protections, AreSwitchedOffOneByOne) {
  const evidence::RolloutRow whole = run_strained({});
  const auto barred = [](const evidence::RolloutRow& row) {
    return marks(row, Intervention::position_barrier) + marks(row, Intervention::velocity_barrier);
  };
  EXPECT_GT(barred(whole), 0U);
  EXPECT_GT(marks(whole, Intervention::brake_reserve), 0U);
  EXPECT_EQ(barred(run_strained(evidence::Protection::barriers)), 0U);
  EXPECT_EQ(marks(run_strained(evidence::Protection::brake_reserve), Intervention::brake_reserve), 0U);
  for (const evidence::Protection one : {evidence::Protection::pursuit, evidence::Protection::jerk,
                                         evidence::Protection::ramp, evidence::Protection::observer})
    EXPECT_NE(run_strained(one).replay_hash, whole.replay_hash) << static_cast<int>(one);
}

// What no executive can be told: a robot file's configuration has every protection.
TEST(Protections, AreAllOnWhateverTheRobotFile) {
  const pipeline::Without without = setup::tick_config_of(test::arm(), 0, 0).without;
  EXPECT_FALSE(without.pursuit || without.jerk || without.brake_reserve || without.barriers || without.envelope ||
               without.observer);
}

}  // namespace
}  // namespace takt::lab

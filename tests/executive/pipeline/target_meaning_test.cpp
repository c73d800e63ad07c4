// SPDX-License-Identifier: Apache-2.0
// Goal: targets are played as they were meant. Held steps (policies of Isaac Lab and Unitree) come without a velocity
// setpoint, and cost no more torque rate than the plain PD loop they were trained with; a joint out of its range is
// clamped, marked and counted, and only a share of the window stops the robot. Method: the whole tick in virtual time
// in front of simulated joints; the same actions into a PD loop in front of the same joint.
#include <gtest/gtest.h>

#include <algorithm>
#include <cmath>
#include <cstdint>
#include <cstdio>
#include <random>
#include <utility>
#include <vector>

#include "executive/pipeline/mode_machine.hpp"
#include "tests/executive/pipeline/rig.hpp"

namespace takt::pipeline {
namespace {

using testing::chunk_for;
using testing::Rig;
using testing::robot;

constexpr int kTicksPerAction = 20;

// A leg's joint: as stiff and as nimble as the knee of a walking humanoid.
TickConfig walker(Interpolation interpolation) {
  TickConfig config = robot(1);
  config.interpolation = interpolation;
  JointConfig& joint = config.joints[0];
  joint.limits.velocity = 20.0F;
  joint.limits.velocity_hard = 30.0F;
  joint.limits.acceleration = 1000.0F;
  joint.limits.torque = 120.0F;
  joint.limits.torque_rate = 1.0e6F;
  joint.kp = 150.0F;
  joint.kd = 4.0F;
  return config;
}

// As a policy sends them that decides 50 times a second: a slow gait with the noise that such networks have.
std::vector<float> actions(std::size_t count) {
  std::mt19937 random(7);
  std::vector<float> targets(count);
  for (std::size_t i = 0; i < count; ++i) {
    const auto noise = static_cast<float>(random() % 2001U) * 1.0e-3F - 1.0F;
    targets[i] = 0.3F * std::sin(0.12F * static_cast<float>(i)) + 0.05F * noise;
  }
  return targets;
}

// Sends one action to the publisher of the newest observation.
const TickOutput& tick_with_action(Rig& rig, float target) {
  if (!rig.out->observation_due) return rig.tick();
  CommandChunk chunk = chunk_for(rig.config, rig.newest_observation, rig.published_at[rig.newest_observation], rig.now,
                                 ++rig.sequence, target, 1);
  chunk.header.step_period = milliseconds(60);
  return rig.tick(&chunk);
}

struct Played {
  double torque_rate = 0;  // Nm/s, rms over all ticks
  double kick = 0;         // Nm, largest change of torque within a tick
  double error = 0;        // rad, rms distance of the joint from the action it is told
  float fastest_setpoint = 0, fastest_reference = 0;
};

class Measure {
 public:
  void torque(float now) {
    const double change = static_cast<double>(now - last_);
    last_ = now;
    if (++ticks_ == 1) return;
    sum_ += change * change;
    played_.kick = std::max(played_.kick, std::abs(change));
  }
  void distance(float error) { errors_ += static_cast<double>(error) * static_cast<double>(error); }
  Played& played() { return played_; }
  Played result() {
    played_.torque_rate = std::sqrt(sum_ / (ticks_ - 1)) * 1000.0;
    played_.error = std::sqrt(errors_ / ticks_);
    return played_;
  }

 private:
  Played played_;
  float last_ = 0;
  int ticks_ = 0;
  double sum_ = 0, errors_ = 0;
};

Played play(Interpolation interpolation, const std::vector<float>& targets) {
  Rig rig(walker(interpolation));
  rig.arm(0.0F);
  rig.run_with_policy(200, 0.0F);
  Measure measure;
  for (const float target : targets) {
    while (!rig.out->observation_due) rig.tick();
    for (int i = 0; i < kTicksPerAction; ++i) {
      const TickOutput& out = tick_with_action(rig, target);
      EXPECT_EQ(rig.mode(), Mode::tracking);
      const JointRecord& joint = out.record.joints[0];
      measure.torque(joint.tau_total);
      measure.distance(target - rig.drives[0].q);
      Played& played = measure.played();
      played.fastest_setpoint = std::max(played.fastest_setpoint, std::abs(out.setpoints[0].dq));
      played.fastest_reference = std::max(played.fastest_reference, std::abs(joint.dq_reference));
    }
  }
  return measure.result();
}

// tau = kp (action - q) - kd dq, once per millisecond, on the rig's joint.
Played play_plain_pd(const std::vector<float>& targets) {
  const TickConfig config = walker(Interpolation::hold);
  const JointConfig& joint = config.joints[0];
  const float inertia = 1.5F * joint.inertia, friction = 0.1F, dt = 0.001F;
  float q = 0, dq = 0;
  Measure measure;
  for (const float target : targets) {
    for (int i = 0; i < kTicksPerAction; ++i) {
      const float tau = std::clamp(joint.kp * (target - q) - joint.kd * dq, -joint.limits.torque, joint.limits.torque);
      measure.torque(tau);
      measure.distance(target - q);
      dq += dt * (tau - friction * dq) / inertia;
      q += dt * dq;
    }
  }
  return measure.result();
}

TEST(TargetMeaning, HeldStepsSendNoVelocityAndHaveNone) {
  const Played held = play(Interpolation::hold, actions(200));
  EXPECT_EQ(held.fastest_setpoint, 0.0F);
  EXPECT_EQ(held.fastest_reference, 0.0F) << "a step goes out as it is: nothing chases it";
  const Played linear = play(Interpolation::linear, actions(200));
  EXPECT_EQ(linear.fastest_setpoint, linear.fastest_reference) << "a path's velocity is meant";
}

TEST(TargetMeaning, HeldStepsCostNoMoreTorqueRateThanThePlainPdLoop) {
  const std::vector<float> targets = actions(500);
  const Played plain = play_plain_pd(targets), held = play(Interpolation::hold, targets);
  const auto print = [](const char* what, const Played& played) {
    std::printf("%-28s torque rate %7.0f Nm/s rms, kick %5.1f Nm, distance %.4f rad rms\n", what, played.torque_rate,
                played.kick, played.error);
  };
  print("plain PD", plain);
  print("hold", held);
  EXPECT_LT(held.torque_rate, 1.2 * plain.torque_rate);
  EXPECT_LT(held.kick, 1.2 * plain.kick);
  EXPECT_LT(held.error, 1.2 * plain.error) << "as near to its action as in training";
}

TEST(TargetMeaning, ALostPolicyIsBrakedWithoutAVelocitySetpoint) {
  TickConfig config = walker(Interpolation::hold);
  config.freshness.epsilon = 0.5;
  Rig rig(config);
  rig.arm(0.0F);
  rig.run_with_policy(200, 0.0F);
  while (!rig.out->observation_due) rig.tick();
  tick_with_action(rig, 1.2F);
  for (int i = 0; i < 200; ++i) {
    rig.tick();
    EXPECT_EQ(rig.out->setpoints[0].dq, 0.0F);
    EXPECT_EQ(rig.out->record.joints[0].q_reference, i < 4 ? rig.out->record.joints[0].q_reference : 1.2F);
  }
}

// In the way that `config` says; the fastest reference afterwards. The joint is in motion meanwhile.
float leave_a_fast_path(TickConfig config, OperatorRequest request) {
  config.freshness.epsilon = 0.001;
  config.freshness.max_age = milliseconds(60);
  Rig rig(config);
  rig.arm(0.0F);
  rig.run_with_policy(200, 0.0F);
  while (!rig.out->observation_due) rig.tick();
  tick_with_action(rig, 1.2F);
  rig.run(25);
  EXPECT_GT(rig.drives[0].dq, 5.0F);
  rig.tick(nullptr, request);
  float fastest = 0;
  for (int i = 0; i < 300; ++i) {
    EXPECT_EQ(rig.out->setpoints[0].dq, 0.0F) << "tick " << i << ", " << name(rig.mode());
    fastest = std::max(fastest, std::abs(rig.out->record.joints[0].dq_reference));
    rig.tick();
  }
  EXPECT_NE(rig.mode(), Mode::tracking);
  return fastest;
}

// Goal: what was trained without a velocity setpoint meets none when it is stopped or led to a pose either: it would
// come as a kick of kd times the reference's velocity. Method: each such mode is entered while the joint moves.
TEST(TargetMeaning, NoModeBringsAVelocitySetpointToHeldSteps) {
  TickConfig config = walker(Interpolation::hold);
  config.joints[0].fallback_speed = 20.0F;
  config.stops[static_cast<std::size_t>(Cause::operator_stop)] = {StopManner::hold, seconds(5)};
  EXPECT_LE(leave_a_fast_path(config, OperatorRequest::stop), 5.0F) << "held";
  config.degraded = DegradedBehaviour::fallback;
  config.fallback = FallbackKind::pose;
  EXPECT_GT(leave_a_fast_path(config, OperatorRequest::none), 5.0F) << "degraded";
}

// One joint of two out of range.
const TickOutput& tick_out_of_range(Rig& rig, float beyond) {
  if (!rig.out->observation_due) return rig.tick();
  CommandChunk chunk = chunk_for(rig.config, rig.newest_observation, rig.published_at[rig.newest_observation], rig.now,
                                 ++rig.sequence, 0.1F, 16);
  const JointLimits& limits = rig.config.joints[1].limits;
  for (std::size_t step = 0; step < 16; ++step)
    chunk.values[value_index(chunk.header, CommandField::q, step, 1)] = limits.q_max + beyond;
  return rig.tick(&chunk);
}

TEST(OutOfRange, OneJointIsClampedAndTheOthersGoOn) {
  TickConfig config = robot(2);
  config.clamped_share = 1.0;
  Rig rig(config);
  rig.arm(0.0F);
  for (int i = 0; i < 3000; ++i) {
    const TickOutput& out = tick_out_of_range(rig, 5.0F);
    ASSERT_EQ(rig.mode(), Mode::tracking);
    ASSERT_LE(out.record.joints[1].q_reference, config.joints[1].limits.q_max);
  }
  EXPECT_EQ(rig.header().refused_commands, 0U);
  EXPECT_NEAR(rig.out->record.joints[0].q_reference, 0.1F, 1e-4F);
  EXPECT_EQ(rig.out->record.joints[0].interventions & bit(Intervention::target_range), 0);
  EXPECT_NEAR(rig.out->record.joints[1].q_reference, config.joints[1].limits.q_max, 1e-4F);
  EXPECT_NE(rig.out->record.joints[1].interventions & bit(Intervention::target_range), 0);
}

TEST(OutOfRange, MoreThanTheShareOfTheWindowStopsTheRobot) {
  for (const double share : {0.1, 0.4}) {
    TickConfig config = robot(2);
    config.clamped_share = share;
    Rig rig(config);
    rig.arm(0.0F);
    rig.run_with_policy(300, 0.0F);
    int clamped = 0;
    while (rig.mode() == Mode::tracking && clamped < 1000) {
      tick_out_of_range(rig, 5.0F);
      clamped += (rig.out->record.joints[1].interventions & bit(Intervention::target_range)) != 0 ? 1 : 0;
    }
    EXPECT_EQ(rig.mode(), Mode::damped_stop);
    EXPECT_EQ(rig.header().cause, Cause::bad_commands);
    EXPECT_EQ(clamped, static_cast<int>(share * config.freshness.window_ticks) + 1);
    for (int i = 0; i < 1000; ++i) rig.tick();
    EXPECT_EQ(rig.header().causes_active & bit(Cause::bad_commands), 0U)
        << "what is past no longer keeps anybody from arming";
  }
}

TEST(OutOfRange, WithinTheTargetsMarginNothingIsCounted) {
  TickConfig config = robot(2);
  config.clamped_share = 0.001;
  config.joints[1].limits.target_margin = 0.5F;  // wider than the envelope of what is measured
  Rig rig(config);
  rig.arm(0.0F);
  for (int i = 0; i < 3000; ++i) {
    const TickOutput& out = tick_out_of_range(rig, 0.45F);
    ASSERT_EQ(rig.mode(), Mode::tracking);
    ASSERT_LE(out.record.joints[1].q_reference, config.joints[1].limits.q_max);
  }
  EXPECT_NE(rig.out->record.joints[1].interventions & bit(Intervention::position_limit), 0);
}

// A policy whose answers always come just before, or just after, max_age: the freshness contract judges it.
TEST(ConstantDelay, NearMaxAgeIsDegradedOrLostAndNeverBadCommands) {
  for (int delay = 70; delay <= 130; delay += 3) {
    Rig rig(robot(2));
    rig.arm(0.0F);
    std::vector<std::pair<MonoTime, std::uint64_t>> asked;
    CauseMask seen = 0;
    Cause stopped_by = Cause::none;
    for (int i = 0; i < 4000 && rig.mode() != Mode::damped_stop; ++i) {
      if (rig.out->observation_due) asked.emplace_back(rig.now + milliseconds(delay), rig.newest_observation);
      if (!asked.empty() && asked.front().first <= rig.now) {
        const std::uint64_t id = asked.front().second;
        asked.erase(asked.begin());
        const CommandChunk chunk = chunk_for(rig.config, id, rig.published_at[id], rig.now, ++rig.sequence, 0.0F);
        rig.tick(&chunk);
      } else {
        rig.tick();
      }
      seen |= rig.header().causes_active;
      if (rig.mode() == Mode::damped_stop) stopped_by = rig.header().cause;
    }
    EXPECT_EQ(seen & bit(Cause::bad_commands), 0U) << delay << " ms";
    EXPECT_EQ(stopped_by, delay >= 100 ? Cause::command_lost : Cause::none) << delay << " ms";
  }
}

}  // namespace
}  // namespace takt::pipeline

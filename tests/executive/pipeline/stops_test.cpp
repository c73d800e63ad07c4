// SPDX-License-Identifier: Apache-2.0
// Goal: a damped stop comes to rest in the manner that its cause was given, for as long as it was given, a worse cause
// takes over with its own, and no manner leaves the limits; degraded mode ends when its time is over. Method: the rig's
// robot, stopped from full motion by causes with each manner; setpoints and limits looked at in every tick.
#include <gtest/gtest.h>

#include <cmath>

#include "executive/pipeline/mode_machine.hpp"
#include "tests/executive/pipeline/rig.hpp"

namespace takt::pipeline {
namespace {

using testing::Rig;
using testing::robot;

TickConfig robot_that_stops(StopManner manner, Duration longest = {}, Cause cause = Cause::operator_stop) {
  TickConfig config = robot(3);
  config.stops[static_cast<std::size_t>(cause)] = {manner, longest};
  return config;
}

class StoppedRig : public Rig {
 public:
  explicit StoppedRig(const TickConfig& robot_config) : Rig(robot_config) {
    arm(1.0F);
    run_with_policy(150, 1.0F);
    speed_at_stop = drives[0].dq;
    tick_with_policy(1.0F, OperatorRequest::stop);
  }
  // `ticks` more, none with a torque beyond its limit or a target out of the joint's range.
  void go(int ticks, OperatorRequest request = OperatorRequest::none) {
    for (int i = 0; i < ticks; ++i) {
      tick_with_policy(1.0F, i == 0 ? request : OperatorRequest::none);
      for (std::size_t j = 0; j < 3; ++j) {
        const JointLimits& limits = config.joints[j].limits;
        ASSERT_LE(std::abs(out->record.joints[j].tau_total), limits.torque * 1.001F);
        ASSERT_LE(std::abs(out->record.joints[j].dq_reference), limits.velocity + 1e-4F);
        ASSERT_LE(std::abs(out->setpoints[j].q), 2.0F);
      }
    }
  }
  [[nodiscard]] bool is_stiff() const { return out->setpoints[0].kp > 0; }
  [[nodiscard]] float at() const { return drives[0].q; }

  float speed_at_stop = 0;
};

TEST(Stops, WithoutARuleTheRobotIsDampedToRestAndHeld) {
  StoppedRig rig(robot(3));
  ASSERT_EQ(rig.mode(), Mode::damped_stop);
  ASSERT_GT(std::abs(rig.speed_at_stop), 0.5F) << "it moved";
  EXPECT_FALSE(rig.is_stiff());
  rig.go(1500);
  EXPECT_TRUE(rig.is_stiff());
}

TEST(Stops, ByDampingItIsNeverHeld) {
  StoppedRig rig(robot_that_stops(StopManner::damping));
  for (int i = 0; i < 20; ++i) {
    rig.go(100);
    EXPECT_FALSE(rig.is_stiff());
    EXPECT_GT(rig.out->setpoints[0].kd, 0) << "damped all the same";
  }
}

TEST(Stops, ByHoldingItIsStiffAtOnceAndBrakesAlongItsLimits) {
  StoppedRig rig(robot_that_stops(StopManner::hold));
  EXPECT_TRUE(rig.is_stiff());
  rig.go(1000);
  const float held = rig.at();
  rig.go(1000);
  EXPECT_NEAR(rig.at(), held, 1e-3F);
  EXPECT_GT(held, 0.1F) << "where it was, not somewhere else";
}

TEST(Stops, AHoldLastsForSoLongAndThenItIsDamped) {
  StoppedRig rig(robot_that_stops(StopManner::hold, milliseconds(100)));
  rig.go(98);
  EXPECT_TRUE(rig.is_stiff());
  rig.drives[0].dq = 1.0F;  // pushed: it does not rest when its time is over
  rig.go(2);
  rig.drives[0].dq = 1.0F;
  rig.go(2);
  EXPECT_FALSE(rig.is_stiff());
  rig.go(2000);
  EXPECT_TRUE(rig.is_stiff()) << "held where it came to rest";
}

TEST(Stops, AWorseCauseTakesOverWithItsOwnManner) {
  TickConfig config = robot_that_stops(StopManner::hold, {}, Cause::command_lost);
  config.stops[static_cast<std::size_t>(Cause::operator_stop)] = {StopManner::damping, {}};
  Rig rig(config);
  rig.arm(0.5F);
  rig.run(700);  // the policy is silent
  ASSERT_EQ(rig.mode(), Mode::damped_stop);
  ASSERT_EQ(rig.header().cause, Cause::none);
  EXPECT_GT(rig.out->setpoints[0].kp, 0);
  rig.tick(nullptr, OperatorRequest::stop);
  EXPECT_EQ(rig.out->setpoints[0].kp, 0) << "a person ends the hold";
  rig.run(200);
  EXPECT_EQ(rig.out->setpoints[0].kp, 0) << "and it does not come back, though its cause is older";
}

// Goal: without a model nothing that a stop damps is known to come to rest: each joint brakes at once, from its
// measured motion, along its limits, and holds. Method: a pull on every joint that damping would follow for good; stops
// of each manner, the true motion.
TEST(Stops, WithoutAModelEachJointBrakesAndHolds) {
  for (const StopManner manner : {StopManner::rest, StopManner::hold}) {
    TickConfig config = robot_that_stops(manner);
    config.holds_at_once = true;
    Rig rig(config);
    rig.arm(1.0F);
    rig.run_with_policy(150, 1.0F);
    const float speed = rig.drives[0].dq, at = rig.drives[0].q;
    ASSERT_GT(std::abs(speed), 0.5F);
    for (int i = 0; i < 3000; ++i) {
      rig.tick(nullptr, i == 0 ? OperatorRequest::stop : OperatorRequest::none);
      for (std::size_t j = 0; j < 3; ++j) {
        rig.drives[j].dq += 0.001F * 6.0F / rig.config.joints[j].inertia / 1.5F;  // 6 Nm
        ASSERT_GT(rig.out->setpoints[j].kp, 0.0F) << i;
      }
      ASSERT_LE(std::abs(rig.drives[0].dq), std::abs(speed) + 0.5F) << i;
    }
    const JointLimits& limits = config.joints[0].limits;
    EXPECT_LE(std::abs(rig.drives[0].q - at),
              speed * speed / (2 * limits.acceleration) + 2 * 6.0F / config.joints[0].kp);
    EXPECT_NEAR(rig.drives[0].dq, 0.0F, 0.05F);
    rig.tick(nullptr, OperatorRequest::reset);
    EXPECT_EQ(rig.mode(), Mode::standby) << "it rests";
  }
}

TEST(Stops, WithoutAModelTooDampingIsForGood) {
  TickConfig config = robot_that_stops(StopManner::damping);
  config.holds_at_once = true;
  StoppedRig damped(config);
  for (int i = 0; i < 20; ++i) {
    damped.go(50);
    EXPECT_FALSE(damped.is_stiff());
  }
}

TEST(Stops, AKeyframeCarriesTheManner) {
  StoppedRig rig(robot_that_stops(StopManner::hold, milliseconds(400)));
  rig.go(50);
  std::vector<std::byte> bytes(160 * 1024);
  const std::size_t size = save(*rig.state, bytes);
  TickStatePtr resumed = make_tick_state(rig.config);
  ASSERT_TRUE(load(*resumed, rig.config, std::span(bytes).first(size)));
  auto replayed = std::make_unique<TickOutput>();
  for (int i = 0; i < 600; ++i) {
    rig.tick();
    control_tick(*resumed, input_of(rig.out->record, nullptr, 0), rig.config, *replayed);
    ASSERT_EQ(replayed->setpoints[0].kp, rig.out->setpoints[0].kp) << i;
    ASSERT_EQ(replayed->setpoints[0].q, rig.out->setpoints[0].q) << i;
  }
}

TEST(DegradedFor, EndsInAStopWhateverTheBehaviour) {
  for (const DegradedBehaviour behaviour :
       {DegradedBehaviour::hold, DegradedBehaviour::slow, DegradedBehaviour::fallback}) {
    TickConfig config = robot(3);
    config.degraded = behaviour;
    config.degraded_longest = milliseconds(300);
    config.freshness.recover_after = seconds(20);  // nothing is restored meanwhile
    Rig rig(config);
    rig.arm(0.3F);
    rig.run(150);
    ASSERT_EQ(rig.mode(), Mode::degraded);
    const MonoTime since = rig.now;
    int ticks = 0;
    for (; rig.mode() == Mode::degraded && ticks < 2000; ++ticks) rig.tick_with_policy(0.3F);
    EXPECT_EQ(rig.mode(), Mode::damped_stop);
    EXPECT_EQ(rig.header().cause, Cause::degraded_spent);
    EXPECT_LE((rig.now - since).milliseconds(), 300);
    EXPECT_GE((rig.now - since).milliseconds(), 200);
  }
}

TEST(DegradedFor, WithoutALimitItLastsAsLongAsItLasts) {
  TickConfig config = robot(3);
  config.freshness.recover_after = seconds(20);
  Rig rig(config);
  rig.arm(0.3F);
  rig.run(150);
  ASSERT_EQ(rig.mode(), Mode::degraded);
  rig.run_with_policy(3000, 0.3F);
  EXPECT_EQ(rig.mode(), Mode::degraded);
}

}  // namespace
}  // namespace takt::pipeline

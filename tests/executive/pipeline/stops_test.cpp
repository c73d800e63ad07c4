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
  for (std::size_t j = 0; j < 3; ++j) {
    config.joints[j].stop_pose = -0.3F;
    config.joints[j].stop_speed = 1.0F;
  }
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

TEST(Stops, APostureIsGoneToAndHeld) {
  StoppedRig rig(robot_that_stops(StopManner::posture));
  rig.go(4000);
  EXPECT_NEAR(rig.at(), -0.3F, 0.02F);
  EXPECT_TRUE(rig.is_stiff());
  EXPECT_EQ(rig.mode(), Mode::damped_stop);
}

TEST(Stops, HoldAndPostureLastForSoLongAndThenItIsDamped) {
  for (const StopManner manner : {StopManner::hold, StopManner::posture}) {
    StoppedRig rig(robot_that_stops(manner, milliseconds(100)));
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
}

TEST(Stops, AWorseCauseTakesOverWithItsOwnManner) {
  TickConfig config = robot_that_stops(StopManner::posture, {}, Cause::command_lost);
  config.stops[static_cast<std::size_t>(Cause::operator_stop)] = {StopManner::damping, {}};
  Rig rig(config);
  rig.arm(0.5F);
  rig.run(700);  // the policy is silent
  ASSERT_EQ(rig.mode(), Mode::damped_stop);
  ASSERT_EQ(rig.header().cause, Cause::none);
  EXPECT_GT(rig.out->setpoints[0].kp, 0);
  rig.tick(nullptr, OperatorRequest::stop);
  EXPECT_EQ(rig.out->setpoints[0].kp, 0) << "a person ends the posture";
  rig.run(200);
  EXPECT_EQ(rig.out->setpoints[0].kp, 0) << "and it does not come back, though its cause is older";
}

// Who stands beside a robot that came to rest may press stop once more: it must not set off.
TEST(Stops, NobodyWhoWasLetGoIsLedToAPosture) {
  for (const StopManner first : {StopManner::rest, StopManner::damping, StopManner::hold}) {
    TickConfig config = robot_that_stops(StopManner::posture);
    config.stops[static_cast<std::size_t>(Cause::command_lost)] = {first, {}};
    Rig rig(config);
    rig.arm(0.5F);
    rig.run_with_policy(1000, 0.5F);
    rig.run(2500);  // the policy is silent
    ASSERT_EQ(rig.mode(), Mode::damped_stop);
    const float at = rig.drives[0].q;
    const bool was_stiff = rig.out->setpoints[0].kp > 0;
    ASSERT_GT(at, 0.2F) << "somewhere else than the posture";
    rig.tick(nullptr, OperatorRequest::stop);
    for (int i = 0; i < 1000; ++i) {
      rig.tick();
      ASSERT_NEAR(rig.drives[0].q, at, 0.02F) << "tick " << i;
      ASSERT_EQ(rig.out->setpoints[0].kp > 0, was_stiff);
    }
  }
}

TEST(Stops, ARobotThatNothingMovedYetIsNotLedToAPosture) {
  TickConfig config = robot_that_stops(StopManner::posture);
  Rig rig(config);
  rig.run_with_policy(40, 0.0F);
  rig.tick_with_policy(0.0F, OperatorRequest::arm);
  ASSERT_EQ(rig.mode(), Mode::arming);
  const float at = rig.drives[0].q;
  rig.tick_with_policy(0.0F, OperatorRequest::stop);
  ASSERT_EQ(rig.mode(), Mode::damped_stop);
  for (int i = 0; i < 1000; ++i) {
    rig.tick_with_policy(0.0F);
    ASSERT_NEAR(rig.drives[0].q, at, 0.02F) << "tick " << i;
  }
}

TEST(Stops, AWorsePostureTakesOverFromOneThatGoesOn) {
  TickConfig config = robot_that_stops(StopManner::posture);
  config.stops[static_cast<std::size_t>(Cause::command_lost)] = {StopManner::posture, milliseconds(100)};
  Rig rig(config);
  rig.arm(0.5F);
  rig.run_with_policy(1000, 0.5F);
  for (int i = 0; i < 2500 && rig.mode() != Mode::damped_stop; ++i) rig.tick();
  rig.run(50);
  rig.tick(nullptr, OperatorRequest::stop);
  rig.run(3000);
  EXPECT_NEAR(rig.drives[0].q, -0.3F, 0.02F);
}

TEST(Stops, AKeyframeCarriesTheManner) {
  StoppedRig rig(robot_that_stops(StopManner::posture, milliseconds(400)));
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

// SPDX-License-Identifier: Apache-2.0
// Goal: the base's IMU is believed only where it can be true, its stamp is part of every observation's oldest sample,
// and each way to lose it, lean or turn too far ends in its named stop. Method: the robot of rig.hpp with an IMU whose
// samples the test writes, a table of what goes wrong.
#include "executive/pipeline/imu_watch.hpp"

#include <gtest/gtest.h>

#include <cmath>
#include <functional>
#include <limits>
#include <memory>
#include <vector>

#include "tests/executive/pipeline/rig.hpp"

namespace takt::pipeline {
namespace {

using testing::robot;

constexpr float kNaN = std::numeric_limits<float>::quiet_NaN();

ImuConfig imu_config() {
  return {.present = true,
          .timeout = milliseconds(20),
          .frozen_after = milliseconds(100),
          .tilt = 1.0F,
          .angular_velocity = 6.0F};
}

// Rolled by `angle` about the base's x axis.
void lean(ImuSample& imu, float angle) {
  imu.rotation[0] = std::cos(angle / 2);
  imu.rotation[1] = std::sin(angle / 2);
}

class ImuRig : public testing::Rig {
 public:
  ImuRig() : Rig(with_imu()) {}

  // A new sample of now, as an honest IMU gives: no two are the same.
  void sense() {
    input.imu.sequence += 1;
    input.imu.sensed_at = now;
    input.imu.acceleration[2] = 9.81F + 0.001F * static_cast<float>(input.imu.sequence % 7);
  }
  void go(int ticks, const std::function<void(ImuSample&)>& wrong = {}) {
    for (int i = 0; i < ticks; ++i) {
      if (!silent) sense();
      if (wrong) wrong(input.imu);
      tick_with_policy(0.3F, i == 0 && arm_next ? OperatorRequest::arm : OperatorRequest::none);
      arm_next = false;
    }
  }
  void track() {
    go(40);
    arm_next = true;
    go(60);
    ASSERT_EQ(mode(), Mode::tracking);
  }

  bool silent = false;
  bool arm_next = false;

 private:
  static TickConfig with_imu() {
    TickConfig config = robot(3);
    config.imu = imu_config();
    return config;
  }
};

TEST(ImuWatch, GravityAndTiltFollowTheRotation) {
  ImuSample upright;
  EXPECT_EQ(projected_gravity(upright), (std::array<float, 3>{0, 0, -1}));
  EXPECT_EQ(tilt_of(upright), 0.0F);
  ImuSample rolled;
  lean(rolled, 0.5F);
  EXPECT_NEAR(projected_gravity(rolled)[1], -std::sin(0.5F), 1e-6);
  EXPECT_NEAR(projected_gravity(rolled)[2], -std::cos(0.5F), 1e-6);
  EXPECT_NEAR(tilt_of(rolled), 0.5F, 1e-6);
}

TEST(ImuWatch, EachLieIsNamedAndNotTaken) {
  struct Lie {
    ImuVerdict verdict;
    std::function<void(ImuSample&)> tell;
  };
  const MonoTime now{1'000'000'000};
  const std::vector<Lie> lies{
      {ImuVerdict::absent, [](ImuSample& imu) { imu.sequence = 0; }},
      {ImuVerdict::from_future, [&](ImuSample& imu) { imu.sensed_at = now + milliseconds(1) + nanoseconds(1); }},
      {ImuVerdict::backwards, [&](ImuSample& imu) { imu.sensed_at = now - milliseconds(3); }},
      {ImuVerdict::backwards, [](ImuSample& imu) { imu.sensed_at = {}; }},
      {ImuVerdict::not_finite, [](ImuSample& imu) { imu.rotation[2] = kNaN; }},
      {ImuVerdict::not_finite, [](ImuSample& imu) { imu.angular_velocity[0] = kNaN; }},
      {ImuVerdict::not_finite, [](ImuSample& imu) { imu.acceleration[1] = kNaN; }},
      {ImuVerdict::not_unit, [](ImuSample& imu) { imu.rotation[0] = 1.02F; }},
      {ImuVerdict::not_unit, [](ImuSample& imu) { imu.rotation[0] = 0.0F; }},
  };
  TickConfig config = robot(1);
  config.imu = imu_config();
  for (const Lie& lie : lies) {
    ImuWatch watch;
    ImuSample good;
    good.sequence = 1;
    good.sensed_at = now - milliseconds(2);
    ASSERT_EQ(take_imu(watch, good, now, config), ImuVerdict::usable);
    ImuSample bad = good;
    bad.sequence = 2;
    bad.sensed_at = now - milliseconds(1);
    bad.angular_velocity[2] = 3;
    lie.tell(bad);
    EXPECT_EQ(take_imu(watch, bad, now, config), lie.verdict);
    EXPECT_EQ(watch.in_force.sequence, 1U) << name(lie.verdict);
  }
}

TEST(ImuWatch, ItsStampIsPartOfEveryObservationsOldestSample) {
  ImuRig rig;
  rig.go(30);
  for (int i = 0; i < 40; ++i) {
    rig.go(1, [&](ImuSample& imu) { imu.sensed_at = rig.now - milliseconds(7); });
    if (!rig.out->observation_due) continue;
    EXPECT_EQ(rig.out->observation.oldest_sensed_at, rig.input.imu.sensed_at) << "older than every joint's";
    EXPECT_EQ(rig.out->observation.imu.sequence, rig.input.imu.sequence);
    EXPECT_EQ(rig.out->observation.imu.acceleration[2], rig.input.imu.acceleration[2]);
  }
}

TEST(ImuWatch, NothingIsObservedBeforeItsFirstSample) {
  ImuRig rig;
  rig.silent = true;
  rig.go(40);
  EXPECT_EQ(rig.newest_observation, 0U);
  rig.silent = false;
  rig.go(40);
  EXPECT_NE(rig.newest_observation, 0U);
}

TEST(ImuCauses, EachWayToLoseItStopsTheRobot) {
  struct Loss {
    const char* when;
    std::function<void(ImuRig&)> strike;
    std::function<void(ImuSample&)> wrong;
    int ticks;  // at most, until the stop
  };
  const std::vector<Loss> losses{
      {"cut: no sample any more", [](ImuRig& rig) { rig.silent = true; }, {}, 22},
      {"late: every sample is older than the timeout",
       {},
       [](ImuSample& imu) { imu.sensed_at = imu.sensed_at - milliseconds(21); },
       22},
      {"lying: stamped ahead of now", {}, [](ImuSample& imu) { imu.sensed_at = imu.sensed_at + milliseconds(5); }, 22},
      {"lying: not finite", {}, [](ImuSample& imu) { imu.acceleration[0] = kNaN; }, 22},
      {"lying: no unit quaternion", {}, [](ImuSample& imu) { imu.rotation[0] = 0.5F; }, 22},
      {"frozen: old values under fresh stamps", {}, [](ImuSample& imu) { imu.acceleration[2] = 9.81F; }, 103},
  };
  for (const Loss& loss : losses) {
    SCOPED_TRACE(loss.when);
    ImuRig rig;
    rig.track();
    if (loss.strike) loss.strike(rig);
    int ticks = 0;
    while (rig.mode() == Mode::tracking && ticks < 200) {
      rig.go(1, loss.wrong);
      rig.input.imu.rotation[0] = 1;
      ++ticks;
    }
    EXPECT_EQ(rig.mode(), Mode::damped_stop);
    EXPECT_EQ(rig.header().cause, Cause::imu_lost);
    EXPECT_LE(ticks, loss.ticks);
    EXPECT_GT(ticks, loss.ticks - 6);
  }
}

TEST(ImuCauses, ABaseThatLeansOrTurnsTooFarStopsTheRobot) {
  const std::vector<std::function<void(ImuSample&)>> beyond{
      [](ImuSample& imu) { lean(imu, 1.01F); },
      [](ImuSample& imu) { imu.angular_velocity[1] = -6.01F; },
  };
  const std::function<void(ImuSample&)> within = [](ImuSample& imu) {
    lean(imu, 0.99F);
    imu.angular_velocity[1] = -5.9F;
  };
  for (const auto& wrong : beyond) {
    ImuRig rig;
    rig.track();
    rig.go(50, within);
    EXPECT_EQ(rig.mode(), Mode::tracking);
    rig.go(1, wrong);
    EXPECT_EQ(rig.mode(), Mode::damped_stop) << "in the tick that read it";
    EXPECT_EQ(rig.header().cause, Cause::tilt);
  }
}

TEST(ImuCauses, NobodyArmsWithoutItOrLeaning) {
  ImuRig rig;
  rig.go(40);
  rig.arm_next = true;
  rig.go(1, [](ImuSample& imu) { lean(imu, 1.2F); });
  EXPECT_EQ(rig.mode(), Mode::standby);
  rig.silent = true;
  rig.go(40);
  std::array<ArmingBlocker, 16> blockers;
  const std::size_t count = arming_blockers(rig.out->record, rig.config, blockers);
  bool named = false;
  for (std::size_t i = 0; i < count; ++i) named |= blockers[i].what.find("IMU") != std::string_view::npos;
  EXPECT_TRUE(named);
}

TEST(ImuCauses, ARobotWithoutOneHasNoneOfThem) {
  testing::Rig rig(robot(3));
  rig.arm();
  rig.input.imu.sequence = 7;
  lean(rig.input.imu, 2.0F);
  rig.run_with_policy(100, 0.3F);
  EXPECT_EQ(rig.mode(), Mode::tracking);
  EXPECT_EQ(rig.out->observation.imu.sequence, 0U);
}

// Turns by `rate` about the vertical, in an attitude and an angular velocity that go together unless told otherwise.
class TurningRig : public ImuRig {
 public:
  TurningRig() {
    config.imu.contradiction = 0.2F;
    track();
  }
  void turn(int ticks, float rate, float told_rate) {
    go(ticks, [&](ImuSample& imu) {
      angle += rate * 1e-3F;
      imu.rotation[0] = std::cos(angle / 2);
      imu.rotation[3] = std::sin(angle / 2);
      imu.angular_velocity[2] = told_rate;
    });
  }
  float angle = 0;
};

TEST(ImuCauses, AnHonestImuMayTurnAsFastAsItSays) {
  TurningRig rig;
  for (const float rate : {3.0F, -5.0F, 0.5F}) {
    rig.turn(1500, rate, rate);  // more than one full turn: the quaternion's sign changes meanwhile
    ASSERT_EQ(rig.mode(), Mode::tracking) << rate;
    EXPECT_EQ(rig.header().imu_verdict, ImuVerdict::usable);
  }
  rig.turn(2000, 1.0F, 1.1F);  // a bias of 6 degrees a second is none of a lie
  EXPECT_EQ(rig.mode(), Mode::tracking);
}

TEST(ImuCauses, ARotationAgainstItsAngularVelocityStopsTheRobot) {
  struct Lie {
    const char* when;
    float rate, told_rate;
    int ticks;  // at most, until the stop
  };
  for (const Lie& lie : {Lie{"the attitude stands, the gyroscope turns", 0.0F, 2.0F, 120},
                         Lie{"the attitude turns, the gyroscope stands", 2.0F, 0.0F, 120},
                         Lie{"they turn against each other", 1.0F, -1.0F, 120}}) {
    SCOPED_TRACE(lie.when);
    TurningRig rig;
    int ticks = 0;
    while (rig.mode() == Mode::tracking && ticks < 500) {
      rig.turn(1, lie.rate, lie.told_rate);
      ++ticks;
    }
    EXPECT_EQ(rig.mode(), Mode::damped_stop);
    EXPECT_EQ(rig.header().cause, Cause::imu_lost);
    EXPECT_EQ(rig.header().imu_verdict, ImuVerdict::contradicts);
    EXPECT_LE(ticks, lie.ticks);
    EXPECT_GT(ticks, 100) << "0.2 rad apart at 2 rad/s";
    const std::uint64_t first_lie = rig.input.imu.sequence;
    rig.turn(40, lie.rate, lie.told_rate);
    EXPECT_LT(rig.out->observation.imu.sequence, first_lie) << "no observation shows what is not believed";
  }
}

TEST(ImuCauses, AnAttitudeThatJumpsIsALie) {
  TurningRig rig;
  rig.go(1, [](ImuSample& imu) { lean(imu, 0.3F); });
  EXPECT_EQ(rig.header().cause, Cause::imu_lost) << "in the tick that read it, and no tilt: nobody believes it";
}

// Replay starts anywhere: what is in force is part of the keyframe, and the record has what was read.
TEST(ImuWatch, KeyframeAndRecordCarryIt) {
  ImuRig rig;
  rig.track();
  std::vector<std::byte> bytes(160 * 1024);
  const std::size_t size = save(*rig.state, bytes);
  ASSERT_NE(size, 0U);
  TickStatePtr resumed = make_tick_state(rig.config);
  ASSERT_TRUE(load(*resumed, rig.config, std::span(bytes).first(size)));
  rig.silent = true;
  auto replayed = std::make_unique<TickOutput>();
  for (int i = 0; i < 60; ++i) {
    rig.silent = i > 20;
    if (!rig.silent) rig.sense();
    rig.tick();
    const TickInput input = input_of(rig.out->record, nullptr, 0);
    control_tick(*resumed, input, rig.config, *replayed);
    ASSERT_EQ(replayed->record.header.mode, rig.header().mode) << i;
    ASSERT_EQ(replayed->record.header.causes_active, rig.header().causes_active) << i;
    ASSERT_EQ(replayed->record.header.imu_verdict, rig.header().imu_verdict) << i;
  }
  EXPECT_NE(rig.header().causes_active & bit(Cause::imu_lost), 0U);
}

}  // namespace
}  // namespace takt::pipeline

// SPDX-License-Identifier: Apache-2.0
// Goal: a drive that tells what cannot be true of its joint is found within 50 ms and 0.1 rad of true motion, costs at
// most two slew steps of torque at the joint's true state, and never arms; a joint at rest, at its stop, held or behind
// a coarse encoder is believed. Method: the robot of rig.hpp, whose drives know the truth and whose replies the test
// writes over; every loop; a table of lies.
#include "executive/pipeline/joint_watch.hpp"

#include <gtest/gtest.h>

#include <algorithm>
#include <array>
#include <cmath>
#include <functional>
#include <limits>
#include <numbers>
#include <random>
#include <string>
#include <vector>

#include "executive/pipeline/tick_state.hpp"
#include "tests/executive/pipeline/rig.hpp"

namespace takt::pipeline {
namespace {

using testing::robot;

constexpr float kNaN = std::numeric_limits<float>::quiet_NaN();
constexpr std::size_t kLiar = 1;

// Rewrites what a drive told; `begun`: what it told when the lie began.
using Lie = std::function<void(JointFeedback& told, const JointFeedback& begun)>;

class LyingRig : public testing::Rig {
 public:
  explicit LyingRig(const TickConfig& robot_config) : Rig(robot_config) {}

  // A tick whose replies went through `lie`: the rig has the joint silent, and the test speaks for it.
  void go(float target, const Lie& lie = {}, OperatorRequest request = OperatorRequest::none) {
    Drive& drive = drives[kLiar];
    drive.silent = true;
    if (drive.asked) {
      JointFeedback& told = input.joints[kLiar];
      told.received_at = now + microseconds(700);
      ++told.replies;
      told.q = coarse > 0 ? std::round(drive.q / coarse) * coarse : drive.q;
      told.dq = drive.dq;
      told.tau = drive.tau;
      told.drive_state = drive.enabling_ticks >= 3 ? DriveState::enabled : DriveState::disabled;
      if (!lie) begun = told;
      if (lie) lie(told, begun);
    }
    tick_with_policy(target, request);
    if (hand) hand(drive);
  }
  bool track(float target) {
    for (int i = 0; i < 40; ++i) go(target);
    go(target, {}, OperatorRequest::arm);
    for (int i = 0; i < 60 && mode() != Mode::tracking; ++i) go(target);
    return mode() == Mode::tracking;
  }
  [[nodiscard]] ReplyFaultMask faults() const { return out->record.joints[kLiar].reply_faults; }
  [[nodiscard]] bool is_found() const { return (header().causes_active & bit(Cause::feedback_implausible)) != 0; }
  // Torque that the newest setpoint makes at the joint's true state.
  [[nodiscard]] float true_torque() const {
    const JointSetpoint& s = out->setpoints[kLiar];
    const Drive& drive = drives[kLiar];
    return s.kp * (s.q - drive.q) + s.kd * (s.dq - drive.dq) + s.tau;
  }

  float coarse = 0;                  // rad, of the joint's encoder
  std::function<void(Drive&)> hand;  // takes hold of the joint
  JointFeedback begun;
};

TickConfig robot_with(LoopAt loop, bool tells_velocity) {
  TickConfig config = robot(3);
  config.joints[kLiar].loop = loop;
  config.joints[kLiar].tells_velocity = tells_velocity;
  return config;
}

struct Told {
  const char* name;
  Lie lie;
};

void freeze_position(JointFeedback& told, const JointFeedback& begun) {
  told.q = begun.q;
}
void freeze_derived(JointFeedback& told, const JointFeedback& begun) {
  told.q = begun.q;
  told.dq = 0;
}
void repeat_all(JointFeedback& told, const JointFeedback& begun) {
  told.q = begun.q;
  told.dq = begun.dq;
  told.tau = begun.tau;
}

struct Loop {
  const char* name;
  LoopAt at;
  bool tells_velocity;
  Lie frozen;
};
const Loop kLoops[] = {
    {"drive", LoopAt::drive, true, freeze_position},
    {"drive_repeats", LoopAt::drive, true, repeat_all},
    {"host_torque", LoopAt::host_torque, true, freeze_position},
    {"host_torque_repeats", LoopAt::host_torque, true, repeat_all},
    {"host_torque_encoder", LoopAt::host_torque, true, freeze_derived},
    {"host_torque_without_velocity", LoopAt::host_torque, false, freeze_derived},
};

class FrozenFeedback : public ::testing::TestWithParam<Loop> {};

// At rest first, and in motion: the target goes on when the lie has begun.
TEST_P(FrozenFeedback, IsFoundBeforeTheJointGetsFar) {
  for (const bool moving : {false, true}) {
    LyingRig rig(robot_with(GetParam().at, GetParam().tells_velocity));
    ASSERT_TRUE(rig.track(0.1F));
    for (int i = 0; i < (moving ? 250 : 1500); ++i) rig.go(moving ? 0.6F : 0.1F);
    const float from = rig.drives[kLiar].q;
    int moved_for = 0;
    while (!rig.is_found() && rig.drives[kLiar].q - from < 0.2F && moved_for < 400) {
      rig.go(1.2F, GetParam().frozen);
      moved_for += std::abs(rig.drives[kLiar].q - from) > 0.02F ? 1 : 0;
    }
    EXPECT_TRUE(rig.is_found()) << moving;
    EXPECT_LE(std::abs(rig.drives[kLiar].q - from), 0.1F) << moving;
    EXPECT_LE(moved_for, 50) << moving;
    EXPECT_EQ(rig.mode(), Mode::fault_latched);
    EXPECT_EQ(rig.header().cause, Cause::feedback_implausible);
    EXPECT_FALSE(rig.out->drive_enabled[kLiar]);
    EXPECT_TRUE((rig.faults() & (bit(ReplyFault::frozen) | bit(ReplyFault::contradicts))) != 0);
  }
}

INSTANTIATE_TEST_SUITE_P(EveryLoop, FrozenFeedback, ::testing::ValuesIn(kLoops),
                         [](const auto& loop) { return std::string(loop.param.name); });

TEST(JointWatch, ScaleAndSignAreFoundOnceTheJointMoves) {
  const Told lies[] = {
      {"sign", [](JointFeedback& told, const JointFeedback&) { told.dq = -told.dq; }},
      {"half", [](JointFeedback& told, const JointFeedback&) { told.dq *= 0.5F; }},
      {"twice", [](JointFeedback& told, const JointFeedback&) { told.dq *= 2; }},
      {"no number", [](JointFeedback& told, const JointFeedback&) { told.dq = kNaN; }},
      {"says zero", [](JointFeedback& told, const JointFeedback&) { told.dq = 0; }},
  };
  for (const Told& told : lies) {
    LyingRig rig(robot_with(LoopAt::drive, true));
    ASSERT_TRUE(rig.track(0.0F)) << told.name;
    for (int i = 0; i < 300; ++i) rig.go(0.0F);
    const float from = rig.drives[kLiar].q;
    int ticks = 0;
    for (; !rig.is_found() && ticks < 1000; ++ticks) rig.go(1.0F, told.lie);
    EXPECT_TRUE(rig.is_found()) << told.name;
    EXPECT_LE(rig.drives[kLiar].q - from, 0.15F) << told.name;
  }
}

// One sample that is off by 0.3 rad, at rest, in motion, of a drive that closes its loop and of one that does not.
TEST(JointWatch, OneOutlierCostsNoMoreThanTwoSlewSteps) {
  for (const LoopAt loop : {LoopAt::drive, LoopAt::host_torque}) {
    for (const float off : {0.3F, -0.3F, 2 * std::numbers::pi_v<float>}) {
      LyingRig rig(robot_with(loop, true));
      const float slew = rig.config.joints[kLiar].limits.torque_rate * 0.001F;
      ASSERT_TRUE(rig.track(0.0F));
      for (int i = 0; i < 200; ++i) rig.go(0.6F);
      float before = rig.true_torque();
      for (int i = 0; i < 100; ++i) {
        const bool lies = i == 50;
        rig.go(0.6F, lies ? [off](JointFeedback& told, const JointFeedback&) { told.q += off; } : Lie{});
        const float after = rig.true_torque();
        EXPECT_LE(std::abs(after - before), 2 * slew) << i << " " << off;
        before = after;
        EXPECT_EQ((rig.faults() & bit(ReplyFault::outlier)) != 0, lies) << i;
        if (lies) {
          EXPECT_EQ(rig.out->setpoints[kLiar].kp, 0.0F) << "in doubt";
        }
        EXPECT_LT(std::abs(rig.out->record.joints[kLiar].q_estimate - rig.drives[kLiar].q), 0.02F) << i;
      }
      EXPECT_EQ(rig.mode(), Mode::tracking);
      EXPECT_EQ(rig.state->feedback[kLiar].outliers, 1U);
    }
  }
}

TEST(JointWatch, AJumpThatLastsStopsTheRobotAndMovesNothing) {
  for (const LoopAt loop : {LoopAt::drive, LoopAt::host_torque}) {
    for (const float off : {0.3F, -2 * std::numbers::pi_v<float>}) {
      LyingRig rig(robot_with(loop, true));
      const float slew = rig.config.joints[kLiar].limits.torque_rate * 0.001F;
      ASSERT_TRUE(rig.track(0.3F));
      for (int i = 0; i < 1500; ++i) rig.go(0.3F);
      const float from = rig.drives[kLiar].q;
      const float before = rig.true_torque();
      int ticks = 0;
      while (!rig.is_found() && ticks < 50) {
        rig.go(0.3F, [off](JointFeedback& told, const JointFeedback&) { told.q += off; });
        ++ticks;
        if (!rig.is_found()) {
          EXPECT_LE(std::abs(rig.true_torque() - before), 2 * slew);
        }
      }
      EXPECT_EQ(ticks, kLasting);
      EXPECT_EQ(rig.header().cause, Cause::feedback_implausible);
      EXPECT_FALSE(rig.out->drive_enabled[kLiar]);
      for (int i = 0; i < 1000; ++i) rig.go(0.3F, [off](JointFeedback& told, const JointFeedback&) { told.q += off; });
      EXPECT_LT(std::abs(rig.drives[kLiar].q - from), 0.01F);
      EXPECT_FALSE(rig.is_found()) << "the new position holds, and nothing contradicts it any more";
    }
  }
}

TEST(JointWatch, PositionsThatAlternateAreNoSingleOutliers) {
  LyingRig rig(robot_with(LoopAt::drive, true));
  ASSERT_TRUE(rig.track(0.0F));
  int ticks = 0;
  for (; ticks < 100 && !rig.is_found(); ++ticks)
    rig.go(0.0F, [ticks](JointFeedback& told, const JointFeedback&) { told.q += ticks % 2 == 0 ? 0.5F : 0.0F; });
  EXPECT_LE(ticks, 12);
  EXPECT_EQ(rig.mode(), Mode::fault_latched);
}

// Its stamps lie ahead: each reply is the newest for ever.
TEST(JointWatch, AReplyOfTheFutureKeepsNoSilentJointAlive) {
  LyingRig rig(robot_with(LoopAt::drive, true));
  ASSERT_TRUE(rig.track(0.0F));
  const Lie ahead = [&rig](JointFeedback& told, const JointFeedback&) { told.received_at = rig.now + seconds(5); };
  rig.go(0.0F, ahead);
  EXPECT_NE(rig.faults() & bit(ReplyFault::from_future), 0);
  rig.drives[kLiar].asked = false;
  for (int i = 0; i < 30; ++i) {
    rig.drives[kLiar].asked = false;
    rig.go(0.0F);
  }
  EXPECT_EQ(rig.mode(), Mode::fault_latched);
  EXPECT_NE(rig.header().causes_active & bit(Cause::feedback_lost), 0U);
  EXPECT_FALSE(rig.out->drive_enabled[kLiar]);
}

TEST(JointWatch, ARobotWhoseFeedbackLiesIsNotArmed) {
  LyingRig rig(robot_with(LoopAt::drive, true));
  int slid = 0;
  const Lie turned = [&slid](JointFeedback& told, const JointFeedback&) {
    told.q = 0.001F * static_cast<float>(++slid % 200);  // moved by hand
    told.dq = -1;
  };
  for (int i = 0; i < 120; ++i) rig.go(0.0F, turned);
  EXPECT_TRUE(rig.is_found());
  EXPECT_EQ(rig.mode(), Mode::standby);
  std::array<ArmingBlocker, 16> blockers;
  const std::size_t count = arming_blockers(rig.out->record, rig.config, blockers);
  ASSERT_EQ(count, 1U);
  EXPECT_EQ(blockers[0].what, "its positions contradict the drive's own velocity: check sign and scale");
  EXPECT_EQ(blockers[0].joint, static_cast<std::int32_t>(kLiar));
  rig.go(0.0F, turned, OperatorRequest::arm);
  EXPECT_EQ(rig.mode(), Mode::standby);
}

TEST(JointWatch, ResetWaitsUntilTheFeedbackIsPlausible) {
  LyingRig rig(robot_with(LoopAt::drive, true));
  ASSERT_TRUE(rig.track(0.0F));
  for (int i = 0; i < 20 && !rig.is_found(); ++i)
    rig.go(0.0F, [i](JointFeedback& told, const JointFeedback&) { told.q += i % 2 == 0 ? 0.5F : 0.0F; });
  ASSERT_EQ(rig.mode(), Mode::fault_latched);
  for (int i = 0; i < 300; ++i) rig.go(0.0F);
  rig.go(0.0F, {}, OperatorRequest::reset);
  EXPECT_EQ(rig.mode(), Mode::fault_latched);
  for (int i = 0; i < 300; ++i) rig.go(0.0F);
  rig.go(0.0F, {}, OperatorRequest::reset);
  EXPECT_EQ(rig.mode(), Mode::standby);
}

struct Honest {
  const char* name;
  float coarse;
  float target;
  std::function<void(testing::Rig::Drive&)> hand;
};

// True replies, whatever the joint goes through. The hand yields as much as a stiff gear does.
TEST(JointWatch, AnHonestDriveIsBelieved) {
  using Drive = testing::Rig::Drive;
  const auto held = [](float at, float stiffness) {
    return [=](Drive& drive) {
      drive.q = at + drive.tau / stiffness;
      drive.dq = 0;
    };
  };
  const auto stop = [](Drive& drive) {
    if (drive.q < 1.46F) return;
    drive.q = 1.46F;
    drive.dq = std::min(drive.dq, 0.0F);
  };
  const Honest table[] = {
      {"moves", 0, 1.0F, {}},
      {"coarse encoder", 0.005F, 1.0F, {}},
      {"held in the air", 0.0004F, 1.0F, held(0.4F, 10'000)},
      {"held at rest", 0.0004F, 0.4F, held(0.4F, 10'000)},
      {"against its stop", 0.0004F, 1.6F, stop},
  };
  for (const Loop& loop : kLoops) {
    for (const Honest& honest : table) {
      LyingRig rig(robot_with(loop.at, loop.tells_velocity));
      rig.coarse = honest.coarse;
      ASSERT_TRUE(rig.track(0.4F));
      for (int i = 0; i < 2000; ++i) {
        if (i == 300) rig.hand = honest.hand;
        rig.go(i < 300 ? 0.4F : (i / 500) % 2 == 0 ? honest.target : -honest.target);
        ASSERT_FALSE(rig.is_found()) << loop.name << ", " << honest.name << ", tick " << i << ": "
                                     << static_cast<int>(rig.faults());
        ASSERT_EQ(rig.state->feedback[kLiar].outliers, 0U) << loop.name << ", " << honest.name << ", tick " << i;
      }
    }
  }
}

// A drive that is written to every fifth tick, loses replies, and one that was silent while its joint went on.
TEST(JointWatch, AGapWidensWhatIsBelieved) {
  TickConfig config = robot_with(LoopAt::drive, true);
  config.joints[kLiar].turns = {5, 0};
  config.feedback_timeout = milliseconds(100);
  config.bus_faults.replies_lost = kWholeShare;
  LyingRig rig(config);
  ASSERT_TRUE(rig.track(0.0F));
  for (int i = 0; i < 2000; ++i) {
    if (i % 7 == 0) rig.drives[kLiar].asked = false;
    rig.go((i / 400) % 2 == 0 ? 1.2F : -1.2F);
    ASSERT_FALSE(rig.is_found()) << i;
    ASSERT_EQ(rig.state->feedback[kLiar].outliers, 0U) << i;
  }
  for (int i = 0; i < 150; ++i) {
    rig.drives[kLiar].asked = false;
    rig.go(0.0F);
  }
  ASSERT_EQ(rig.header().cause, Cause::none);
  rig.drives[kLiar].q += 1;
  rig.drives[kLiar].asked = true;
  rig.go(0.0F);
  EXPECT_FALSE(rig.is_found()) << "after a silence it begins anew";
}

TEST(JointWatch, ASuspendForgetsWhereTheJointWas) {
  LyingRig rig(robot_with(LoopAt::drive, true));
  for (int i = 0; i < 100; ++i) rig.go(0.0F);
  rig.drives[kLiar].q = 1.2F;
  rig.input.slept_ms = 60'000;
  rig.go(0.0F);
  rig.input.slept_ms = 0;
  for (int i = 0; i < 20; ++i) {
    rig.go(0.0F);
    EXPECT_FALSE(rig.is_found()) << i;
  }
  EXPECT_EQ(rig.state->feedback[kLiar].outliers, 0U);
  EXPECT_NE(rig.faults() & bit(ReplyFault::moved_unheard), 0) << "its drive may have been without supply";
}

std::vector<std::string> why_not_armed(const testing::Rig& rig) {
  std::array<ArmingBlocker, 16> blockers;
  const std::size_t count = arming_blockers(rig.out->record, rig.config, blockers);
  std::vector<std::string> said;
  for (std::size_t i = 0; i < count; ++i) said.emplace_back(blockers[i].what);
  return said;
}

// The drive is silent for `ticks` while the joint goes to `q`, then replies again.
void fall_silent(LyingRig& rig, int ticks, float q) {
  for (int i = 0; i < ticks; ++i) {
    rig.drives[kLiar].asked = false;
    rig.go(0.0F);
  }
  rig.drives[kLiar].q = q;
  rig.drives[kLiar].dq = 0;
  rig.drives[kLiar].asked = true;
  for (int i = 0; i < 120; ++i) rig.go(0.0F);
}

TEST(JointWatch, AJointThatReadsElsewhereAfterASilenceIsNotArmedBeforeAPersonLooked) {
  for (const float q : {0.06F, -0.4F, 2.0F * std::numbers::pi_v<float>}) {
    LyingRig rig(robot_with(LoopAt::drive, true));
    rig.config.joints[kLiar].limits.q_min = -7;
    rig.config.joints[kLiar].limits.q_max = 7;
    for (int i = 0; i < 120; ++i) rig.go(0.0F);
    ASSERT_TRUE(why_not_armed(rig).empty());
    fall_silent(rig, 60, q);
    ASSERT_EQ(why_not_armed(rig).size(), 1U) << q;
    EXPECT_NE(why_not_armed(rig)[0].find("it reads elsewhere than before its drive fell silent"), std::string::npos);
    rig.go(0.0F, {}, OperatorRequest::arm);
    EXPECT_EQ(rig.mode(), Mode::standby) << q;
    rig.go(0.0F, {}, OperatorRequest::reset);
    EXPECT_TRUE(why_not_armed(rig).empty()) << q;
  }
}

TEST(JointWatch, TheResetThatEndsAStopDoesNotAcceptWhereAJointReads) {
  LyingRig rig(robot_with(LoopAt::drive, true));
  ASSERT_TRUE(rig.track(0.0F));
  fall_silent(rig, 100, 0.5F);
  ASSERT_EQ(rig.mode(), Mode::fault_latched);
  for (int i = 0; i < 500; ++i) rig.go(0.0F);
  rig.go(0.0F, {}, OperatorRequest::reset);
  ASSERT_EQ(rig.mode(), Mode::standby);
  for (int i = 0; i < 20; ++i) rig.go(0.0F);
  EXPECT_NE(rig.faults() & bit(ReplyFault::moved_unheard), 0);
}

TEST(JointWatch, AShortSilenceAndASmallMoveAreNoQuestion) {
  for (const auto& [ticks, q] : {std::pair{40, 0.3F}, std::pair{60, 0.04F}}) {
    LyingRig rig(robot_with(LoopAt::drive, true));
    for (int i = 0; i < 120; ++i) rig.go(0.0F);
    fall_silent(rig, ticks, q);
    EXPECT_EQ(rig.faults() & bit(ReplyFault::moved_unheard), 0) << ticks << ' ' << q;
  }
}

// Goal: a joint that begins anew gets the whole of `frozen_after`: what it did before its silence counts no more.
// Method: replies by hand; still for long, a silence, and then torque that would move it within a few ticks.
TEST(JointWatch, AfterASilenceAJointMayStandStillAnew) {
  TickConfig config = robot_with(LoopAt::host_torque, false);
  JointConfig& joint = config.joints[kLiar];
  joint.inertia = 0.01F;
  JointWatch watch;
  MonoTime now{1'000'000'000};
  const auto hear = [&](float torque) {
    JointFeedback feedback;
    feedback.received_at = now;
    feedback.drive_state = DriveState::enabled;
    take_feedback(watch, feedback, now, joint, config);
    JointSetpoint told;
    told.tau = torque;
    note_told(watch, told, 0, 0, joint);
    now = now + config.period;
    return (feedback_faults(watch, feedback, now, config) & bit(ReplyFault::frozen)) != 0;
  };
  for (int i = 0; i < 1000; ++i) ASSERT_FALSE(hear(0));
  now = now + config.feedback_timeout + config.period;
  ASSERT_FALSE(hear(0));
  const float torque = 0.8F * joint.limits.torque;
  const MonoTime from = now;
  while (now - from < seconds(1) && !hear(torque)) {
  }
  EXPECT_GE(now - from, config.feedback.frozen_after);
  EXPECT_LE(now - from, config.feedback.frozen_after + milliseconds(5)) << "and no longer";
}

// Goal: of a joint whose inertia is not known (no model) no motion is expected, so none is missed.
// Method: a hand that holds it against torque that swings further than friction holds.
TEST(JointWatch, WithoutAnInertiaNoMotionIsExpected) {
  TickConfig config = robot_with(LoopAt::host_torque, false);
  JointConfig& joint = config.joints[kLiar];
  joint.inertia = joint.inertia_max = 0;
  JointWatch watch;
  MonoTime now{1'000'000'000};
  for (int i = 0; i < 1000; ++i, now = now + config.period) {
    JointFeedback feedback;
    feedback.received_at = now;
    feedback.drive_state = DriveState::enabled;
    take_feedback(watch, feedback, now, joint, config);
    JointSetpoint told;
    told.tau = 0.8F * joint.limits.torque;
    note_told(watch, told, 0, 0, joint);
    ASSERT_EQ(feedback_faults(watch, feedback, now, config), 0) << i;
  }
}

TEST(JointWatch, EachWatchCanBeSwitchedOff) {
  TickConfig config = robot_with(LoopAt::drive, true);
  config.feedback = {0, 0, {}};
  LyingRig rig(config);
  ASSERT_TRUE(rig.track(0.0F));
  for (int i = 0; i < 60; ++i) {
    rig.go(0.6F, [](JointFeedback& told, const JointFeedback& begun) { told.q = begun.q + 0.3F, told.dq = -1; });
    ASSERT_FALSE(rig.is_found()) << i;
  }
}

// Goal: a robot that was released, and whose brakes hold it, is no robot whose encoders froze. Method: an arm that
// gravity pulls at, held by brakes as soon as its drives have no power; for longer than any watch looks.
TEST(JointWatch, ABrakeThatHoldsAJointWithoutPowerIsNoFrozenEncoder) {
  for (const LoopAt loop : {LoopAt::drive, LoopAt::host_torque}) {
    TickConfig config = testing::robot(3);
    config.gravity_compensation = true;
    for (JointConfig& joint : config.joints) joint.loop = loop;
    testing::Rig rig(config);
    rig.arm(0.6F);
    rig.run_with_policy(1500, 0.6F);
    ASSERT_EQ(rig.mode(), Mode::tracking);
    rig.tick(nullptr, OperatorRequest::deenergise);
    for (int i = 0; i < 3000; ++i) {
      rig.tick();
      ASSERT_EQ(rig.header().causes_active & bit(Cause::feedback_implausible), 0U)
          << "loop " << static_cast<int>(loop) << ", tick " << i;
    }
  }
}

// --- to and fro: what goes back again adds up to nothing ---

struct Swing {
  const char* name;
  double amplitude, frequency;  // rad, Hz
  double scale;                 // of the positions that are told
  double velocity_noise;        // rad/s, evenly spread
  double encoder;               // rad per step
  double filter;                // s, of the velocity; 0: none
  bool is_wrong;
};
const Swing kSwings[] = {
    {"reversed, fast and short", 0.03, 5, -1, 0, 0, 0, true},
    {"half as much again", 0.03, 5, 1.5, 0, 0, 0, true},
    {"half of it", 0.03, 5, 0.5, 0, 0, 0, true},
    {"reversed, coarse and noisy", 0.05, 3, -1, 0.3, 0.0015, 0.005, true},
    {"a sixth too much", 0.03, 5, 1.17, 0, 0, 0, false},
    {"coarse, noisy and filtered", 0.05, 5, 1, 0.5, 0.0015, 0.02, false},
    {"slow and coarse", 0.2, 0.3, 1, 0.3, 0.0015, 0.02, false},
    {"at rest, and a noisy velocity", 0, 1, 1, 1.0, 0.0015, 0, false},
};

TEST(JointWatch, AJointThatGoesToAndFroIsHeldAgainstTheSlope) {
  const TickConfig config = robot_with(LoopAt::drive, true);
  const JointConfig& joint = config.joints[kLiar];
  for (const Swing& swing : kSwings) {
    JointWatch watch;
    std::mt19937 random(3);
    std::uniform_real_distribution<double> noise(-swing.velocity_noise, swing.velocity_noise);
    double filtered = 0, went = 0;
    bool is_found = false;
    for (int i = 0; i < 4000 && !is_found; ++i) {
      const double t = 1e-3 * i, phase = 2 * std::numbers::pi * swing.frequency * t;
      const double q = swing.amplitude * std::sin(phase);
      const double dq = 2 * std::numbers::pi * swing.frequency * swing.amplitude * std::cos(phase);
      filtered += swing.filter > 0 ? (dq - filtered) * 1e-3 / swing.filter : dq - filtered;
      const double wrong = i < 1000 ? q : swing.scale * q;  // true at first; it begins where both agree
      JointFeedback told;
      told.received_at = MonoTime{1'000'000'000 + std::int64_t{i} * 1'000'000};
      told.q = static_cast<float>(swing.encoder > 0 ? std::round(wrong / swing.encoder) * swing.encoder : wrong);
      told.dq = static_cast<float>(filtered + noise(random));
      told.tau = static_cast<float>(i % 7);
      take_feedback(watch, told, told.received_at, joint, config);
      is_found = (feedback_faults(watch, told, told.received_at, config) & bit(ReplyFault::contradicts)) != 0;
      if (i >= 1000) went += std::abs(dq) * 1e-3;
    }
    EXPECT_EQ(is_found, swing.is_wrong) << swing.name;
    if (swing.is_wrong) {
      EXPECT_LT(went, 0.7) << swing.name << ": rad to and fro until it is found";
    }
    EXPECT_TRUE(swing.is_wrong || margin_of(watch, joint, config).contradiction < 1.0F) << swing.name;
  }
}

// A machine, an adapter or a drive that stood still answers at last with what it read before, and is in time again with
// the next reply: between these two the joint moves for the whole of the stall in one period.
// Method: the knee of a walker, truly told, with a stall of 20 ms every 60 ms.
TEST(JointWatch, AReplyThatWaitedBehindAStallContradictsNothing) {
  const TickConfig config = robot_with(LoopAt::drive, true);
  const JointConfig& joint = config.joints[kLiar];
  constexpr int kEvery = 60, kStall = 20;  // ms
  JointWatch watch;
  float largest = 0;
  for (int i = 0; i < 10'000; ++i) {
    const int in_stall = i % kEvery - (kEvery - kStall);  // < 0: in time
    if (in_stall >= 0 && in_stall < kStall - 1) continue;
    const double t = 1e-3 * (in_stall == kStall - 1 ? i - kStall : i);  // when it was read
    const double phase = 2 * std::numbers::pi * 2 * t;
    JointFeedback told;
    told.received_at = MonoTime{1'000'000'000 + std::int64_t{i} * 1'000'000};
    told.q = static_cast<float>(0.4 * std::sin(phase));
    told.dq = static_cast<float>(2 * std::numbers::pi * 2 * 0.4 * std::cos(phase));
    told.tau = static_cast<float>(i % 7);
    take_feedback(watch, told, told.received_at, joint, config);
    ASSERT_EQ(feedback_faults(watch, told, told.received_at, config) & kImplausible, 0) << "after " << i << " ms";
    largest = std::max(largest, margin_of(watch, joint, config).contradiction);
  }
  EXPECT_LT(largest, 0.5F) << "of what would be a contradiction";
}

}  // namespace
}  // namespace takt::pipeline

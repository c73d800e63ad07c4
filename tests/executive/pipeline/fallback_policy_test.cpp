// SPDX-License-Identifier: Apache-2.0
// Goal: a second policy that is kept warm takes over in time when the first is lost, hands back when it returns, never
// makes the reference jump, never moves the robot by an old command, and every tick says who moved it. Method: the
// rig's robot in virtual time with two policies that answer each observation, each told when to be silent and what to
// want; limits of the reference checked at every tick, for every join rule.
#include <gtest/gtest.h>

#include <algorithm>
#include <cmath>
#include <cstring>
#include <limits>
#include <memory>
#include <random>
#include <vector>

#include "executive/ipc/executive_segments.hpp"
#include "executive/pipeline/mode_machine.hpp"
#include "tests/executive/pipeline/rig.hpp"

namespace takt::pipeline {
namespace {

using testing::chunk_for;
using testing::Rig;

constexpr std::uint64_t kFallbackHash = 0xFA11;

TickConfig robot_with_fallback(std::uint32_t joints = 3) {
  TickConfig config = testing::robot(joints);
  config.degraded = DegradedBehaviour::fallback;
  config.fallback = FallbackKind::policy;
  config.fallback_policy.hash = kFallbackHash;
  config.freshness.recover_after = milliseconds(100);
  return config;
}

// Both policies answer every observation in the tick after it, unless they are silent.
struct TwoPolicies {
  explicit TwoPolicies(const TickConfig& config) : rig(config) {}

  const TickOutput& tick(OperatorRequest request = OperatorRequest::none) {
    rig.input.messages[Seat::fallback].mailbox = Arrival::none;
    rig.input.messages[Seat::fallback].command = nullptr;
    const bool due = rig.newest_observation != 0 && rig.out->observation_due;
    if (due && fallback_speaks) {
      *second = chunk_for(rig.config, rig.newest_observation, rig.published_at[rig.newest_observation], rig.now,
                          ++sequence, fallback_wants);
      second->header.policy_hash = fallback_hash;
      rig.input.messages[Seat::fallback].mailbox = Arrival::accepted;
      rig.input.messages[Seat::fallback].command = second.get();
      rig.input.messages[Seat::fallback].bytes = second->used_bytes();
    }
    return policy_speaks ? rig.tick_with_policy(policy_wants, request) : rig.tick(nullptr, request);
  }
  void run(int ticks) {
    for (int i = 0; i < ticks; ++i) tick();
  }
  // Ticks until `mode`, at most `most`.
  int run_until(Mode mode, int most) {
    for (int i = 0; i < most; ++i) {
      if (rig.mode() == mode) return i;
      tick();
    }
    return rig.mode() == mode ? most : -1;
  }
  void arm() {
    run(40);
    tick(OperatorRequest::arm);
    ASSERT_GE(run_until(Mode::tracking, 60), 0);
  }
  [[nodiscard]] const TickRecordHeader& header() const { return rig.header(); }

  Rig rig;
  bool policy_speaks = true, fallback_speaks = true;
  float policy_wants = 0.4F, fallback_wants = -0.4F;
  std::uint64_t fallback_hash = kFallbackHash, sequence = 0;
  std::unique_ptr<CommandChunk> second = std::make_unique<CommandChunk>();
};

std::vector<std::string_view> blockers_of(const Rig& rig) {
  std::array<ArmingBlocker, 16> found;
  const std::size_t count = arming_blockers(rig.out->record, rig.config, found);
  std::vector<std::string_view> sentences;
  for (std::size_t i = 0; i < count; ++i) sentences.push_back(found[i].what);
  return sentences;
}

TEST(FallbackPolicy, NobodyArmsWhileItIsNotFresh) {
  TwoPolicies two(robot_with_fallback());
  two.fallback_speaks = false;
  two.run(60);
  ASSERT_EQ(blockers_of(two.rig).size(), 1U);
  EXPECT_NE(blockers_of(two.rig)[0].find("fallback policy: is its host running"), std::string_view::npos);
  two.tick(OperatorRequest::arm);
  EXPECT_EQ(two.rig.mode(), Mode::standby);

  two.fallback_speaks = true;
  two.fallback_hash = 1;
  two.run(60);
  ASSERT_EQ(blockers_of(two.rig).size(), 1U);
  EXPECT_NE(blockers_of(two.rig)[0].find("another policy's"), std::string_view::npos);
  EXPECT_EQ(two.header().seats[Seat::fallback].last_refusal, Arrival::wrong_policy);
  EXPECT_EQ(two.header().seats[Seat::policy].freshness, Freshness::fresh)
      << "the policy's own command is not the fallback's";

  two.fallback_hash = kFallbackHash;
  two.run(40);
  EXPECT_TRUE(blockers_of(two.rig).empty());
  two.tick(OperatorRequest::arm);
  EXPECT_EQ(two.rig.mode(), Mode::arming);
}

TEST(FallbackPolicy, TakesOverWithinTheBoundAndHandsBack) {
  TwoPolicies two(robot_with_fallback());
  two.arm();
  two.run(500);
  ASSERT_EQ(two.header().player, Player::policy);
  ASSERT_NEAR(two.rig.out->record.joints[0].q_reference, 0.4F, 0.01F);

  two.policy_speaks = false;
  const MonoTime silent = two.rig.now;
  ASSERT_GE(two.run_until(Mode::degraded, 400), 0);
  const FreshnessContract& contract = two.rig.config.freshness;
  const Duration bound =
      contract.max_age + milliseconds(static_cast<std::int64_t>(contract.epsilon * contract.window_ticks) + 2);
  EXPECT_LE(two.rig.now - silent, bound);
  EXPECT_EQ(two.header().player, Player::fallback) << "in the very tick that notices";
  two.run(3000);
  EXPECT_EQ(two.rig.mode(), Mode::degraded) << "the policy's loss stops nobody while the fallback plays";
  EXPECT_EQ(two.header().player, Player::fallback);
  EXPECT_NEAR(two.rig.out->record.joints[0].q_reference, -0.4F, 0.01F);

  two.policy_speaks = true;
  ASSERT_GE(two.run_until(Mode::tracking, 400), 0);
  EXPECT_EQ(two.header().cause, Cause::contract_restored);
  EXPECT_EQ(two.header().player, Player::policy);
  two.run(1500);
  EXPECT_NEAR(two.rig.out->record.joints[0].q_reference, 0.4F, 0.01F);
}

TEST(FallbackPolicy, DegradeAfterReachesWhatTheWindowsShareCannot) {
  TickConfig config = robot_with_fallback();
  config.freshness.epsilon = 0.4;  // of a second
  config.freshness.degrade_after = milliseconds(30);
  TwoPolicies two(config);
  two.arm();
  two.run(200);
  two.policy_speaks = false;
  const MonoTime silent = two.rig.now;
  ASSERT_GE(two.run_until(Mode::degraded, 400), 0);
  EXPECT_LE(two.rig.now - silent, config.freshness.max_age + milliseconds(31));
}

TEST(FallbackPolicy, BothLostIsCommandLost) {
  TwoPolicies two(robot_with_fallback());
  two.arm();
  two.run(200);
  two.policy_speaks = false;
  ASSERT_GE(two.run_until(Mode::degraded, 400), 0);
  two.run(700);
  ASSERT_EQ(two.rig.mode(), Mode::degraded);
  two.fallback_speaks = false;
  const MonoTime silent = two.rig.now;
  ASSERT_GE(two.run_until(Mode::damped_stop, 700), 0);
  EXPECT_EQ(two.header().cause, Cause::command_lost);
  const FreshnessContract& contract = two.rig.config.freshness;
  EXPECT_LE(two.rig.now - silent, contract.max_age + contract.stop_after + milliseconds(1));
  EXPECT_EQ(two.header().player, Player::none);
}

TEST(FallbackPolicy, LostWhileThePolicyMovesTheRobotChangesNothing) {
  TwoPolicies two(robot_with_fallback());
  two.arm();
  two.fallback_speaks = false;
  two.run(1500);
  EXPECT_EQ(two.rig.mode(), Mode::tracking);
  EXPECT_EQ(two.header().player, Player::policy);
  EXPECT_EQ(two.header().seats[Seat::fallback].freshness, Freshness::stale);
}

TEST(FallbackPolicy, ThePolicyThatIsBackPlaysWhereTheFallbackHasNothingToSay) {
  TickConfig config = robot_with_fallback();
  config.freshness.recover_after = seconds(2);
  TwoPolicies two(config);
  two.arm();
  two.run(200);
  two.policy_speaks = false;
  ASSERT_GE(two.run_until(Mode::degraded, 400), 0);
  two.policy_speaks = true;
  two.fallback_speaks = false;
  two.run(200);
  EXPECT_EQ(two.rig.mode(), Mode::degraded);
  EXPECT_EQ(two.header().player, Player::policy);
}

TEST(FallbackPolicy, MayPlayForSoLongAndNoLonger) {
  TickConfig config = robot_with_fallback();
  config.fallback_longest = milliseconds(800);
  TwoPolicies two(config);
  two.arm();
  two.run(200);
  two.policy_speaks = false;
  ASSERT_GE(two.run_until(Mode::degraded, 400), 0);
  const MonoTime took_over = two.rig.now;
  ASSERT_GE(two.run_until(Mode::damped_stop, 900), 0);
  EXPECT_EQ(two.header().cause, Cause::fallback_spent);
  EXPECT_EQ(two.rig.now - took_over, config.fallback_longest);
}

TEST(FallbackPolicy, ItsTimeCountsAtOneGo) {
  TickConfig config = robot_with_fallback();
  config.fallback_longest = milliseconds(800);
  TwoPolicies two(config);
  two.arm();
  for (int i = 0; i < 3; ++i) {
    two.policy_speaks = false;
    ASSERT_GE(two.run_until(Mode::degraded, 400), 0);
    two.run(300);
    two.policy_speaks = true;
    ASSERT_GE(two.run_until(Mode::tracking, 450), 0) << "relapse " << i;
    two.run(900);
    EXPECT_EQ(two.header().causes_active & bit(Cause::fallback_spent), 0U);
  }
  EXPECT_EQ(two.rig.mode(), Mode::tracking);
}

TEST(FallbackPolicy, WhereTheContractNeverBreaksThePolicysLossStopsTheRobot) {
  TickConfig config = robot_with_fallback();
  config.freshness.epsilon = 1;
  TwoPolicies two(config);
  two.arm();
  two.policy_speaks = false;
  ASSERT_GE(two.run_until(Mode::damped_stop, 700), 0);
  EXPECT_EQ(two.header().cause, Cause::command_lost);
}

// Goal: the policy that comes back may want a pose far from the fallback's, and is approached by the ramp. Method:
// targets far apart, a long ramp at a crawl; the fastest reference after the hand-over, against the same without a
// ramp.
float fastest_after_hand_back(Duration resume_over) {
  TickConfig config = robot_with_fallback();
  config.degraded_speed_scale = 0.05F;
  config.resume_over = resume_over;
  TwoPolicies two(config);
  two.arm();
  two.run(4000);
  two.policy_speaks = false;
  EXPECT_GE(two.run_until(Mode::degraded, 400), 0);
  two.run(1500);
  two.policy_speaks = true;
  EXPECT_GE(two.run_until(Mode::tracking, 400), 0);
  float fastest = 0;
  for (int i = 0; i < 300; ++i) {
    two.tick();
    fastest = std::max(fastest, std::abs(two.rig.out->record.joints[0].dq_reference));
  }
  return fastest;
}

TEST(FallbackPolicy, HandingBackGoesByTheRamp) {
  const float velocity = robot_with_fallback().joints[0].limits.velocity;
  EXPECT_LE(fastest_after_hand_back(seconds(2)), (0.05F + 0.95F * 0.15F) * velocity + 1e-3F);
  EXPECT_GT(fastest_after_hand_back({}), 0.3F * velocity) << "0: at full speed at once";
}

TEST(FallbackPolicy, AnotherHostStartsItsSequencesOver) {
  TwoPolicies two(robot_with_fallback());
  two.arm();
  two.run(100);
  two.sequence = 0;
  two.run(25);
  EXPECT_EQ(two.header().seats[Seat::fallback].last_refusal, Arrival::repeated_sequence);
  ++two.rig.input.messages[Seat::fallback].session;
  two.run(25);
  EXPECT_EQ(two.header().seats[Seat::fallback].last_refusal, Arrival::none);
  EXPECT_EQ(two.header().seats[Seat::fallback].freshness, Freshness::fresh);
}

// What a tick's frames carry is never older than max_age, whichever policy plays, and lives no longer than that.
void check_age(const TickRecordHeader& header, const TickOutput& out, const TickConfig& config) {
  if (header.player == Player::none) return;
  const bool is_fallback = header.player == Player::fallback;
  const Duration age = is_fallback ? header.seats[Seat::fallback].age : header.age.total();
  ASSERT_LE(age, config.freshness.max_age);
  ASSERT_LE(out.valid_until, header.now - age + config.freshness.max_age);
}

// Goal: handing over and back keeps position, velocity and acceleration of the reference inside the limits, and the
// velocity continuous. Method: for every join rule 40 handovers at random instants between policies that want opposite
// things, each tick against the one before.
TEST(FallbackPolicy, HandingOverNeverMakesTheReferenceJump) {
  std::mt19937 random(7);
  for (const JoinKind kind : {JoinKind::replace, JoinKind::cross_fade, JoinKind::prefix}) {
    TickConfig config = robot_with_fallback();
    config.join = {.kind = kind, .over = milliseconds(60), .longest_delay = milliseconds(10)};
    config.freshness.flap_memory = {};
    TwoPolicies two(config);
    two.arm();
    int handovers = 0;
    Player before = Player::policy;
    std::array<JointRecord, 3> last{};
    std::copy_n(two.rig.out->record.joints, 3, last.begin());
    for (int i = 0; i < 60'000 && handovers < 40; ++i) {
      if (random() % 400 == 0) two.policy_speaks = !two.policy_speaks;
      if (random() % 60 == 0) two.policy_wants = static_cast<float>(random() % 200) * 0.01F - 1.0F;
      if (random() % 60 == 0) two.fallback_wants = static_cast<float>(random() % 200) * 0.01F - 1.0F;
      const TickOutput& out = two.tick();
      check_age(two.header(), out, config);
      if (::testing::Test::HasFatalFailure()) return;
      const Player player = two.header().player;
      if (player != Player::none && player != before) ++handovers, before = player;
      for (std::size_t j = 0; j < 3; ++j) {
        const JointRecord& joint = out.record.joints[j];
        const JointLimits& limits = config.joints[j].limits;
        const float dt = 0.001F;
        ASSERT_LE(std::abs(joint.dq_reference), limits.velocity * 1.0001F);
        ASSERT_LE(std::abs(joint.dq_reference - last[j].dq_reference), limits.acceleration * dt * 1.01F + 1e-5F)
            << "join " << static_cast<int>(kind) << " tick " << i;
        ASSERT_LE(std::abs(joint.q_reference - last[j].q_reference), limits.velocity * dt * 1.01F + 1e-6F);
        last[j] = joint;
      }
    }
    EXPECT_GE(handovers, 40) << "join " << static_cast<int>(kind);
    EXPECT_NE(two.rig.mode(), Mode::damped_stop);
  }
}

// Goal: with cross_fade the policy that takes over leads the robot from where its reference is, either way. Method: two
// policies that want opposite things and a fade of 1 s, which asks for some 1.2 rad/s over 0.8 rad; the limits allow 3.
TEST(FallbackPolicy, ATakeoverFadesFromTheReference) {
  TickConfig config = robot_with_fallback();
  config.join = {.kind = JoinKind::cross_fade, .over = seconds(1)};
  config.degraded_speed_scale = 1.0F;
  config.resume_over = {};
  TwoPolicies two(config);
  two.arm();
  two.run(3000);
  for (const bool policy_speaks : {false, true}) {
    two.policy_speaks = policy_speaks;
    const Player next = policy_speaks ? Player::policy : Player::fallback;
    for (int i = 0; i < 400 && two.header().player != next; ++i) two.tick();
    ASSERT_EQ(two.header().player, next);
    const float from = two.rig.out->record.joints[0].q_reference;
    ASSERT_NEAR(from, policy_speaks ? -0.4F : 0.4F, 0.05F);
    float fastest = 0.0F;
    for (int i = 0; i < 3000; ++i) {
      two.tick();
      fastest = std::max(fastest, std::abs(two.rig.out->record.joints[0].dq_reference));
    }
    EXPECT_LE(fastest, 1.5F) << (policy_speaks ? "back to the policy" : "to the fallback");
    EXPECT_NEAR(two.rig.out->record.joints[0].q_reference, -from, 0.05F) << "and gets there";
  }
}

// Goal: a damped stop may be the fallback policy's, so that a robot that stands by its policies does not fall because a
// person, or the policy's nonsense, stops it. Method: stops with that manner for 500 ms; limits of the reference in
// every tick.
class StopByPolicy : public ::testing::Test {
 protected:
  static TickConfig stopping_robot(Cause cause) {
    TickConfig config = robot_with_fallback();
    config.stops[static_cast<std::size_t>(cause)] = {StopManner::policy, milliseconds(500)};
    config.freshness.bad_command_limit = 4;
    return config;
  }
  void stop_and_stand() {
    arm();
    two.tick(OperatorRequest::stop);
    two.run(50);
    ASSERT_EQ(player(), Player::fallback);
  }
  StopRule& rule() { return two.rig.config.stops[static_cast<std::size_t>(Cause::operator_stop)]; }
  [[nodiscard]] bool is_stiff() const { return two.rig.out->setpoints[0].kp > 0; }
  void arm() {
    two.arm();
    two.run(600);
    ASSERT_NEAR(reference(), 0.4F, 0.02F);
  }
  // No jump while the fallback policy moves the robot.
  void go(int ticks) {
    for (int i = 0; i < ticks; ++i) {
      const float before = reference(), speed = record().dq_reference;
      two.tick();
      const JointLimits& limits = two.rig.config.joints[0].limits;
      ASSERT_LE(std::abs(record().dq_reference - speed), limits.acceleration * 0.001F * 1.01F + 1e-5F);
      ASSERT_LE(std::abs(reference() - before), limits.velocity * 0.001F * 1.01F + 1e-6F);
    }
  }
  void stays_let_go(int ticks) {
    for (int i = 0; i < ticks; ++i) {
      two.tick();
      ASSERT_EQ(player(), Player::none) << "tick " << i;
      ASSERT_EQ(two.rig.mode(), Mode::damped_stop);
    }
  }
  [[nodiscard]] const JointRecord& record() const { return two.rig.out->record.joints[0]; }
  [[nodiscard]] float reference() const { return record().q_reference; }
  [[nodiscard]] Player player() const { return two.header().player; }

  TwoPolicies two{stopping_robot(Cause::operator_stop)};
};

TEST_F(StopByPolicy, MovesTheRobotForAsLongAsItMayThenTheRobotIsDampedAndHeld) {
  arm();
  two.tick(OperatorRequest::stop);
  ASSERT_EQ(two.rig.mode(), Mode::damped_stop);
  EXPECT_EQ(player(), Player::fallback) << "in the very tick of the stop";
  go(499);
  EXPECT_EQ(player(), Player::fallback);
  EXPECT_LT(reference(), 0.0F) << "on its way to the fallback's -0.4";
  EXPECT_GT(two.rig.out->setpoints[0].kp, 0);
  two.tick();
  EXPECT_EQ(player(), Player::none) << "its time is over";
  EXPECT_FALSE(is_stiff()) << "damped, however still it stood";
  two.run(1500);
  EXPECT_GT(two.rig.out->setpoints[0].kp, 0);
  EXPECT_EQ(two.rig.mode(), Mode::damped_stop) << "until a person resets it";
  two.tick(OperatorRequest::reset);
  EXPECT_EQ(two.rig.mode(), Mode::standby);
}

TEST_F(StopByPolicy, WithoutOneThatSpeaksItIsAnyOtherStop) {
  arm();
  two.fallback_speaks = false;
  two.run(200);
  two.tick(OperatorRequest::stop);
  EXPECT_EQ(player(), Player::none);
  EXPECT_FALSE(is_stiff());
  two.fallback_speaks = true;
  stays_let_go(60);
}

TEST_F(StopByPolicy, OnceItFallsSilentTheRobotIsDampedForGood) {
  rule().longest = {};
  stop_and_stand();
  two.fallback_speaks = false;
  for (int i = 0; i < 300 && player() == Player::fallback; ++i) two.tick();
  EXPECT_EQ(player(), Player::none);
  EXPECT_FALSE(is_stiff());
  two.fallback_speaks = true;
  stays_let_go(500);
}

TEST_F(StopByPolicy, BeginsOnlyWhereAPolicyMovedTheRobot) {
  two.run(40);
  two.tick(OperatorRequest::arm);
  ASSERT_EQ(two.rig.mode(), Mode::arming);
  two.tick(OperatorRequest::stop);
  ASSERT_EQ(two.rig.mode(), Mode::damped_stop);
  stays_let_go(200);
}

// Too hot is milder than a person's stop, and stops a policy that moves the robot all the same.
TEST_F(StopByPolicy, AnyOtherCauseEndsItHoweverMild) {
  two.rig.config.joints[0].temperature.stop = 60;
  two.rig.input.joints[0].temperature_C = 40;
  stop_and_stand();
  two.rig.input.joints[0].temperature_C = 61;
  two.tick();
  EXPECT_EQ(player(), Player::none);
  EXPECT_FALSE(is_stiff());
  two.rig.input.joints[0].temperature_C = 40;
  stays_let_go(200);
}

TEST_F(StopByPolicy, NeitherDoesItBeginBesideAnotherCause) {
  two.rig.config.joints[0].temperature.stop = 60;
  two.rig.input.joints[0].temperature_C = 40;
  arm();
  two.rig.input.joints[0].temperature_C = 61;
  two.tick(OperatorRequest::stop);
  EXPECT_EQ(two.header().cause, Cause::operator_stop);
  EXPECT_EQ(player(), Player::none);
}

TEST_F(StopByPolicy, APersonsStopMovesNobodyWhoWasLetGo) {
  arm();
  two.policy_speaks = two.fallback_speaks = false;
  ASSERT_GE(two.run_until(Mode::damped_stop, 1500), 0);  // both lost
  two.policy_speaks = two.fallback_speaks = true;
  two.run(1500);
  ASSERT_TRUE(is_stiff()) << "it rests";
  two.tick(OperatorRequest::stop);
  stays_let_go(200);
  two.tick(OperatorRequest::reset);
  // Nor where the stop was the policy's, and it let go of the robot.
  rule().longest = {};
  stop_and_stand();
  two.fallback_speaks = false;
  for (int i = 0; i < 300 && player() == Player::fallback; ++i) two.tick();
  two.fallback_speaks = true;
  two.tick(OperatorRequest::stop);
  stays_let_go(500);
}

// The same where the stop that let it go is by policy itself.
TEST_F(StopByPolicy, APersonsNextStopMovesNobodyWhomTheFirstLetGo) {
  rule().longest = {};
  stop_and_stand();
  two.fallback_speaks = false;
  for (int i = 0; i < 300 && player() == Player::fallback; ++i) two.tick();
  ASSERT_EQ(player(), Player::none);
  two.fallback_speaks = true;
  two.run(1500);
  ASSERT_TRUE(is_stiff()) << "it rests";
  two.tick(OperatorRequest::stop);
  stays_let_go(200);
}

// Goal: where the fallback policy let the robot stand is no rest of a robot that is released. Method: it stands for
// seconds, falls silent, and a reset is asked for in the very tick that lets go and in each of the dwell after it.
TEST_F(StopByPolicy, WhatItStoodStillBeforeIsNoRest) {
  rule().longest = {};
  stop_and_stand();
  two.run(3000);
  two.fallback_speaks = false;
  for (int i = 0; i < 300 && player() == Player::fallback; ++i) two.tick(OperatorRequest::reset);
  ASSERT_EQ(player(), Player::none);
  for (int i = 0; i < 99; ++i) {
    ASSERT_EQ(two.rig.mode(), Mode::damped_stop) << "reset " << i << " ms after it was released";
    ASSERT_FALSE(is_stiff()) << "held " << i << " ms after it was released";
    two.tick(OperatorRequest::reset);
  }
  two.run(10);
  two.tick(OperatorRequest::reset);
  EXPECT_EQ(two.rig.mode(), Mode::standby);
}

TEST_F(StopByPolicy, StandingStillUnderItIsNoRest) {
  rule().longest = {};
  stop_and_stand();
  two.run(3000);  // it stands where the fallback wants it
  ASSERT_EQ(player(), Player::fallback);
  two.tick(OperatorRequest::reset);
  EXPECT_EQ(two.rig.mode(), Mode::damped_stop) << "a reset would take its power";
  two.fallback_speaks = false;
  two.run(1500);
  two.tick(OperatorRequest::reset);
  EXPECT_EQ(two.rig.mode(), Mode::standby);
}

TEST_F(StopByPolicy, ItsOwnTimeCountsFromWhenItTookOver) {
  rule().longest = {};
  two.rig.config.fallback_longest = milliseconds(300);
  arm();
  two.policy_speaks = false;
  ASSERT_GE(two.run_until(Mode::degraded, 400), 0);
  two.run(200);
  two.tick(OperatorRequest::stop);
  EXPECT_EQ(player(), Player::fallback);
  two.run(100);
  EXPECT_EQ(player(), Player::none) << "300 ms at one go, in degraded mode and in the stop";
}

// Goal: nonsense of the fallback policy's own is never answered by the fallback policy. Method: every stop that can be
// its, is; its targets go out of range while it plays, in degraded mode and in a stop.
TEST_F(StopByPolicy, ItsOwnNonsenseEndsItHoweverItWasStopped) {
  for (const bool in_a_stop : {false, true}) {
    two = TwoPolicies(stopping_robot(Cause::operator_stop));
    TickConfig& config = two.rig.config;
    for (const Cause cause : {Cause::operator_stop, Cause::bad_commands, Cause::overrun})
      config.stops[static_cast<std::size_t>(cause)] = {StopManner::policy, {}};
    arm();
    two.policy_speaks = in_a_stop;
    if (in_a_stop) two.tick(OperatorRequest::stop);
    for (int i = 0; i < 1000 && player() != Player::fallback; ++i) two.tick();
    ASSERT_EQ(player(), Player::fallback);
    two.fallback_wants = 50;
    for (int i = 0; i < 1000 && player() == Player::fallback; ++i) two.tick();
    EXPECT_EQ(player(), Player::none) << "in a stop: " << in_a_stop;
    EXPECT_EQ(two.rig.mode(), Mode::damped_stop);
    EXPECT_NE(two.header().causes_active & bit(Cause::fallback_spent), 0U);
    EXPECT_EQ(two.header().causes_active & bit(Cause::bad_commands), 0U) << "the policy said nothing wrong";
    EXPECT_FALSE(is_stiff());
    two.tick(OperatorRequest::stop);
    stays_let_go(500);
  }
}

TEST_F(StopByPolicy, ThePolicysNonsenseIsAnswered) {
  two.rig.config = stopping_robot(Cause::bad_commands);
  arm();
  two.policy_wants = std::numeric_limits<float>::quiet_NaN();
  ASSERT_GE(two.run_until(Mode::damped_stop, 400), 0);
  EXPECT_EQ(two.header().cause, Cause::bad_commands);
  EXPECT_EQ(player(), Player::fallback);
  go(300);
  EXPECT_EQ(player(), Player::fallback);
  two.tick(OperatorRequest::stop);
  EXPECT_EQ(player(), Player::none) << "the worse cause's manner is another one";
}

// The policy's nonsense of a second ago does not end what answers it.
TEST_F(StopByPolicy, WhatWasOutOfRangeBeforeItIsNotItsOwn) {
  two.rig.config = stopping_robot(Cause::bad_commands);
  arm();
  two.policy_wants = 50.0F;
  ASSERT_GE(two.run_until(Mode::damped_stop, 1500), 0);
  ASSERT_EQ(two.header().cause, Cause::bad_commands);
  go(400);
  EXPECT_EQ(player(), Player::fallback);
}

// Goal: what the second policy says and does is state, input and record, so that it replays from a keyframe. Method: a
// run with losses, saved in the middle while the fallback plays; the rest again from the keyframe and the records
// alone.
TEST(FallbackPolicy, ReplaysBitForBitFromAKeyframe) {
  TickConfig config = robot_with_fallback();
  config.join = {.kind = JoinKind::cross_fade, .over = milliseconds(60)};
  config.stops[static_cast<std::size_t>(Cause::operator_stop)] = {StopManner::policy, milliseconds(500)};
  TwoPolicies two(config);
  two.arm();
  two.policy_speaks = false;
  ASSERT_GE(two.run_until(Mode::degraded, 400), 0);
  two.run(77);
  ASSERT_EQ(two.header().player, Player::fallback);
  std::vector<std::byte> keyframe(ipc::kMaxKeyframeBytes);
  keyframe.resize(save(*two.rig.state, keyframe));
  ASSERT_GT(keyframe.size(), 0U);

  const TickStatePtr replayed = make_tick_state(config);
  const auto loaded = load(*replayed, config, keyframe);
  ASSERT_TRUE(loaded.has_value()) << loaded.error();
  const auto again = std::make_unique<TickOutput>();
  for (int i = 0; i < 900; ++i) {
    if (i == 200) two.policy_speaks = true;
    if (i == 600) two.fallback_speaks = two.policy_speaks = false;
    two.tick(i == 400 ? OperatorRequest::stop : OperatorRequest::none);
    ASSERT_TRUE(i != 500 || two.header().player == Player::fallback) << "in the stop";
    TickInput input = input_of(two.rig.out->record, two.rig.input.messages[Seat::policy].command,
                               two.rig.input.messages[Seat::policy].bytes);
    input.messages[Seat::fallback].command = two.rig.input.messages[Seat::fallback].command;
    input.messages[Seat::fallback].bytes = two.rig.input.messages[Seat::fallback].bytes;
    control_tick(*replayed, input, config, *again);
    ASSERT_EQ(std::memcmp(&again->record, &two.rig.out->record, again->record.used_bytes()), 0) << "tick " << i;
  }
}

}  // namespace
}  // namespace takt::pipeline

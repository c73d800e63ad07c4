// SPDX-License-Identifier: Apache-2.0
// Goal: a policy that runs beside the one in charge moves nothing until a person asks for it, takes over and hands back
// without a jump, goes back by itself when it fails on probation, whatever is killed, and each tick says whose command
// the robot follows. Method: the rig's robot in virtual time with two hosts that answer each observation after some
// ticks, each told when to be silent and what to want; the mailboxes change places where the tick says so.
#include <gtest/gtest.h>

#include <algorithm>
#include <cmath>
#include <cstring>
#include <limits>
#include <memory>
#include <random>
#include <utility>
#include <vector>

#include "executive/ipc/executive_segments.hpp"
#include "executive/pipeline/tick_state.hpp"
#include "tests/executive/pipeline/rig.hpp"

namespace takt::pipeline {
namespace {

using testing::chunk_for;
using testing::Rig;

constexpr std::uint64_t kOwnHash = 0x0A0A, kCandidateHash = 0xCA11;
constexpr std::size_t kOwn = 0, kCandidate = 1;

TickConfig robot_on_probation(Duration probation = seconds(1)) {
  TickConfig config = testing::robot(3);
  config.policy.hash = kOwnHash;
  config.probation = probation;
  return config;
}

struct PolicyHost {
  std::uint64_t hash = 0;
  float wants = 0;
  bool speaks = true;
  int answers_after = 1;     // ticks
  std::uint8_t session = 0;  // 0: was never there
  std::uint64_t sequence = 0;
  // The observation being answered, and for how many ticks it still is; 0: none.
  std::uint64_t observation = 0;
  int ticks_left = 0;
  std::unique_ptr<CommandChunk> chunk = std::make_unique<CommandChunk>();
};

class TwoHosts {
 public:
  explicit TwoHosts(const TickConfig& config) : rig(config) {
    hosts[kOwn] = {.hash = kOwnHash, .wants = 0.4F, .session = 1};
    hosts[kCandidate] = {.hash = kCandidateHash, .wants = -0.4F, .session = 0};
  }

  void start_candidate() { start(kCandidate); }
  void start(std::size_t host) {
    hosts[host].session = ++sessions;
    hosts[host].sequence = 0;
    hosts[host].ticks_left = 0;
    hosts[host].speaks = true;
  }

  const TickOutput& tick(OperatorRequest request = OperatorRequest::none, std::uint64_t asked = 0) {
    const bool exchanged = header().candidate.in_charge != 0;
    PolicyHost& in_charge = hosts[exchanged ? kCandidate : kOwn];
    PolicyHost& beside = hosts[exchanged ? kOwn : kCandidate];
    rig.input.messages[Seat::candidate] = message_of(beside);
    if (hosts[kCandidate].session != 0) rig.input.candidate_policy = hosts[kCandidate].hash;
    rig.input.asked_policy = asked;
    const PolicyMessage message = message_of(in_charge);
    rig.input.messages[Seat::policy].session = message.session;
    rig.tick(message.command, request, Arrival::accepted, message.bytes);
    for (PolicyHost& host : hosts) hear(host);
    return *rig.out;
  }
  void run(int ticks) {
    for (int i = 0; i < ticks; ++i) tick();
  }
  // Ticks until that became of a change of policy, at most `most`; -1: it never did.
  int run_until(PolicyChange change, int most) {
    for (int i = 0; i < most; ++i) {
      tick();
      if (header().candidate.change == change) return i;
    }
    return -1;
  }
  void arm() {
    run(40);
    tick(OperatorRequest::arm);
    run(60);
    ASSERT_EQ(rig.mode(), Mode::tracking);
  }
  // Asks, and runs until it came, which may be at once.
  void swap() { ASSERT_TRUE(asked(OperatorRequest::swap, PolicyChange::swapped)); }
  void back() { ASSERT_TRUE(asked(OperatorRequest::back, PolicyChange::back)); }
  [[nodiscard]] const TickRecordHeader& header() const { return rig.header(); }
  [[nodiscard]] bool candidate_in_charge() const { return header().candidate.in_charge != 0; }

  Rig rig;
  std::array<PolicyHost, 2> hosts;
  std::uint8_t sessions = 1;

 private:
  bool asked(OperatorRequest request, PolicyChange change) {
    tick(request, hosts[kCandidate].hash);
    return header().candidate.change == change || run_until(change, 60) >= 0;
  }
  PolicyMessage message_of(PolicyHost& host) {
    PolicyMessage message{.session = host.session};
    if (host.session == 0 || host.ticks_left == 0 || --host.ticks_left != 0 || !host.speaks) return message;
    const std::uint64_t id = std::exchange(host.observation, 0);
    *host.chunk = chunk_for(rig.config, id, rig.published_at[id], rig.now, ++host.sequence, host.wants);
    host.chunk->header.policy_hash = host.hash;
    message.mailbox = Arrival::accepted;
    message.command = host.chunk.get();
    message.bytes = host.chunk->used_bytes();
    return message;
  }
  void hear(PolicyHost& host) const {
    if (!rig.out->observation_due || host.ticks_left != 0) return;
    host.observation = rig.newest_observation;
    host.ticks_left = host.answers_after;
  }
};

// Goal: a candidate's distance is one number of hinges and slides. Method: the middle joint a slide by whose motor half
// a metre is a radian.
TEST(Candidate, ItsDistanceIsOfASlidesMotor) {
  TickConfig config = robot_on_probation();
  config.joints[1].limits.per_rad = 0.5F;
  TwoHosts two(config);
  two.start_candidate();
  two.arm();
  for (int i = 0; i < 100; ++i) two.tick();
  EXPECT_NEAR(two.header().candidate.distance, 1.6F, 1e-4F);
}

TEST(Candidate, IsJudgedAndComparedAndMovesNothing) {
  TwoHosts alone(robot_on_probation()), two(robot_on_probation());
  two.start_candidate();
  alone.arm();
  two.arm();
  for (int i = 0; i < 800; ++i) {
    alone.tick();
    two.tick();
    ASSERT_EQ(std::memcmp(alone.rig.out->setpoints, two.rig.out->setpoints, sizeof alone.rig.out->setpoints), 0);
  }
  const CandidateRecord& candidate = two.header().candidate;
  EXPECT_EQ(candidate.policy_hash, kCandidateHash);
  EXPECT_EQ(two.header().seats[Seat::candidate].freshness, Freshness::fresh);
  EXPECT_GT(two.header().seats[Seat::candidate].age, Duration{});
  EXPECT_NEAR(candidate.distance, 0.8F, 1e-4F);
  EXPECT_EQ(candidate.in_charge, 0);
  EXPECT_EQ(two.header().command_policy, kOwnHash);
  EXPECT_EQ(two.header().player, Player::policy);
  EXPECT_EQ(alone.header().seats[Seat::candidate].freshness, Freshness::missing);
}

TEST(Candidate, ToldWhereItsTargetsAndItsPathWouldBeStopped) {
  TwoHosts two(robot_on_probation());
  two.start_candidate();
  two.arm();
  two.run(500);
  EXPECT_EQ(two.header().candidate.beyond_limits, 0U);
  two.hosts[kCandidate].wants = 9.0F;
  bool limited = false;
  for (int i = 0; i < 100; ++i) limited |= two.tick().record.header.candidate.beyond_limits != 0;
  EXPECT_TRUE(limited) << "the way there asks for more than the limits allow";
  EXPECT_EQ(two.header().candidate.beyond_range, every_joint(3));
  for (const JointRecord& joint : std::span(two.rig.out->record.joints, 3)) EXPECT_NEAR(joint.q_reference, 0.4F, 0.01F);
}

TEST(Candidate, TakesOverWithItsNextAnswerAndIsConfirmed) {
  TwoHosts two(robot_on_probation());
  two.start_candidate();
  two.arm();
  two.run(500);
  const std::uint64_t before = two.rig.newest_observation;
  two.tick(OperatorRequest::swap, kCandidateHash);
  ASSERT_EQ(two.header().candidate.change, PolicyChange::asked);
  EXPECT_EQ(two.header().candidate.is_asked, 1);
  EXPECT_EQ(two.header().command_policy, kOwnHash);
  ASSERT_GE(two.run_until(PolicyChange::swapped, 30), 0);
  EXPECT_GE(two.header().seats[Seat::policy].observation_answered, before);
  EXPECT_EQ(two.header().command_policy, kCandidateHash);
  EXPECT_EQ(two.header().candidate.on_probation, 1);
  EXPECT_EQ(two.header().candidate.is_asked, 0);
  const int probation = two.run_until(PolicyChange::confirmed, 2000);
  EXPECT_NEAR(probation, 1000, 2);
  two.run(500);
  EXPECT_EQ(two.rig.mode(), Mode::tracking);
  EXPECT_NEAR(two.rig.out->record.joints[0].q_reference, -0.4F, 0.01F);
  EXPECT_NEAR(two.header().candidate.distance, 0.8F, 1e-4F) << "the robot's own policy runs on beside it";

  two.back();
  EXPECT_EQ(two.header().command_policy, kOwnHash);
  EXPECT_EQ(two.header().candidate.on_probation, 0);
  two.run(1500);
  EXPECT_NEAR(two.rig.out->record.joints[0].q_reference, 0.4F, 0.01F);
}

TEST(Candidate, IsNotSwappedInUnlessItIsTheOneThatWasNamedAndIsFresh) {
  TwoHosts two(robot_on_probation());
  two.arm();
  two.tick(OperatorRequest::swap, 0);
  EXPECT_EQ(two.header().candidate.change, PolicyChange::refused) << "there is none";
  two.tick(OperatorRequest::back);
  EXPECT_EQ(two.header().candidate.change, PolicyChange::refused) << "the robot's own is in charge";
  two.start_candidate();
  two.run(100);
  two.tick(OperatorRequest::swap, 0xBAD);
  EXPECT_EQ(two.header().candidate.change, PolicyChange::refused) << "another one";
  two.hosts[kCandidate].speaks = false;
  two.run(300);
  two.tick(OperatorRequest::swap, kCandidateHash);
  EXPECT_EQ(two.header().candidate.change, PolicyChange::refused) << "nothing fresh";
  EXPECT_FALSE(two.candidate_in_charge());
}

TEST(Candidate, KilledBetweenTheRequestAndItsAnswerLeavesTheOtherRunning) {
  TwoHosts two(robot_on_probation());
  two.start_candidate();
  two.arm();
  two.run(200);
  two.hosts[kCandidate].speaks = false;
  two.tick(OperatorRequest::swap, kCandidateHash);
  ASSERT_EQ(two.header().candidate.change, PolicyChange::asked);
  const int given_up = two.run_until(PolicyChange::expired, 1000);
  EXPECT_NEAR(given_up, two.rig.config.freshness.stop_after.milliseconds(), 2);
  EXPECT_EQ(two.header().candidate.is_asked, 0);
  EXPECT_EQ(two.rig.mode(), Mode::tracking);
  EXPECT_EQ(two.header().command_policy, kOwnHash);
  two.start_candidate();
  two.run(200);
  EXPECT_FALSE(two.candidate_in_charge()) << "a request that was given up is over";
}

TEST(Candidate, WhoComesInsteadWasNotAskedFor) {
  TwoHosts two(robot_on_probation());
  two.start_candidate();
  two.arm();
  two.run(200);
  two.hosts[kCandidate].answers_after = 15;
  while (!two.tick().observation_due) {
  }
  two.tick(OperatorRequest::swap, kCandidateHash);
  ASSERT_EQ(two.header().candidate.change, PolicyChange::asked);
  two.hosts[kCandidate].hash = 0xBAD;
  two.start_candidate();
  two.tick();
  EXPECT_EQ(two.header().candidate.change, PolicyChange::expired);
  two.run(200);
  EXPECT_EQ(two.header().seats[Seat::candidate].freshness, Freshness::fresh);
  EXPECT_FALSE(two.candidate_in_charge());
}

// Goal: on probation a fault of the candidate's costs the robot neither tracking nor its contract. Method: each kind of
// fault right after the swap.
TEST(Candidate, SilentOnProbationGoesBackBeforeTheContractIsViolated) {
  TwoHosts two(robot_on_probation());
  two.start_candidate();
  two.arm();
  two.run(200);
  two.swap();
  two.hosts[kCandidate].speaks = false;
  ASSERT_GE(two.run_until(PolicyChange::back_for_age, 400), 0);
  EXPECT_EQ(two.header().command_policy, kOwnHash) << "in the very tick that notices";
  EXPECT_EQ(two.header().seats[Seat::policy].freshness, Freshness::fresh);
  EXPECT_EQ(two.header().player, Player::policy);
  EXPECT_FALSE(two.candidate_in_charge());
  two.run(1500);
  EXPECT_EQ(two.rig.mode(), Mode::tracking);
  EXPECT_NEAR(two.rig.out->record.joints[0].q_reference, 0.4F, 0.01F);
}

// Goal: while nothing is played the reference comes to rest on its own; the policy that takes over then goes on from
// there, and from nowhere else. Method: a join that leaves a remainder, over which the target meets the path slowly.
TEST(Candidate, WhatGoesBackAfterSilenceBeginsAtTheReference) {
  TickConfig config = robot_on_probation();
  config.join = {.kind = JoinKind::cross_fade, .over = milliseconds(60)};
  TwoHosts two(config);
  two.start_candidate();
  two.arm();
  two.run(200);
  two.swap();
  two.run(300);
  two.hosts[kCandidate].speaks = false;
  ASSERT_GE(two.run_until(PolicyChange::back_for_age, 400), 0);
  const JointRecord& joint = two.rig.out->record.joints[0];
  const float remainder = two.rig.state->seats[Seat::policy].join.remainder[0].q;
  EXPECT_NEAR(remainder, joint.q_reference - 0.4F, 0.01F);
  EXPECT_GT(std::abs(remainder), 0.1F) << "it was on its way to the candidate's";
}

// Goal: who leaves takes its last command along: without a fresh one of the robot's own policy nothing moves the robot.
// Method: the own policy falls silent, the candidate sends invalid commands on probation; every tick says who moves.
TEST(Candidate, RolledBackItMovesNothingThoughNothingElseDoes) {
  TwoHosts two(robot_on_probation());
  two.start_candidate();
  two.arm();
  two.run(200);
  two.swap();
  two.rig.config.freshness.bad_command_limit = 4;
  two.hosts[kOwn].speaks = false;
  two.run(150);
  ASSERT_EQ(two.header().player, Player::policy);
  two.hosts[kCandidate].wants = std::numeric_limits<float>::quiet_NaN();
  ASSERT_GE(two.run_until(PolicyChange::back_for_refusals, 90), 0) << "its last good command lives still";
  EXPECT_EQ(two.header().player, Player::none) << "in the very tick that sends it back";
  for (int i = 0; i < 450; ++i) {
    two.tick();
    ASSERT_EQ(two.header().player, Player::none) << i;
    ASSERT_EQ(two.header().seats[Seat::policy].freshness, Freshness::missing) << i;
  }
  EXPECT_NEAR(two.rig.drives[0].dq, 0.0F, 0.05F);
  two.hosts[kOwn].speaks = true;
  two.run(1500);
  EXPECT_EQ(two.rig.mode(), Mode::tracking);
  EXPECT_NEAR(two.rig.out->record.joints[0].q_reference, 0.4F, 0.01F);
}

// Goal: what a candidate is refused for is told as the policy's is, and only as long as it is so. Method: nonsense, the
// same answer twice, and sense again, while it runs beside.
TEST(Candidate, IsRefusedAsThePolicyIs) {
  TwoHosts two(robot_on_probation());
  PolicyHost& candidate = two.hosts[kCandidate];
  two.start_candidate();
  two.arm();
  two.run(200);
  EXPECT_EQ(two.header().seats[Seat::candidate].last_refusal, Arrival::none);
  candidate.wants = std::numeric_limits<float>::quiet_NaN();
  two.run(30);
  EXPECT_EQ(two.header().seats[Seat::candidate].last_refusal, Arrival::not_finite);
  candidate.wants = -0.4F;
  two.run(30);
  EXPECT_EQ(two.header().seats[Seat::candidate].last_refusal, Arrival::none);
  --candidate.sequence;
  two.run(20);
  EXPECT_EQ(two.header().seats[Seat::candidate].last_refusal, Arrival::repeated_sequence);
  two.run(30);
  EXPECT_EQ(two.header().seats[Seat::candidate].last_refusal, Arrival::none);
  EXPECT_EQ(two.rig.mode(), Mode::tracking);
}

TEST(Candidate, TalkingNonsenseOnProbationGoesBack) {
  TwoHosts two(robot_on_probation());
  two.start_candidate();
  two.arm();
  two.run(200);
  two.swap();
  two.rig.config.freshness.bad_command_limit = 4;
  two.hosts[kCandidate].wants = std::numeric_limits<float>::quiet_NaN();
  ASSERT_GE(two.run_until(PolicyChange::back_for_refusals, 200), 0);
  EXPECT_EQ(two.header().command_policy, kOwnHash);
  EXPECT_EQ(two.header().seats[Seat::candidate].last_refusal, Arrival::not_finite);
  two.run(300);
  EXPECT_EQ(two.rig.mode(), Mode::tracking);
}

TEST(Candidate, OutOfRangeOnProbationGoesBack) {
  TwoHosts two(robot_on_probation());
  two.start_candidate();
  two.arm();
  two.run(200);
  two.swap();
  two.hosts[kCandidate].wants = 9.0F;
  ASSERT_GE(two.run_until(PolicyChange::back_for_range, 400), 0);
  two.run(300);
  EXPECT_EQ(two.rig.mode(), Mode::tracking) << "half of what the contract allows was left";
}

TEST(Candidate, AStopOnProbationGoesBack) {
  TwoHosts two(robot_on_probation());
  two.start_candidate();
  two.arm();
  two.run(200);
  two.swap();
  two.run(100);
  two.tick(OperatorRequest::stop);
  EXPECT_EQ(two.rig.mode(), Mode::damped_stop);
  EXPECT_EQ(two.header().candidate.change, PolicyChange::back_for_stop);
  EXPECT_FALSE(two.candidate_in_charge());
  two.run(3000);
  two.tick(OperatorRequest::reset);
  two.run(100);
  two.arm();
  EXPECT_EQ(two.header().command_policy, kOwnHash);
}

TEST(Candidate, EveryChangeHasATickOfItsOwn) {
  TwoHosts two(robot_on_probation(milliseconds(1)));
  two.start_candidate();
  two.arm();
  two.run(200);
  two.swap();
  two.tick();
  EXPECT_EQ(two.header().candidate.change, PolicyChange::confirmed) << "and not in the tick that says it was swapped";
}

TEST(Candidate, ConfirmedItAnswersForItself) {
  TwoHosts two(robot_on_probation(milliseconds(200)));
  two.start_candidate();
  two.arm();
  two.run(200);
  two.swap();
  ASSERT_GE(two.run_until(PolicyChange::confirmed, 300), 0);
  two.hosts[kCandidate].speaks = false;
  two.run(300);
  EXPECT_EQ(two.rig.mode(), Mode::degraded) << "as any policy that falls silent";
  EXPECT_TRUE(two.candidate_in_charge());
  two.back();
  two.run(400);
  EXPECT_EQ(two.rig.mode(), Mode::tracking);
}

TEST(Candidate, InChargeNobodyElseTakesItsMailbox) {
  TwoHosts two(robot_on_probation());
  two.start_candidate();
  two.arm();
  two.run(200);
  two.swap();
  two.start_candidate();  // the same policy, started anew
  two.run(100);
  EXPECT_TRUE(two.candidate_in_charge());
  EXPECT_EQ(two.header().command_policy, kCandidateHash);
  EXPECT_EQ(two.header().seats[Seat::policy].freshness, Freshness::fresh);
  two.hosts[kCandidate].hash = 0xBAD;
  two.start_candidate();
  ASSERT_GE(two.run_until(PolicyChange::back_for_age, 400), 0);
  EXPECT_EQ(two.header().candidate.policy_hash, 0xBADU);
  EXPECT_EQ(two.header().command_policy, kOwnHash);
}

// What a tick says of who is in charge agrees with the chunk that it follows.
void check_attribution(const TwoHosts& two) {
  const TickRecordHeader& header = two.header();
  const CommandHeader& followed = two.rig.state->seats[Seat::policy].chunk.header;
  ASSERT_EQ(header.command_policy, followed.policy_hash);
  ASSERT_EQ(header.seats[Seat::policy].command_sequence, followed.sequence);
  // With JoinKind::replace the steps are those of one policy alone.
  const float wants = two.rig.state->seats[Seat::policy].chunk.values[0];
  ASSERT_EQ(wants, header.command_policy == kOwnHash ? two.hosts[kOwn].wants : two.hosts[kCandidate].wants);
  ASSERT_TRUE(header.player != Player::policy || header.age.total() <= two.rig.config.freshness.max_age);
}

void check_motion(const TickRecord& now, std::array<JointRecord, 3>& last, const TickConfig& config) {
  for (std::size_t j = 0; j < 3; ++j) {
    const JointLimits& limits = config.joints[j].limits;
    const float dt = 0.001F;
    const JointRecord& joint = now.joints[j];
    ASSERT_LE(std::abs(joint.dq_reference), limits.velocity * 1.0001F);
    ASSERT_LE(std::abs(joint.dq_reference - last[j].dq_reference), limits.acceleration * dt * 1.01F + 1e-5F);
    ASSERT_LE(std::abs(joint.q_reference - last[j].q_reference), limits.velocity * dt * 1.01F + 1e-6F);
    last[j] = joint;
  }
}

// Goal: 1,000 swaps with the candidate killed at random instants of them leave the robot tracking, its reference inside
// the limits, every tick attributed to the right policy, and the whole replayable bit for bit. Method: swaps and kills
// drawn from a seed; every record is decided again from its inputs alone, from a keyframe in between.
TEST(Candidate, AThousandSwapsWithKillsAtRandomInstants) {
  TickConfig config = robot_on_probation(milliseconds(300));
  config.freshness.window_ticks = 100;  // two swaps that fail in one window would use it up
  config.freshness.epsilon = 0.1;
  TwoHosts two(config);
  two.start_candidate();
  two.arm();
  std::mt19937 random(14);
  std::vector<std::byte> keyframe(ipc::kMaxKeyframeBytes);
  TickStatePtr replayed = make_tick_state(config);
  const auto again = std::make_unique<TickOutput>();
  std::array<JointRecord, 3> last{};
  std::copy_n(two.rig.out->record.joints, 3, last.begin());
  ASSERT_TRUE(load(*replayed, config, std::span(keyframe).first(save(*two.rig.state, keyframe))));
  int swaps = 0, kills = 0, by_itself = 0, confirmed = 0, failed_at = 0;
  PolicyHost& candidate = two.hosts[kCandidate];
  for (int i = 0; i < 2'000'000 && swaps < 1000; ++i) {
    const CandidateRecord& now = two.header().candidate;
    OperatorRequest request = OperatorRequest::none;
    if (now.in_charge == 0 && now.is_asked == 0 && i > failed_at + 100 && random() % 20 == 0)
      request = OperatorRequest::swap;
    if (now.in_charge != 0 && now.on_probation == 0) request = OperatorRequest::back;
    // Killed within max_age of the end of its probation, it is confirmed before this can be known.
    const bool is_late = now.on_probation != 0 && two.rig.state->candidate.probation_left < milliseconds(110);
    const bool is_swapping = now.in_charge == 0 || (now.on_probation != 0 && !is_late);
    if (candidate.speaks && is_swapping && random() % 250 == 0) {
      candidate.speaks = false;
      ++kills;
    } else if (!candidate.speaks && now.in_charge == 0 && random() % 50 == 0) {
      two.start_candidate();
    }
    candidate.answers_after = 1 + static_cast<int>(random() % 40);
    two.tick(request, kCandidateHash);
    const PolicyChange change = two.header().candidate.change;
    swaps += change == PolicyChange::swapped ? 1 : 0;
    if (change == PolicyChange::back_for_age) ++by_itself, failed_at = i;
    confirmed += change == PolicyChange::confirmed ? 1 : 0;
    ASSERT_EQ(two.rig.mode(), Mode::tracking) << "tick " << i;
    check_attribution(two);
    check_motion(two.rig.out->record, last, config);
    if (HasFatalFailure()) return;

    TickInput input = input_of(two.rig.out->record, two.rig.input.messages[Seat::policy].command,
                               two.rig.input.messages[Seat::policy].bytes);
    input.messages[Seat::candidate].command = two.rig.input.messages[Seat::candidate].command;
    input.messages[Seat::candidate].bytes = two.rig.input.messages[Seat::candidate].bytes;
    control_tick(*replayed, input, config, *again);
    ASSERT_EQ(std::memcmp(&again->record, &two.rig.out->record, again->record.used_bytes()), 0) << "tick " << i;
    if (i % 5000 == 0) {
      replayed = make_tick_state(config);
      ASSERT_TRUE(load(*replayed, config, std::span(keyframe).first(save(*two.rig.state, keyframe))));
    }
  }
  EXPECT_EQ(swaps, 1000);
  EXPECT_GT(kills, 200);
  EXPECT_GT(by_itself, 100);
  EXPECT_GT(confirmed, 100);
}

// Goal: the same motion whatever the join rule. Method: swaps to and fro between policies that want opposite things,
// each tick against the one before.
TEST(Candidate, ChangingPlacesNeverMakesTheReferenceJump) {
  for (const JoinKind kind : {JoinKind::replace, JoinKind::cross_fade, JoinKind::prefix}) {
    TickConfig config = robot_on_probation(milliseconds(120));
    config.join = {.kind = kind, .over = milliseconds(60), .longest_delay = milliseconds(10)};
    TwoHosts two(config);
    two.start_candidate();
    two.arm();
    std::array<JointRecord, 3> last{};
    std::copy_n(two.rig.out->record.joints, 3, last.begin());
    int handovers = 0;
    for (int i = 0; i < 20'000 && handovers < 40; ++i) {
      const CandidateRecord& now = two.header().candidate;
      const bool asks = i % 190 == 0;
      two.hosts[kCandidate].speaks = i % 900 < 800;
      two.tick(!asks                ? OperatorRequest::none
               : now.in_charge != 0 ? OperatorRequest::back
                                    : OperatorRequest::swap,
               kCandidateHash);
      handovers += is_handover(two.header().candidate.change) ? 1 : 0;
      check_motion(two.rig.out->record, last, config);
      if (HasFatalFailure()) FAIL() << "join " << static_cast<int>(kind) << " tick " << i;
    }
    EXPECT_GE(handovers, 40) << "join " << static_cast<int>(kind);
    EXPECT_EQ(two.rig.mode(), Mode::tracking);
  }
}

// Until the candidate is sent back, which is before the robot leaves tracking.
void fall_silent_on_probation(TwoHosts& two) {
  two.start_candidate();
  two.arm();
  two.run(200);
  two.swap();
  two.run(100);
  two.hosts[kCandidate].speaks = false;
  for (int ticks = 0; two.candidate_in_charge() && ticks < 400; ++ticks) {
    two.tick();
    ASSERT_EQ(two.rig.mode(), Mode::tracking) << ticks;
  }
  ASSERT_FALSE(two.candidate_in_charge());
}

// Goal: what the candidate lacks is no reason to leave tracking: who is in charge is decided before the mode. Method: a
// candidate on probation that answers ever later until its last command is spent, with a contract that lets the robot
// go at the first such tick; the robot's own policy is fresh beside it.
TEST(Candidate, IsSentBackBeforeTheRobotLeavesTracking) {
  TickConfig config = robot_on_probation();
  config.freshness.window_ticks = 10;
  config.freshness.epsilon = 0.01;
  TwoHosts two(config);
  ASSERT_NO_FATAL_FAILURE(fall_silent_on_probation(two));
  EXPECT_EQ(two.header().command_policy, kOwnHash);
  EXPECT_EQ(two.header().player, Player::policy);
  two.run(100);
  EXPECT_EQ(two.rig.mode(), Mode::tracking);
}

// The same where the contract ends before the probation's own windows are used up: nothing degrades for what the
// candidate alone lacks.
TEST(Candidate, WhatItAloneLacksDegradesNothing) {
  TickConfig config = robot_on_probation();
  config.freshness.window_ticks = 1000;
  config.freshness.epsilon = 0.5;
  config.freshness.degrade_after = milliseconds(20);
  TwoHosts two(config);
  ASSERT_NO_FATAL_FAILURE(fall_silent_on_probation(two));
  EXPECT_EQ(two.header().candidate.change, PolicyChange::back_for_stop);
  two.run(100);
  EXPECT_EQ(two.rig.mode(), Mode::tracking);
}

// Goal: a host never takes another policy's path for its own. Method: what observations say around a swap.
TEST(Candidate, ObservationsSayWhoseChunkIsInUse) {
  TwoHosts two(robot_on_probation());
  two.start_candidate();
  two.arm();
  const auto said_next = [&] {
    while (!two.tick().observation_due) {
    }
    return two.rig.out->observation.of_candidate;
  };
  EXPECT_EQ(said_next(), 0);
  two.swap();
  EXPECT_EQ(said_next(), 1);
  two.back();
  EXPECT_EQ(said_next(), 0);
}

}  // namespace
}  // namespace takt::pipeline

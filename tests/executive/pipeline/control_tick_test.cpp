// SPDX-License-Identifier: Apache-2.0
// Goal: the tick as a whole does what the mode table and the freshness contract promise. Method: scenarios in virtual
// time on a simulated robot, one promise each.
#include "executive/pipeline/control_tick.hpp"

#include <gtest/gtest.h>

#include <algorithm>
#include <array>
#include <cmath>
#include <string>
#include <vector>

#include "executive/pipeline/mode_machine.hpp"
#include "tests/executive/pipeline/rig.hpp"

namespace takt::pipeline {
namespace {

using testing::chunk_for;
using testing::Rig;
using testing::robot;

std::vector<std::string> blockers(const Rig& rig) {
  std::array<ArmingBlocker, 200> list;
  const std::size_t count = arming_blockers(rig.out->record, rig.config, list);
  std::vector<std::string> texts;
  for (std::size_t i = 0; i < count; ++i) texts.emplace_back(list[i].what);
  return texts;
}

bool blocks(const Rig& rig, std::string_view what) {
  const auto texts = blockers(rig);
  return std::any_of(texts.begin(), texts.end(),
                     [&](const std::string& text) { return text.find(what) != std::string::npos; });
}

TEST(Record, NamesNoSequenceWhereNoMessageCame) {
  Rig rig(robot(2));
  rig.run_with_policy(40, 0.0F);
  const CommandChunk chunk =
      chunk_for(rig.config, rig.out->observation.id, rig.out->observation.published_at, rig.now, 77, 0.0F);
  rig.tick(&chunk);
  EXPECT_EQ(rig.header().seats[Seat::policy].command_sequence_seen, 77U);
  rig.tick();
  EXPECT_EQ(rig.header().seats[Seat::policy].command_sequence_seen, 0U);
}

TEST(Standby, ADriveThatIsStillOnBlocksArming) {
  Rig rig(robot(2));
  rig.run_with_policy(40, 0.0F);
  ASSERT_TRUE(blockers(rig).empty());
  rig.out->record.joints[1].feedback.drive_state = DriveState::enabled;
  EXPECT_TRUE(blocks(rig, "still switching off"));
  rig.out->record.header.mode = Mode::damped_stop;
  EXPECT_FALSE(blocks(rig, "still switching off")) << "there it is meant to be on";
}

TEST(Standby, BeforeAnyInputNothingMoves) {
  Rig rig(robot(6));
  for (auto& drive : rig.drives) drive.silent = true;
  rig.tick();
  EXPECT_EQ(rig.mode(), Mode::standby);
  EXPECT_FALSE(rig.out->drives_enabled);
  EXPECT_FALSE(rig.out->observation_due) << "nothing was observed yet";
  for (std::size_t j = 0; j < 6; ++j) {
    EXPECT_EQ(rig.out->setpoints[j].kp, 0.0F);
    EXPECT_EQ(rig.out->setpoints[j].kd, 0.0F);
    EXPECT_EQ(rig.out->setpoints[j].tau, 0.0F);
  }
}

TEST(Standby, ListsWhatArmingMisses) {
  Rig rig(robot(3));
  rig.drives[1].silent = true;
  rig.drives[2].fault = true;
  rig.drives[0].q = 2.0F;
  rig.input.buses[0].state = BusState::bus_off;
  rig.tick();
  EXPECT_TRUE(blocks(rig, "no fresh command"));
  EXPECT_TRUE(blocks(rig, "no recent feedback"));
  EXPECT_TRUE(blocks(rig, "reports a fault"));
  EXPECT_TRUE(blocks(rig, "outside its position limits"));
  EXPECT_TRUE(blocks(rig, "CAN bus is off"));
  EXPECT_EQ(blockers(rig).size(), 5U);
  rig.tick(nullptr, OperatorRequest::arm);
  EXPECT_EQ(rig.mode(), Mode::standby);
  EXPECT_EQ(rig.header().causes_active & bit(Cause::operator_arm), 0U) << "not granted";
}

TEST(Arming, DampsUntilAllDrivesAreEnabledAndTracksThen) {
  Rig rig(robot(3));
  rig.run_with_policy(40, 0.5F);
  EXPECT_TRUE(blockers(rig).empty());
  rig.tick_with_policy(0.5F, OperatorRequest::arm);
  ASSERT_EQ(rig.mode(), Mode::arming);
  EXPECT_EQ(rig.header().cause, Cause::operator_arm);
  EXPECT_TRUE(rig.out->drives_enabled);
  EXPECT_EQ(rig.out->setpoints[0].kp, 0.0F);
  EXPECT_GT(rig.out->setpoints[0].kd, 0.0F);
  EXPECT_TRUE(blocks(rig, "already armed"));
  rig.run_with_policy(20, 0.5F);
  EXPECT_EQ(rig.mode(), Mode::tracking);
  EXPECT_GT(rig.out->setpoints[0].kp, 0.0F);
  EXPECT_GT(rig.out->valid_until, rig.out->record.header.now);
}

TEST(Arming, CarriesWhatIsEnabledWhileItWaitsForTheRest) {
  TickConfig config = robot(6);
  config.gravity_compensation = true;
  Rig rig(config);
  rig.drives[5].never_enables = true;
  rig.run_with_policy(40, 0.4F);
  rig.tick_with_policy(0.4F, OperatorRequest::arm);
  for (int tick = 0; tick < 100; ++tick) rig.tick_with_policy(0.4F);
  ASSERT_EQ(rig.mode(), Mode::arming);
  const JointRecord& joint = rig.out->record.joints[0];
  EXPECT_NE(joint.tau_gravity, 0.0F);
  EXPECT_NEAR(rig.out->setpoints[0].tau, joint.tau_gravity, 0.01F * std::abs(joint.tau_gravity));
}

TEST(Arming, WaitsForDrivesThatAreNotSetUp) {
  Rig rig(robot(3));
  rig.run_with_policy(40, 0.0F);
  rig.out->record.joints[1].feedback.drive_state = DriveState::unknown;
  EXPECT_TRUE(blocks(rig, "the drive is not set up yet"));
}

TEST(Arming, GivesUpOnADriveThatDoesNotEnable) {
  Rig rig(robot(3));
  rig.drives[2].never_enables = true;
  rig.run_with_policy(40, 0.0F);
  rig.tick_with_policy(0.0F, OperatorRequest::arm);
  int ticks = 0;
  for (; ticks < 1000 && rig.mode() == Mode::arming; ++ticks) rig.tick_with_policy(0.0F);
  EXPECT_EQ(rig.mode(), Mode::fault_latched);
  EXPECT_EQ(rig.header().cause, Cause::enable_timeout);
  EXPECT_EQ(ticks, 301) << "enable_timeout is 300 ms";
}

TEST(Tracking, ReachesTheTargetThePolicyAsksFor) {
  Rig rig(robot(6));
  rig.arm(0.6F);
  rig.run_with_policy(2000, 0.6F);
  EXPECT_EQ(rig.mode(), Mode::tracking);
  for (std::size_t j = 0; j < 6; ++j) EXPECT_NEAR(rig.drives[j].q, 0.6F, 0.01F);
  EXPECT_EQ(rig.header().window_misses, 0U);
}

// What an ablation takes away: without pursuit the reference is the target itself, from one tick to the next.
TEST(Tracking, WithoutPursuitTheReferenceIsTheTarget) {
  for (const bool without : {false, true}) {
    TickConfig config = robot(2);
    config.resume_over = {};
    config.without.pursuit = without;
    Rig rig(config);
    rig.arm(0.0F);
    rig.run_with_policy(100, 0.0F);
    rig.run_with_policy(20, 0.1F);
    const float off = std::abs(rig.out->record.joints[0].q_reference - 0.1F);
    if (without)
      EXPECT_LE(off, 1e-4F);
    else
      EXPECT_GT(off, 0.01F) << "with it, it is led there";
  }
}

TEST(Tracking, GravityIsCarriedByTheModel) {
  TickConfig config = robot(6);
  config.gravity_compensation = true;
  Rig rig(config);
  rig.arm(0.4F);
  rig.run_with_policy(3000, 0.4F);
  ASSERT_EQ(rig.mode(), Mode::tracking);
  float heaviest = 0;
  for (std::size_t j = 0; j < 6; ++j) {
    EXPECT_NEAR(rig.drives[j].q, 0.4F, 0.01F);
    heaviest = std::max(heaviest, std::abs(rig.out->record.joints[j].tau_gravity));
  }
  EXPECT_GT(heaviest, 1.0F);
}

// Gravity is asked for from the first tick of arming on; a drive that is still off has ramped nothing up.
TEST(Arming, TheFirstTorqueOfADriveBeginsFromNone) {
  TickConfig config = robot(6);
  config.gravity_compensation = true;
  for (std::size_t j = 0; j < 6; ++j) config.joints[j].limits.torque_rate = 100;
  constexpr float kStep = 100 * 0.001F;
  Rig rig(config);
  rig.run_with_policy(100, 0.4F);
  rig.tick_with_policy(0.4F, OperatorRequest::arm);
  ASSERT_EQ(rig.mode(), Mode::arming);
  float heaviest = 0;
  for (int tick = 0; tick < 200 && rig.mode() == Mode::arming; ++tick) {
    for (std::size_t j = 0; j < 6; ++j) {
      const JointRecord& joint = rig.out->record.joints[j];
      if (joint.feedback.drive_state == DriveState::enabled) continue;
      EXPECT_LE(std::abs(joint.tau_total), kStep * 1.001F);
      heaviest = std::max(heaviest, std::abs(joint.tau_gravity));
    }
    rig.tick_with_policy(0.4F);
  }
  ASSERT_EQ(rig.mode(), Mode::tracking);
  EXPECT_GT(heaviest, 4 * kStep) << "the rig asks for more than one step";
}

TEST(Age, PartsAddUpAndHoldGrows) {
  Rig rig(robot(2));
  rig.arm();
  rig.run_with_policy(100, 0.0F);
  for (int i = 0; i < 60; ++i) {
    rig.tick_with_policy(0.0F);
    const TickRecordHeader& header = rig.header();
    ASSERT_EQ(header.age.total(), header.now - rig.sensed_at[header.seats[Seat::policy].observation_answered]);
    EXPECT_EQ(header.age.hold.ns % 1'000'000, 0);
    EXPECT_EQ(rig.out->valid_until, header.now + (rig.config.freshness.max_age - header.age.total()));
  }
}

// Goal: a drive is never told to go on beyond the end of the chunk. Method: a chunk of three steps, shorter than
// max_age.
TEST(Age, DrivesAreToldWhenTheChunkEndsIfThatIsSooner) {
  Rig rig(robot(2));
  rig.arm();
  rig.run_with_policy(100, 0.0F);
  while (!rig.out->observation_due) rig.tick();
  const std::uint64_t id = rig.newest_observation;
  const CommandChunk chunk = chunk_for(rig.config, id, rig.published_at[id], rig.now, ++rig.sequence, 0.0F, 3);
  rig.tick(&chunk);
  ASSERT_EQ(rig.header().seats[Seat::policy].arrival, Arrival::accepted);
  EXPECT_EQ(rig.out->valid_until, rig.published_at[id] + milliseconds(30));
  for (int i = 0; i < 40; ++i) {
    rig.tick();
    EXPECT_EQ(rig.out->valid_until.is_set(), rig.now < rig.published_at[id] + milliseconds(30));
  }
}

// Goal: from one tick to the next a joint's whole torque changes by no more than its slew, counted from the torque of
// the tick before. Method: the first tick of tracking asks for all the torque there is, and the drive produces none.
TEST(Tracking, TorqueRisesFromWhatTheTickBeforeAskedFor) {
  TickConfig config = robot(1);
  config.joints[0].limits.torque_rate = 500.0F;
  config.feedback = {0, 0, {}};  // nothing gets there in a tick, and tells no torque of it
  Rig rig(config);
  rig.arm(0.0F);
  rig.run_with_policy(100, 0.0F);
  float before = rig.out->record.joints[0].tau_total;
  float largest = 0.0F;
  for (int i = 0; i < 50; ++i) {
    rig.drives[0].q = -0.4F;  // blocked, far from where it should be
    rig.drives[0].dq = 0.0F;
    rig.drives[0].tau = 0.0F;
    rig.tick_with_policy(0.0F);
    const float now = rig.out->record.joints[0].tau_total;
    EXPECT_LE(std::abs(now - before), 0.5F * 1.001F) << "tick " << i;
    largest = std::max(largest, std::abs(now));
    before = now;
  }
  EXPECT_GT(largest, 10.0F) << "twenty slews and more were asked for";
}

TEST(Freshness, PolicyDeathDegradesThenStopsWithinItsBound) {
  Rig rig(robot(3));
  rig.arm(0.5F);
  rig.run_with_policy(1000, 0.5F);
  MonoTime last_usable = rig.now, degraded_at, stopped_at;
  for (int i = 0; i < 1000; ++i) {
    rig.tick();
    if (rig.header().seats[Seat::policy].freshness == Freshness::fresh ||
        rig.header().seats[Seat::policy].freshness == Freshness::aging)
      last_usable = rig.now;
    if (rig.header().cause == Cause::command_late) degraded_at = rig.now;
    if (rig.header().cause == Cause::command_lost) stopped_at = rig.now;
  }
  EXPECT_EQ(degraded_at - last_usable, milliseconds(11)) << "a silence of 10 ticks of 1000 is allowed";
  EXPECT_EQ(stopped_at - last_usable, rig.config.freshness.stop_after);
  EXPECT_EQ(rig.mode(), Mode::damped_stop);
}

// Goal: between max_age and the violation the robot tracks on without a target: its references brake along the limits
// and stay, by the joints' own gains. Method: a robot that moves, and a contract that allows a long silence.
TEST(Freshness, UntilASilenceIsLateEachJointBrakesWithItsOwnGains) {
  TickConfig config = robot(2);
  config.freshness.epsilon = 0.5;
  config.freshness.stop_after = seconds(10);
  Rig rig(config);
  rig.arm(0.0F);
  rig.run_with_policy(200, 1.2F);
  while (rig.header().seats[Seat::policy].freshness == Freshness::fresh ||
         rig.header().seats[Seat::policy].freshness == Freshness::aging)
    rig.tick();
  float speed = std::abs(rig.out->record.joints[0].dq_reference);
  ASSERT_GT(speed, 0.5F);
  const JointConfig& joint = rig.config.joints[0];
  for (int i = 0; i < 400; ++i) {
    rig.tick();
    ASSERT_EQ(rig.mode(), Mode::tracking) << i;
    ASSERT_EQ(rig.header().player, Player::none);
    const float now = std::abs(rig.out->record.joints[0].dq_reference);
    EXPECT_LE(now, speed);
    EXPECT_LE(speed - now, 1.001F * joint.limits.acceleration * 0.001F);
    EXPECT_EQ(rig.out->setpoints[0].kp, joint.kp);
    EXPECT_EQ(rig.out->setpoints[0].kd, joint.kd);
    speed = now;
  }
  EXPECT_EQ(speed, 0.0F) << "it stays where it came to rest";
}

// Goal: lateness that no silence shows violates the contract. Method: a max_age that each command outlives for a few
// ticks before its successor comes.
TEST(Freshness, LateAgainAndAgainViolatesTheContract) {
  TickConfig config = robot(1);
  config.freshness.max_age = milliseconds(17);
  Rig rig(config);
  rig.arm(0.0F);
  int ticks = 0;
  for (; ticks < 2000 && rig.mode() == Mode::tracking; ++ticks) rig.tick_with_policy(0.0F);
  EXPECT_EQ(rig.mode(), Mode::degraded);
  EXPECT_EQ(rig.header().cause, Cause::contract_violated);
  EXPECT_GT(ticks, 100) << "not by one silence";
}

TEST(Freshness, AFreezeDegradesAndRecovers) {
  Rig rig(robot(3));
  rig.arm(0.2F);
  rig.run_with_policy(1000, 0.2F);
  rig.run(300);
  EXPECT_EQ(rig.mode(), Mode::degraded);
  int ticks = 0;
  for (; ticks < 2000 && rig.mode() == Mode::degraded; ++ticks) rig.tick_with_policy(0.2F);
  EXPECT_EQ(rig.mode(), Mode::tracking);
  EXPECT_EQ(rig.header().cause, Cause::contract_restored);
  EXPECT_EQ(rig.header().window_misses, 0U) << "the window starts again";
  EXPECT_GE(ticks, 200);
  EXPECT_LE(ticks, 240);
}

TEST(Degraded, HoldBrakesToRestAndIgnoresThePolicy) {
  Rig rig(robot(1));
  rig.arm(0.0F);
  rig.run_with_policy(200, 1.2F);
  ASSERT_GT(rig.out->record.joints[0].dq_reference, 0.5F);
  rig.run(350);
  ASSERT_EQ(rig.mode(), Mode::degraded);
  const float held = rig.out->record.joints[0].q_reference;
  rig.run_with_policy(100, -1.0F);
  EXPECT_EQ(rig.mode(), Mode::degraded);
  EXPECT_EQ(rig.out->record.joints[0].q_reference, held);
  EXPECT_FALSE(rig.out->valid_until.is_set());
}

TEST(Degraded, SlowPlaysOnAtReducedSpeedWhileFresh) {
  TickConfig config = robot(1);
  config.degraded = DegradedBehaviour::slow;
  config.degraded_speed_scale = 0.1F;
  config.freshness.recover_after = seconds(5);
  Rig rig(config);
  rig.arm(0.0F);
  rig.run_with_policy(100, 0.0F);
  rig.run(150);
  ASSERT_EQ(rig.mode(), Mode::degraded);
  rig.run_with_policy(40, 1.0F);
  float fastest = 0;
  for (int i = 0; i < 1000; ++i) {
    rig.tick_with_policy(1.0F);
    fastest = std::max(fastest, rig.out->record.joints[0].dq_reference);
  }
  EXPECT_EQ(rig.mode(), Mode::degraded);
  EXPECT_NEAR(fastest, 0.3F, 1e-3F);
  EXPECT_NEAR(rig.out->record.joints[0].q_reference, 0.3F, 0.02F);
}

TEST(Degraded, FallbackGoesToItsPoseAtItsSpeed) {
  TickConfig config = robot(1);
  config.degraded = DegradedBehaviour::fallback;
  config.freshness.stop_after = seconds(60);
  Rig rig(config);
  rig.arm(-0.4F);
  rig.run_with_policy(1500, -0.4F);
  float fastest = 0;
  for (int i = 0; i < 4000; ++i) {
    rig.tick();
    if (rig.mode() == Mode::degraded) fastest = std::max(fastest, rig.out->record.joints[0].dq_reference);
  }
  EXPECT_NEAR(rig.drives[0].q, 0.2F, 0.01F);
  EXPECT_LE(fastest, 0.3F + 1e-6F);
}

TEST(DampedStop, ComesToRestHoldsAndWaitsForTheOperator) {
  TickConfig config = robot(3);
  config.gravity_compensation = true;
  Rig rig(config);
  rig.arm(0.0F);
  rig.run_with_policy(300, 1.2F);
  ASSERT_GT(std::abs(rig.drives[0].dq), 0.5F);
  rig.tick_with_policy(1.2F, OperatorRequest::stop);
  ASSERT_EQ(rig.mode(), Mode::damped_stop);
  rig.tick_with_policy(1.2F, OperatorRequest::reset);
  EXPECT_EQ(rig.mode(), Mode::damped_stop) << "still moving";
  rig.run_with_policy(2000, 1.2F);
  EXPECT_EQ(rig.mode(), Mode::damped_stop);
  EXPECT_GT(rig.out->setpoints[0].kp, 0.0F) << "holds position once at rest";
  const float held = rig.drives[0].q;
  rig.run(1000);
  EXPECT_NEAR(rig.drives[0].q, held, 1e-3F);
  rig.tick(nullptr, OperatorRequest::arm);
  EXPECT_EQ(rig.mode(), Mode::damped_stop);
  rig.tick(nullptr, OperatorRequest::reset);
  EXPECT_EQ(rig.mode(), Mode::standby);
  EXPECT_FALSE(rig.out->drives_enabled);
}

TEST(Shutdown, StopsAnArmedRobotAndLeavesStandbyAlone) {
  Rig rig(robot(1));
  rig.run_with_policy(50, 0.0F);
  rig.tick(nullptr, OperatorRequest::shutdown);
  EXPECT_EQ(rig.mode(), Mode::standby);
  rig.arm();
  rig.tick(nullptr, OperatorRequest::shutdown);
  EXPECT_EQ(rig.mode(), Mode::damped_stop);
  EXPECT_EQ(rig.header().cause, Cause::shutdown);
}

struct FaultCase {
  const char* when;
  void (*cause)(Rig&);
  Cause expected;
  Mode mode;
  unsigned about = 0;  // joints that lose their power, as bits
};

TEST(Faults, EachLeadsToItsMode) {
  const FaultCase cases[] = {
      {"silent joint", [](Rig& r) { r.drives[1].silent = true; }, Cause::feedback_lost, Mode::fault_latched, 2},
      {"drive fault", [](Rig& r) { r.drives[2].fault = true; }, Cause::drive_fault, Mode::fault_latched, 4},
      {"drive disabled", [](Rig& r) { r.drives[0].drops_out = true; }, Cause::drive_disabled, Mode::fault_latched, 1},
      {"bus off", [](Rig& r) { r.input.buses[0].state = BusState::bus_off; }, Cause::bus_off, Mode::fault_latched, 7},
      {"bus down", [](Rig& r) { r.input.buses[0].state = BusState::down; }, Cause::bus_down, Mode::fault_latched, 7},
      {"thrown out",
       [](Rig& r) {
         r.config.feedback = {0, 0, {}}, r.drives[0].q = 1.7F;
       },
       Cause::envelope_exceeded, Mode::damped_stop},
      {"too fast",
       [](Rig& r) {
         r.config.feedback = {0, 0, {}}, r.drives[0].q = -1.0F;
         r.drives[0].dq = r.config.joints[0].limits.velocity_hard + 4.0F;
       },
       Cause::envelope_exceeded, Mode::damped_stop},
      {"out of reach", [](Rig& r) { r.drives[0].q = 1.7F; }, Cause::feedback_implausible, Mode::fault_latched, 1},
      {"late ticks", [](Rig& r) { r.input.lateness = milliseconds(3); }, Cause::overrun, Mode::damped_stop},
      {"skipped periods", [](Rig& r) { r.input.skipped_periods += 21; }, Cause::overrun, Mode::damped_stop},
  };
  for (const FaultCase& fault : cases) {
    Rig rig(robot(3));
    rig.arm(0.3F);
    rig.run_with_policy(500, 0.3F);
    ASSERT_EQ(rig.mode(), Mode::tracking) << fault.when;
    fault.cause(rig);
    for (int i = 0; i < 40 && rig.mode() == Mode::tracking; ++i) rig.tick_with_policy(0.3F);
    EXPECT_EQ(name(rig.mode()), name(fault.mode)) << fault.when;
    EXPECT_EQ(name(rig.header().cause), name(fault.expected)) << fault.when;
    rig.run_with_policy(5, 0.3F);
    if (fault.mode == Mode::fault_latched) {
      for (std::size_t j = 0; j < 3; ++j) {
        const bool energised = rig.out->drive_enabled[j];
        EXPECT_EQ(energised, (fault.about >> j & 1U) == 0) << fault.when << ", joint " << j;
        const JointConfig& joint = rig.config.joints[j];  // without a tree nothing is known to hang on what was lost
        EXPECT_EQ(rig.out->setpoints[j].kp, energised ? joint.kp : 0.0F) << fault.when;
        EXPECT_EQ(rig.out->setpoints[j].kd, energised ? joint.kd : 0.0F) << fault.when;
      }
    }
  }
}

// Goal: a stall of the loop itself is no silence of its drives; a drive that then stays silent is lost all the same.
// Method: the clock jumps between two ticks, and the first tick behind it finds no reply: none was asked for.
TickOutput first_tick_behind_a_stall(Rig& rig, Duration stall) {
  rig.arm(0.3F);
  rig.run_with_policy(500, 0.3F);
  EXPECT_EQ(rig.mode(), Mode::tracking);
  rig.now = rig.now + stall;
  for (Rig::Drive& drive : rig.drives) drive.silent = true;
  return rig.tick_with_policy(0.3F);
}

TEST(Faults, OwnStallIsNoSilenceOfADrive) {
  for (const Duration stall : {milliseconds(60), milliseconds(100), milliseconds(450)}) {
    Rig rig(robot(3));
    const TickOutput behind = first_tick_behind_a_stall(rig, stall);
    for (std::size_t j = 0; j < 3; ++j) {
      EXPECT_EQ(behind.setpoints[j].kp, 0.0F) << "what is not heard is not pushed";
      EXPECT_EQ(behind.setpoints[j].tau, 0.0F);
    }
    for (Rig::Drive& drive : rig.drives) drive.silent = false;
    for (int i = 0; i < 100; ++i) {
      rig.tick_with_policy(0.3F);
      ASSERT_NE(rig.mode(), Mode::fault_latched) << stall.milliseconds() << " ms, tick " << i;
      ASSERT_EQ(rig.header().causes_active & bit(Cause::feedback_lost), 0U) << stall.milliseconds() << " ms";
    }
  }
}

TEST(Faults, ADriveThatIsSilentBehindAStallIsLost) {
  Rig rig(robot(3));
  first_tick_behind_a_stall(rig, milliseconds(100));
  for (const std::size_t j : {0U, 2U}) rig.drives[j].silent = false;
  const MonoTime began = rig.now;
  while (rig.mode() != Mode::fault_latched && rig.now - began < seconds(1)) rig.tick_with_policy(0.3F);
  EXPECT_EQ(name(rig.header().cause), name(Cause::feedback_lost));
  EXPECT_LE(rig.now - began, rig.config.feedback_timeout);
}

TEST(Faults, AStallIsExcusedForHalfASecondAtMost) {
  Rig rig(robot(3));
  first_tick_behind_a_stall(rig, milliseconds(700));
  EXPECT_EQ(name(rig.header().cause), name(Cause::feedback_lost));
}

TEST(Faults, ErrorPassiveAndUnknownDrivesAreNoFaults) {
  Rig rig(robot(3));
  rig.arm(0.3F);
  rig.input.buses[0].state = BusState::error_passive;
  rig.run_with_policy(100, 0.3F);
  EXPECT_EQ(rig.mode(), Mode::tracking);
}

// On a bus without drives nothing is sent: whether it is up again would stay unseen.
TEST(Faults, ABusWithoutDrivesFaultsNobody) {
  TickConfig config = robot(3);
  config.bus_count = 2;
  Rig rig(config);
  rig.arm(0.3F);
  for (const BusState state : {BusState::down, BusState::bus_off}) {
    rig.input.buses[1].state = state;
    rig.run_with_policy(100, 0.3F);
    EXPECT_EQ(rig.mode(), Mode::tracking);
  }
}

TEST(Faults, ResetWaitsUntilTheConditionIsGone) {
  Rig rig(robot(2));
  rig.arm();
  rig.input.buses[0].state = BusState::bus_off;
  rig.run_with_policy(150, 0.0F);
  rig.tick(nullptr, OperatorRequest::reset);
  EXPECT_EQ(rig.mode(), Mode::fault_latched);
  rig.input.buses[0].state = BusState::up;
  rig.tick(nullptr, OperatorRequest::reset);
  EXPECT_EQ(rig.mode(), Mode::standby);
}

// Goal: what disabling the drive may clear keeps no reset, and does not let the robot arm either. Method: a drive that
// goes on reporting its fault.
TEST(Faults, ResetIsGrantedWhileADriveStillReportsItsFault) {
  Rig rig(robot(2));
  rig.arm();
  rig.drives[1].fault = true;
  rig.run_with_policy(300, 0.0F);
  ASSERT_EQ(rig.mode(), Mode::fault_latched);
  ASSERT_NE(rig.header().causes_active & bit(Cause::drive_fault), 0U);
  rig.tick_with_policy(0.0F, OperatorRequest::reset);
  ASSERT_EQ(rig.mode(), Mode::standby);
  rig.run_with_policy(100, 0.0F);
  EXPECT_TRUE(blocks(rig, "the drive reports a fault"));
  rig.tick_with_policy(0.0F, OperatorRequest::arm);
  EXPECT_EQ(rig.mode(), Mode::standby);
}

TEST(Faults, StandbyReportsButNeverLatches) {
  Rig rig(robot(2));
  rig.drives[0].silent = true;
  rig.input.buses[0].state = BusState::down;
  rig.run(50);
  EXPECT_EQ(rig.mode(), Mode::standby);
  EXPECT_NE(rig.header().causes_active & bit(Cause::feedback_lost), 0U);
  EXPECT_NE(rig.header().causes_active & bit(Cause::bus_down), 0U);
}

// A recorder that is required and keeps up until a test says otherwise: it has what was before this tick.
class RecordedRig : public Rig {
 public:
  RecordedRig() : Rig(limited()) {}
  void run_recorded(int ticks, OperatorRequest request = OperatorRequest::none) {
    for (int i = 0; i < ticks; ++i) {
      input.recorded_through = input.tick;
      tick_with_policy(0.0F, request);
    }
  }
  void arm_recorded() {
    run_recorded(40);
    run_recorded(1, OperatorRequest::arm);
    run_recorded(50);
  }

 private:
  static TickConfig limited() {
    TickConfig config = robot(2);
    config.unrecorded_limit = 100;
    return config;
  }
};

TEST(Recording, NobodyArmsWhileNothingIsRecorded) {
  RecordedRig rig;
  rig.arm();
  EXPECT_EQ(rig.mode(), Mode::standby);
  std::array<ArmingBlocker, 1> blocker;
  ASSERT_EQ(arming_blockers(rig.out->record, rig.config, blocker), 1U);
  EXPECT_TRUE(blocker[0].what.starts_with("nothing is recorded")) << blocker[0].what;
  rig.arm_recorded();
  EXPECT_EQ(rig.mode(), Mode::tracking);
}

TEST(Recording, ARobotThatMovesStopsWhenItsRecorderEnds) {
  RecordedRig rig;
  rig.arm_recorded();
  rig.input.recorded_through = 0;
  rig.tick_with_policy(0.0F);
  EXPECT_EQ(rig.mode(), Mode::damped_stop);
  EXPECT_EQ(rig.header().cause, Cause::recording_lost);
}

TEST(Recording, ARecorderMayBeBehindByTheLimitAndNoMore) {
  RecordedRig rig;
  rig.arm_recorded();
  const std::uint64_t written = rig.input.recorded_through = rig.input.tick;
  while (rig.input.tick < written + rig.config.unrecorded_limit) {
    rig.tick_with_policy(0.0F);
    ASSERT_EQ(rig.mode(), Mode::tracking) << rig.input.tick - written;
  }
  rig.tick_with_policy(0.0F);
  EXPECT_EQ(rig.mode(), Mode::damped_stop);
  EXPECT_EQ(rig.header().cause, Cause::recording_lost);
}

TEST(Recording, ATickThatHasNotHappenedCannotHaveBeenWritten) {
  RecordedRig rig;
  rig.arm_recorded();
  rig.input.recorded_through = rig.input.tick + 2;
  rig.tick_with_policy(0.0F);
  EXPECT_EQ(rig.header().cause, Cause::recording_lost);
}

TEST(Recording, WhereItIsOptionalNothingWaitsForIt) {
  Rig rig(robot(2));
  rig.arm();
  EXPECT_EQ(rig.mode(), Mode::tracking);
}

TEST(Commands, RepeatedRefusalsStopTheRobot) {
  Rig rig(robot(2));
  rig.arm();
  rig.run_with_policy(100, 0.0F);
  CommandChunk chunk = chunk_for(rig.config, rig.newest_observation, rig.now, rig.now, ++rig.sequence, NAN);
  std::uint32_t sent = 0;
  while (rig.mode() == Mode::tracking && sent < 50) {
    chunk.header.sequence = ++rig.sequence;
    rig.tick(&chunk);
    ++sent;
    EXPECT_EQ(rig.header().seats[Seat::policy].arrival, Arrival::not_finite);
  }
  EXPECT_EQ(rig.header().cause, Cause::bad_commands);
  EXPECT_EQ(sent, rig.config.freshness.bad_command_limit + 1);
  EXPECT_EQ(rig.header().refused_commands, sent);
}

// An answer to the observation `lag` before the newest, all stamps sound.
CommandChunk late_answer(Rig& rig, std::uint64_t lag) {
  const std::uint64_t id = rig.newest_observation - lag;
  return chunk_for(rig.config, id, rig.published_at[id], rig.now, ++rig.sequence, 0.0F);
}

TEST(Commands, BackwardStampsAreAnIntegrationErrorEach) {
  Rig rig(robot(2));
  rig.arm();
  rig.run_with_policy(25, 0.0F);
  for (std::uint32_t errors = 1; errors <= 2; ++errors) {
    CommandChunk chunk = late_answer(rig, 0);
    chunk.header.infer_ended_at = chunk.header.infer_started_at - nanoseconds(1);
    rig.tick(&chunk);
    EXPECT_EQ(rig.header().seats[Seat::policy].arrival, Arrival::accepted);
    EXPECT_EQ(rig.header().integration_errors, errors);
  }
  rig.tick_with_policy(0.0F);
  EXPECT_EQ(rig.header().integration_errors, 2U);
}

// Goal: what is younger than max_age is never refused as forgotten, however fast observations are published. Method:
// one per tick, answers of every age up to max_age, each in a policy session with nothing newer in use.
TEST(Commands, AnAnswerYoungerThanMaxAgeIsRemembered) {
  TickConfig config = robot(2);
  config.observation_every_ticks = 1;
  for (const std::uint64_t lag : {0U, 62U, 63U, 64U, 80U, 98U}) {
    Rig rig(config);
    rig.run(300);
    const CommandChunk chunk = late_answer(rig, lag);
    rig.tick(&chunk);
    EXPECT_EQ(rig.header().seats[Seat::policy].arrival, Arrival::accepted)
        << rig.header().age.total().milliseconds() << " ms";
    EXPECT_LE(rig.header().age.total(), config.freshness.max_age);
  }
}

TEST(Commands, AnAnswerToAnOlderObservationReplacesNoNewerOne) {
  Rig rig(robot(2));
  rig.arm();
  rig.run_with_policy(101, 0.0F);
  while (!rig.out->observation_due) rig.tick_with_policy(0.0F);
  rig.tick_with_policy(0.0F);
  ASSERT_EQ(rig.header().seats[Seat::policy].arrival, Arrival::accepted);
  const Duration age = rig.header().age.total();
  const CommandChunk chunk = late_answer(rig, 2);
  rig.tick(&chunk);
  EXPECT_EQ(rig.header().seats[Seat::policy].arrival, Arrival::overtaken);
  EXPECT_EQ(rig.header().age.total(), age + rig.config.period);
  EXPECT_EQ(rig.header().refused_commands, 1U);
  EXPECT_EQ(rig.header().seats[Seat::policy].last_refusal, Arrival::overtaken);
}

// Goal: lateness is judged by the freshness contract and is no integration error. Method: more late messages than
// bad_command_limit allows, beside commands in time and instead of them.
TEST(Commands, LateOnesAreNoIntegrationError) {
  Rig rig(robot(2));
  rig.arm();
  for (int i = 0; i < 2'000; ++i) {
    if (rig.out->observation_due || i < 100) {
      rig.tick_with_policy(0.0F);
    } else {
      const CommandChunk chunk = late_answer(rig, 3);
      rig.tick(&chunk);
    }
    ASSERT_EQ(rig.mode(), Mode::tracking);
  }
  EXPECT_GT(rig.header().refused_commands, 1'000U);
  CauseMask seen = 0;
  for (int i = 0; i < 1'000 && rig.mode() != Mode::damped_stop; ++i) {
    const CommandChunk chunk = late_answer(rig, 6);
    rig.tick(&chunk);
    ASSERT_EQ(rig.header().seats[Seat::policy].arrival, Arrival::expired_observation);
    seen |= rig.header().causes_active;
  }
  EXPECT_NE(seen & bit(Cause::command_late), 0U);
  EXPECT_EQ(rig.header().cause, Cause::command_lost);
  EXPECT_EQ(seen & bit(Cause::bad_commands), 0U);
}

TEST(Commands, WithoutTheStampOfTheirSensorsTheyNeitherMoveNorArm) {
  TickConfig config = robot(2);
  config.policy.needs_outside_stamp = true;
  Rig rig(config);
  rig.run_with_policy(100, 0.0F);
  EXPECT_EQ(rig.header().seats[Seat::policy].last_refusal, Arrival::missing_stamp);
  EXPECT_EQ(rig.header().seats[Seat::policy].freshness, Freshness::missing);
  EXPECT_TRUE(blocks(rig, "outside_sensed_at"));
  rig.tick(nullptr, OperatorRequest::arm);
  EXPECT_EQ(rig.mode(), Mode::standby);
}

TEST(Commands, ContendedAndCorruptReadsAreRefusalsOfTheirOwnName) {
  Rig rig(robot(2));
  rig.tick(nullptr, OperatorRequest::none, Arrival::contended);
  EXPECT_EQ(rig.header().seats[Seat::policy].arrival, Arrival::contended);
  rig.tick(nullptr, OperatorRequest::none, Arrival::corrupt);
  EXPECT_EQ(rig.header().seats[Seat::policy].arrival, Arrival::corrupt);
  EXPECT_EQ(rig.header().refused_commands, 2U);
}

TEST(Commands, ARepeatedMessageDoesNotRejuvenate) {
  Rig rig(robot(2));
  rig.arm();
  rig.run_with_policy(100, 0.0F);
  while (!rig.out->observation_due) rig.tick();
  const CommandChunk chunk = chunk_for(rig.config, rig.newest_observation, rig.now, rig.now, ++rig.sequence, 0.1F);
  rig.tick(&chunk);
  ASSERT_EQ(rig.header().seats[Seat::policy].arrival, Arrival::accepted);
  const MonoTime sensed = rig.sensed_at[chunk.header.observation_id];
  for (int i = 0; i < 15; ++i) {
    rig.tick(&chunk);
    EXPECT_EQ(rig.header().seats[Seat::policy].arrival, Arrival::repeated_sequence);
    EXPECT_EQ(rig.header().age.total(), rig.now - sensed);
  }
}

TEST(Commands, ANewPolicySessionMayCountFromOneAgain) {
  Rig rig(robot(2));
  rig.arm();
  rig.run_with_policy(100, 0.0F);
  const CommandChunk first =
      chunk_for(rig.config, rig.newest_observation, rig.published_at[rig.newest_observation], rig.now, 1, 0.0F);
  rig.tick(&first);
  EXPECT_EQ(rig.header().seats[Seat::policy].arrival, Arrival::repeated_sequence);
  rig.input.messages[Seat::policy].session = 9;
  rig.tick(&first);
  EXPECT_EQ(rig.header().seats[Seat::policy].arrival, Arrival::accepted);
  rig.tick(&first);
  EXPECT_EQ(rig.header().seats[Seat::policy].arrival, Arrival::repeated_sequence);
}

TEST(Observation, IsPublishedEveryPeriodWithTheOldestSample) {
  Rig rig(robot(3));
  rig.run(5);
  rig.drives[1].silent = true;
  const MonoTime last_reply = rig.input.joints[1].received_at;
  int due = 0;
  for (int i = 0; i < 100; ++i) {
    rig.tick();
    if (!rig.out->observation_due) continue;
    ++due;
    EXPECT_EQ(rig.out->observation.oldest_sensed_at, last_reply);
    EXPECT_EQ(rig.out->observation.published_at, rig.now);
    EXPECT_EQ(rig.out->observation.id, rig.header().observation_published);
  }
  EXPECT_EQ(due, 5);
}

TEST(InternalError, ResultsThatAreNotFiniteNeverLeave) {
  Rig rig(robot(3));
  rig.arm();
  rig.run_with_policy(100, 0.0F);
  rig.config.joints[1].kd = NAN;
  rig.tick_with_policy(0.0F);
  EXPECT_EQ(rig.mode(), Mode::fault_latched);
  EXPECT_EQ(rig.header().cause, Cause::internal_error);
  for (std::size_t j = 0; j < 3; ++j) {
    EXPECT_EQ(rig.out->setpoints[j].kp, 0.0F);
    EXPECT_EQ(rig.out->setpoints[j].kd, 0.0F);
    EXPECT_EQ(rig.out->setpoints[j].tau, 0.0F);
  }
  rig.tick();
  EXPECT_EQ(rig.out->setpoints[0].kd, rig.config.joints[0].damping) << "damping again once finite";
}

TEST(InternalError, AfterwardsNoModelIsTrusted) {
  TickConfig config = robot(6);
  config.gravity_compensation = true;
  Rig rig(config);
  rig.arm(0.4F);
  rig.run_with_policy(1000, 0.4F);
  rig.config.joints[1].kd = NAN;
  rig.tick_with_policy(0.4F);
  ASSERT_EQ(rig.mode(), Mode::fault_latched);
  rig.run(2);
  for (std::size_t j = 0; j < 6; ++j) {
    EXPECT_TRUE(rig.out->drive_enabled[j]);
    EXPECT_EQ(rig.out->setpoints[j].kp, 0.0F);
    const JointRecord& joint = rig.out->record.joints[j];
    EXPECT_NEAR(joint.tau_total, -rig.config.joints[j].damping * joint.dq_estimate, 0.02F) << j;
  }
}

}  // namespace
}  // namespace takt::pipeline

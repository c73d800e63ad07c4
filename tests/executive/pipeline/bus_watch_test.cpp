// SPDX-License-Identifier: Apache-2.0
// Goal: every bus fault is found while its share is over the limit, and no healthy bus is accused.
// Method: reply counters and bus health written tick by tick for one joint or bus: each fault, each healthy look-alike
// (phase drift, jitter, a stall with its backlog, a silent joint that comes back, counters that wrap); a share is met
// from below and from above; the whole tick around it; a property over random jitter.
#include "executive/pipeline/bus_watch.hpp"

#include <gtest/gtest.h>
#include <rapidcheck/gtest.h>

#include <algorithm>
#include <functional>
#include <random>
#include <vector>

#include "tests/executive/pipeline/rig.hpp"

namespace takt::pipeline {
namespace {

using testing::Rig;
using testing::robot;

constexpr std::uint32_t kSilence = 20;

// One joint whose replies arrive as told.
class Joint {
 public:
  explicit Joint(std::uint8_t counter = 0) : replies_(counter) {
    watch_.replies = counter;
    for (int i = 0; i < 3 * kPatience; ++i) tick(1);
  }
  ReplyEvents tick(int arrived, std::uint32_t excused = 0) {
    replies_ = static_cast<std::uint8_t>(replies_ + arrived);
    const ReplyEvents events = take_replies(watch_, replies_, excused, kSilence);
    note_replies(watch_, events, limits_.window_ticks);
    sum_.lost += events.lost;
    sum_.repeated += events.repeated;
    sum_.delayed += events.delayed;
    seen_ = static_cast<ReplyFaultMask>(seen_ | faults());
    return events;
  }
  void run(int ticks, const std::function<int(int)>& arrivals) {
    for (int i = 0; i < ticks; ++i) tick(arrivals(i));
  }
  [[nodiscard]] ReplyFaultMask faults() const { return reply_faults(watch_, limits_); }
  [[nodiscard]] ReplyFaultMask ever() const { return seen_; }
  [[nodiscard]] const ReplyEvents& sum() const { return sum_; }

 private:
  BusFaultLimits limits_;
  ReplyWatch watch_;
  std::uint8_t replies_;
  ReplyEvents sum_;
  ReplyFaultMask seen_ = 0;
};

TEST(LeakyCount, FollowsTheShareAndForgets) {
  LeakyCount count;
  const auto run = [&count](int ticks, int one_in) {
    for (int i = 0; i < ticks; ++i) count.tick(i % one_in == 0 ? 1 : 0, 1000);
  };
  run(10'000, 4);
  EXPECT_TRUE(count.exceeds(share_of_ticks(0.24), 1000));
  EXPECT_FALSE(count.exceeds(share_of_ticks(0.26), 1000));
  run(1000, 10'000);
  EXPECT_FALSE(count.exceeds(share_of_ticks(0.1), 1000)) << "a window later little is left";
  EXPECT_TRUE(count.exceeds(share_of_ticks(0.05), 1000)) << "but it is no flag that drops at once";
  run(12'000, 20'000);
  EXPECT_FALSE(count.exceeds(1, 1000));
}

TEST(LeakyCount, NeverExceedsTheWhole) {
  for (const std::uint32_t window : {1U, 10U, 1000U, kMaxBusFaultTicks}) {
    LeakyCount count;
    for (int i = 0; i < 2000; ++i) count.tick(255, window);
    EXPECT_FALSE(count.exceeds(kWholeShare, window)) << "a share of 1 switches the fault off";
    EXPECT_TRUE(count.exceeds(share_of_ticks(0.98), window)) << window;
  }
}

TEST(Replies, OneATickIsHealthyAcrossTheCountersWrap) {
  for (const int start : {0, 1, 200, 255}) {
    Joint joint(static_cast<std::uint8_t>(start));
    joint.run(1000, [](int) { return 1; });
    EXPECT_EQ(joint.sum().lost + joint.sum().repeated + joint.sum().delayed, 0U);
  }
}

TEST(Replies, AJointNeverHeardOwesNothing) {
  ReplyWatch watch;
  for (int i = 0; i < 500; ++i) {
    const ReplyEvents events = take_replies(watch, 0, 0, kSilence);
    EXPECT_EQ(events.lost + events.repeated + events.delayed, 0U);
  }
}

TEST(Replies, EachLossIsCountedOnce) {
  Joint joint;
  joint.run(10'000, [](int i) { return i % 10 == 0 ? 0 : 1; });
  EXPECT_NEAR(joint.sum().lost, 1000, 10);
  EXPECT_EQ(joint.sum().repeated, 0U);
  EXPECT_EQ(joint.sum().delayed, 0U);
  EXPECT_EQ(joint.ever(), 0) << "a tenth is below the limit";
}

TEST(Replies, MoreThanTheShareLostIsAFaultUntilItHeals) {
  Joint below, above;
  below.run(10'000, [](int i) { return i % 5 < 3 ? 1 : 0; });  // 2 of 5 lost
  EXPECT_EQ(below.ever(), 0);
  above.run(3000, [](int i) { return i % 5 < 2 ? 1 : 0; });  // 3 of 5 lost
  EXPECT_EQ(above.faults(), bit(ReplyFault::lost));
  above.run(1000, [](int) { return 1; });
  EXPECT_EQ(above.faults(), 0);
}

TEST(Replies, TwoDrivesOnOneIdAreRepetition) {
  Joint joint;
  joint.run(300, [](int) { return 2; });
  EXPECT_EQ(joint.faults(), bit(ReplyFault::repeated));
  EXPECT_EQ(joint.sum().lost + joint.sum().delayed, 0U);
  joint.run(4000, [](int) { return 1; });
  EXPECT_EQ(joint.faults(), 0);
}

TEST(Replies, ASingleFrameTwiceIsNone) {
  Joint joint;
  joint.run(10'000, [](int i) { return i % 20 == 0 ? 2 : 1; });  // a twentieth: below the limit
  EXPECT_NEAR(joint.sum().repeated, 500, 5);
  EXPECT_EQ(joint.ever(), 0);
}

TEST(Replies, BunchesAreDelayAndNothingElse) {
  Joint joint;
  joint.run(5000, [](int i) { return i % 12 == 11 ? 12 : 0; });
  EXPECT_EQ(joint.faults(), bit(ReplyFault::delayed));
  EXPECT_EQ(joint.sum().lost, 0U);
  EXPECT_EQ(joint.sum().repeated, 0U);
}

TEST(Replies, BunchesOfThreeAreJitter) {
  Joint joint;
  joint.run(5000, [](int i) { return i % 3 == 2 ? 3 : 0; });
  EXPECT_EQ(joint.sum().lost + joint.sum().repeated + joint.sum().delayed, 0U);
}

TEST(Replies, AStallAndItsBacklogAreNoFault) {
  for (const int stall : {5, 15, 30, 100, 400}) {
    for (const int portion : {10, 64}) {
      Joint joint;
      int waiting = 0;
      joint.run(2000, [&](int i) {
        ++waiting;
        const int now = i < stall ? 0 : std::min(waiting, portion);
        waiting -= now;
        return now;
      });
      EXPECT_EQ(joint.ever(), 0) << stall << " ticks, " << portion << " at a time";
      EXPECT_EQ(joint.sum().lost, 0U) << stall;
      EXPECT_EQ(joint.sum().repeated, 0U) << stall;
      EXPECT_LE(joint.sum().delayed, kSilence) << stall;
    }
  }
}

TEST(Replies, AShortStallIsDelayCountedReplyByReply) {
  Joint joint;
  for (int i = 0; i < 10; ++i) joint.tick(0);
  EXPECT_EQ(joint.tick(11).delayed, 10U - kSpread);
  EXPECT_EQ(joint.tick(1).delayed, 0U);
}

// Quartz against quartz: 100 ppm is one reply in 10,000 too many or too few.
TEST(Replies, ConstantPhaseDriftIsNoFault) {
  for (const int extra : {2, 0}) {
    Joint joint;
    joint.run(200'000, [extra](int i) { return i % 10'000 == 9'999 ? extra : 1; });
    EXPECT_EQ(joint.ever(), 0);
    EXPECT_LE(joint.sum().lost + joint.sum().repeated, 20U);
    EXPECT_EQ(joint.sum().delayed, 0U);
  }
}

TEST(Replies, SkippedPeriodsExcuseWhatADriveSaidMeanwhile) {
  Joint told, untold;
  EXPECT_EQ(told.tick(31, 30).repeated, 0U);
  EXPECT_EQ(untold.tick(31, 0).repeated, 30U - kSpread);
}

TEST(Replies, ASilentJointIsJudgedAgainOnlyAWhileAfterItIsBack) {
  Joint joint;
  joint.run(5000, [](int) { return 0; });
  EXPECT_EQ(joint.sum().lost, 0U) << "feedback_lost says it";
  joint.tick(200);
  joint.run(kPatience - 2, [](int i) { return i % 2; });
  EXPECT_EQ(joint.sum().repeated + joint.sum().lost + joint.sum().delayed, 0U);
  joint.run(500, [](int) { return 2; });
  EXPECT_EQ(joint.faults(), bit(ReplyFault::repeated)) << "watched again";
}

// Reply k belongs to tick k and arrives then, a tick early or a tick late.
RC_GTEST_PROP(Replies, JitterOfOneTickNeverTrips, (std::uint32_t seed)) {
  constexpr int kTicks = 3000;
  std::mt19937 random(seed);
  std::vector<int> arrivals(kTicks + 2, 0);
  for (int k = 0; k < kTicks; ++k)
    ++arrivals[static_cast<std::size_t>(std::max(0, k - 1 + static_cast<int>(random() % 3)))];
  ReplyWatch watch;
  std::uint8_t replies = 0;
  for (int i = 0; i < kTicks; ++i) {
    replies = static_cast<std::uint8_t>(replies + arrivals[static_cast<std::size_t>(i)]);
    const ReplyEvents events = take_replies(watch, replies, 0, kSilence);
    RC_ASSERT(events.lost + events.repeated + events.delayed == 0U);
  }
}

struct BusCase {
  const char* when;
  void (*happens)(BusHealth&);
  Cause cause;
  int below, above;  // one tick in this many: under, and over the default limit
};
const BusCase kBusCases[] = {
    {"transmit drops", [](BusHealth& h) { h.tx_dropped += 3; }, Cause::transmit_queue_full, 25, 15},
    {"receive drops", [](BusHealth& h) { h.rx_dropped += 7; }, Cause::receive_overflow, 60, 40},
    {"foreign frames", [](BusHealth& h) { ++h.foreign_frames; }, Cause::foreign_node, 60, 40},
    {"babble", [](BusHealth& h) { h.flooded = 1; }, Cause::bus_babble, 12, 8},
    {"error-passive", [](BusHealth& h) { h.state = BusState::error_passive; }, Cause::bus_error_passive, 3, 1},
};

CauseMask run_bus(BusWatch& watch, BusHealth& health, const BusCase& one, int ticks, int one_in) {
  const BusFaultLimits limits;
  CauseMask seen = 0;
  for (int i = 0; i < ticks; ++i) {
    health.flooded = 0;
    health.state = BusState::up;
    if (i % one_in == 0) one.happens(health);
    note_health(watch, health, limits.window_ticks);
    seen |= bus_faults(watch, limits);
  }
  return seen;
}

TEST(Buses, EachFaultIsFoundAboveItsShareAndHeals) {
  for (const BusCase& one : kBusCases) {
    BusWatch watch;
    BusHealth health;
    EXPECT_EQ(run_bus(watch, health, one, 6000, one.below), 0U) << one.when;
    EXPECT_EQ(run_bus(watch, health, one, 4000, one.above), bit(one.cause)) << one.when;
    EXPECT_EQ(bus_faults(watch, {}), bit(one.cause)) << one.when << " still";
    run_bus(watch, health, one, 6000, 1'000'000);
    EXPECT_EQ(bus_faults(watch, {}), 0U) << one.when;
  }
}

TEST(Buses, ACounterThatWrapsIsOneEventLikeAnyOther) {
  for (const BusCase& one : {kBusCases[0], kBusCases[1], kBusCases[2]}) {
    BusWatch watch;
    BusHealth health;
    health.tx_dropped = health.rx_dropped = health.foreign_frames = 0xFFFF'FFFF;
    watch.tx_dropped = watch.rx_dropped = watch.foreign_frames = 0xFFFF'FFFF;
    BusFaultLimits limits;
    limits.window_ticks = 10;  // one event is a tenth
    limits.transmit_drops = limits.receive_drops = limits.foreign_frames = share_of_ticks(0.05);
    one.happens(health);
    note_health(watch, health, limits.window_ticks);
    EXPECT_EQ(bus_faults(watch, limits), bit(one.cause)) << one.when;
  }
}

// The whole tick, each fault on its own, on the second of two buses or on the last joint.
struct TickCase {
  const char* when;
  void (*happens)(Rig&, int tick);
  Cause cause;
  const char* blocks;
};
// Beyond the one that the rig's drive gives in every tick.
void add_replies(Rig& rig, int count) {
  std::uint8_t& replies = rig.input.joints[2].replies;
  replies = static_cast<std::uint8_t>(replies + count);
}
const TickCase kTickCases[] = {
    {"transmit drops", [](Rig& r, int) { ++r.input.buses[1].tx_dropped; }, Cause::transmit_queue_full, "our frames"},
    {"receive drops", [](Rig& r, int) { ++r.input.buses[1].rx_dropped; }, Cause::receive_overflow, "lost on this"},
    {"foreign frames", [](Rig& r, int) { ++r.input.buses[1].foreign_frames; }, Cause::foreign_node,
     "second controller"},
    {"babble", [](Rig& r, int) { r.input.buses[1].flooded = 1; }, Cause::bus_babble, "more frames than"},
    {"error-passive", [](Rig& r, int) { r.input.buses[1].state = BusState::error_passive; }, Cause::bus_error_passive,
     "error-passive"},
    {"lost", [](Rig& r, int i) { add_replies(r, i % 5 < 3 ? -1 : 0); }, Cause::replies_lost, "unanswered"},
    {"repeated", [](Rig& r, int) { add_replies(r, 1); }, Cause::replies_repeated, "share the id"},
    {"delayed", [](Rig& r, int i) { add_replies(r, i % 12 == 11 ? 11 : -1); }, Cause::replies_delayed, "in bunches"},
};

TickConfig two_buses() {
  TickConfig config = robot(3);
  config.bus_count = 2;
  return config;
}

TEST(BusFaults, StopTheRobotDampedAndAreNamed) {
  for (const TickCase& fault : kTickCases) {
    Rig rig(two_buses());
    rig.arm(0.3F);
    rig.run_with_policy(500, 0.3F);
    ASSERT_EQ(rig.mode(), Mode::tracking) << fault.when;
    for (int i = 0; i < 3000 && rig.mode() == Mode::tracking; ++i) {
      fault.happens(rig, i);
      rig.tick_with_policy(0.3F);
    }
    EXPECT_EQ(name(rig.mode()), "damped_stop") << fault.when;
    EXPECT_EQ(name(rig.header().cause), name(fault.cause)) << fault.when;
    EXPECT_TRUE(rig.out->drives_enabled) << fault.when;
    EXPECT_GT(rig.out->setpoints[0].kd, 0.0F) << fault.when;
  }
}

TEST(BusFaults, BlockArmingInStandbyUntilTheyAreGone) {
  for (const TickCase& fault : kTickCases) {
    Rig rig(two_buses());
    rig.run_with_policy(200, 0.0F);
    for (int i = 0; i < 3000; ++i) {
      fault.happens(rig, i);
      rig.tick_with_policy(0.0F);
    }
    EXPECT_EQ(name(rig.mode()), "standby") << fault.when;
    EXPECT_NE(rig.header().causes_active & bit(fault.cause), 0U) << fault.when;
    std::array<ArmingBlocker, 8> blockers;
    ASSERT_EQ(arming_blockers(rig.out->record, rig.config, blockers), 1U) << fault.when;
    EXPECT_NE(blockers[0].what.find(fault.blocks), std::string_view::npos) << fault.when << ": " << blockers[0].what;
    EXPECT_EQ(blockers[0].joint, rig.out->record.joints[2].reply_faults != 0 ? 2 : -1) << fault.when;
    rig.tick_with_policy(0.0F, OperatorRequest::arm);
    EXPECT_EQ(name(rig.mode()), "standby") << fault.when;
    for (BusHealth& bus : rig.input.buses) bus.flooded = 0, bus.state = BusState::up;
    rig.run_with_policy(5000, 0.0F);
    rig.arm();
    EXPECT_EQ(name(rig.mode()), "tracking") << fault.when << " is over";
  }
}

TEST(BusFaults, AShareOfOneSwitchesAFaultOff) {
  for (const TickCase& fault : kTickCases) {
    TickConfig config = two_buses();
    BusFaultLimits& limits = config.bus_faults;
    limits.replies_lost = limits.replies_repeated = limits.replies_delayed = limits.transmit_drops =
        limits.receive_drops = limits.foreign_frames = limits.babble = limits.error_passive = kWholeShare;
    Rig rig(config);
    rig.arm(0.3F);
    for (int i = 0; i < 3000; ++i) {
      fault.happens(rig, i);
      rig.tick_with_policy(0.3F);
    }
    EXPECT_EQ(name(rig.mode()), "tracking") << fault.when;
  }
}

}  // namespace
}  // namespace takt::pipeline

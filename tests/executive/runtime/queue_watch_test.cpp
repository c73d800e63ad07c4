// SPDX-License-Identifier: Apache-2.0
// Goal: a setpoint that would leave a dead bus too old is told in time for a purge, once; nothing else ever is.
// Method: ticks of 1 ms made by hand, with the command's age, and with what the bus says of our frames.
#include "executive/runtime/queue_watch.hpp"

#include <gtest/gtest.h>

namespace takt::runtime {
namespace {

constexpr Duration kMaxAge = milliseconds(150);

MonoTime at(std::int64_t ms) {
  return MonoTime{} + milliseconds(1000 + ms);
}

class Robot {
 public:
  // The tick at `ms`, whose command is `age_ms` old; bus 1 says that its oldest frame waits since `waiting_since`.
  void tick(std::int64_t ms, std::int64_t age_ms, MonoTime waiting_since, Player player = Player::policy) {
    TickRecordHeader header{};
    header.now = at(ms);
    header.player = player;
    header.bus_count = 2;
    header.age.hold = milliseconds(age_ms);
    header.seats[Seat::fallback].age = milliseconds(age_ms);
    header.buses[1].waiting_since = waiting_since;
    watch.take(header);
    told |= watch.overdue(at(ms));
    if (told != 0 && !told_at.is_set()) told_at = at(ms);
  }
  QueueWatch watch{kMaxAge};
  BusMask told = 0;
  MonoTime told_at;
};

TEST(QueueWatch, ABusThatStandsStillIsToldBeforeItsSetpointIsTooOld) {
  for (const Player player : {Player::policy, Player::fallback}) {
    Robot robot;
    for (std::int64_t ms = 0; ms < 10; ++ms) robot.tick(ms, 40 + ms, {}, player);
    // The tick at 9 ms wrote its frame at 9.05 ms; its command was 49 ms old.
    const MonoTime since = at(9) + microseconds(50);
    for (std::int64_t ms = 10; ms < 300; ++ms) robot.tick(ms, 40 + ms, since, ms < 30 ? player : Player::none);
    EXPECT_EQ(robot.told, 0b10U) << name(player);
    EXPECT_EQ(robot.told_at, at(9) + kMaxAge - milliseconds(49) - kLead) << name(player);
  }
}

TEST(QueueWatch, ACommandThatIsNearlyTooOldGetsTheTimeThatEveryBusNeeds) {
  Robot robot;
  for (std::int64_t ms = 0; ms < 10; ++ms) robot.tick(ms, 140, {});
  for (std::int64_t ms = 10; ms < 60; ++ms) robot.tick(ms, 140, at(9));
  EXPECT_EQ(robot.told_at, at(9) + kNormalWait);
}

TEST(QueueWatch, FramesThatLeaveInTimeAreNeverTold) {
  Robot robot;
  for (std::int64_t ms = 0; ms < 2'000; ++ms) robot.tick(ms, 149, ms < 9 ? MonoTime{} : at(ms - 9));
  EXPECT_EQ(robot.told, 0U) << "a slow adapter, nine periods behind, with the oldest commands";
}

TEST(QueueWatch, DampingMayWaitForAsLongAsItWants) {
  Robot robot;
  for (std::int64_t ms = 0; ms < 10; ++ms) robot.tick(ms, 0, {}, Player::none);
  for (std::int64_t ms = 10; ms < 2'000; ++ms) robot.tick(ms, 0, at(9), Player::none);
  EXPECT_EQ(robot.told, 0U);
}

TEST(QueueWatch, AFrameIsToldOnceAndTheNextOneAgain) {
  Robot robot;
  for (std::int64_t ms = 0; ms < 10; ++ms) robot.tick(ms, 50, {});
  for (std::int64_t ms = 10; ms < 400; ++ms) robot.tick(ms, 50, at(9));
  EXPECT_EQ(robot.watch.overdue(at(400)), 0U);
  robot.told = 0;
  for (std::int64_t ms = 400; ms < 600; ++ms) robot.tick(ms, 50, at(399));
  EXPECT_EQ(robot.told, 0b10U);
}

}  // namespace
}  // namespace takt::runtime

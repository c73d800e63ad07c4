// SPDX-License-Identifier: Apache-2.0
// Goal: a sample never becomes young because the process that takes it did not run: true age minus claimed age is at
// most one publishing period, whatever the sender's clock says. Method: a process in time that the test makes: it waits
// and takes as the programs do, is stopped for 0.1 to 5 s at random, and finds what came meanwhile at once or a while
// after it goes on. Seeded.
#include "sensors/wait_start.hpp"

#include <gtest/gtest.h>

#include <random>
#include <vector>

#include "sensors/imu/imu_reading.hpp"
#include "sensors/ros/ros_stamp.hpp"

namespace takt::sensors {
namespace {

constexpr MonoTime kStart{50'000'000'000};
constexpr std::int64_t kUnix = 1'700'000'000'000'000'000;
constexpr Duration kPatience = milliseconds(5);

struct Taken {
  MonoTime sent;
  Heard heard;
};

struct Stop {
  MonoTime at;
  Duration lasts;
  Duration delivery;  // after it, until what was kept on the way is there
};

// What a process takes that is stopped once. `sent`: rising.
std::vector<Taken> take(const std::vector<MonoTime>& sent, const Stop& stop, MonoTime until) {
  const MonoTime goes_on = stop.at + stop.lasts;
  const auto running = [&](MonoTime at) { return at >= stop.at && at < goes_on ? goes_on : at; };
  const auto there = [&](MonoTime at) {
    const MonoTime came = at + microseconds(200);
    return came >= stop.at && came < goes_on ? goes_on + stop.delivery : came;
  };
  std::vector<Taken> taken;
  WaitStart waits(kPatience);
  std::size_t next = 0;
  for (MonoTime now = running(kStart); now < until; now = running(now + microseconds(30))) {
    waits.begin(now);
    const MonoTime limit = now + kPatience;
    const MonoTime woken = next < sent.size() ? std::min(std::max(there(sent[next]), now), limit) : limit;
    now = running(woken + microseconds(20));
    for (; next < sent.size() && there(sent[next]) <= now; ++next) taken.push_back({sent[next], waits.taken(now)});
  }
  return taken;
}

struct Situation {
  Duration period;
  Stop stop;
  std::vector<MonoTime> sent;
};

std::vector<Situation> situations() {
  std::mt19937_64 random(20);
  const auto uniform = [&random](std::int64_t low, std::int64_t high) {
    return microseconds(std::uniform_int_distribution(low, high)(random));
  };
  std::vector<Situation> all;
  for (const Duration lasts : {milliseconds(100), milliseconds(350), milliseconds(2'200), milliseconds(5'000)})
    for (const Duration period : {milliseconds(5), milliseconds(10), milliseconds(33), milliseconds(100)})
      for (const Duration delivery : {Duration{}, milliseconds(1), milliseconds(40)})
        for (int i = 0; i < 20; ++i) {
          Situation one{period, {kStart + uniform(500'000, 700'000), lasts, delivery}, {}};
          // The sender may be gone by the end of it: what it wrote last is all that is found.
          const MonoTime gone =
              i % 2 == 0 ? one.stop.at + uniform(0, lasts.ns / 1000) : one.stop.at + lasts + seconds(1);
          for (MonoTime at = kStart + uniform(0, period.ns / 1000); at < gone; at = at + period) one.sent.push_back(at);
          all.push_back(one);
        }
  return all;
}

enum class Clock : std::uint8_t { ours, ahead, none };

TEST(WaitStart, ARosSampleIsNoYoungerForAStopOfTheProcess) {
  for (const Clock clock : {Clock::ours, Clock::ahead, Clock::none}) {
    int found = 0;
    for (const Situation& one : situations()) {
      SenderClock sender;
      for (const Taken& taken : take(one.sent, one.stop, one.stop.at + one.stop.lasts + seconds(1))) {
        const std::int64_t written = kUnix + taken.sent.ns + (clock == Clock::ahead ? seconds(10).ns : 0);
        const SensedAt sensed =
            sender.take({0, clock == Clock::none ? 0 : written}, {taken.heard, kUnix + taken.heard.at.ns});
        ASSERT_LE(sensed.at - taken.sent, one.period)
            << "clock " << static_cast<int>(clock) << ", stopped for " << one.stop.lasts.milliseconds() << " ms";
        // While it runs it makes none much older than it is.
        if (taken.heard.at < one.stop.at) {
          ASSERT_LE(taken.sent - sensed.at, kPatience + milliseconds(1));
        }
        found += taken.heard.at >= one.stop.at + one.stop.lasts ? 1 : 0;
      }
    }
    EXPECT_GT(found, 1'000) << "hardly a sample was found after a stop";
  }
}

// Back to what it was, well before a second has passed.
TEST(WaitStart, AStopIsOverSoonAfterIt) {
  for (const Situation& one : situations()) {
    SenderClock sender;
    for (const Taken& taken : take(one.sent, one.stop, one.stop.at + one.stop.lasts + seconds(1))) {
      const SensedAt sensed = sender.take({0, kUnix + taken.sent.ns + seconds(10).ns}, {taken.heard, kUnix});
      if (taken.sent > one.stop.at + one.stop.lasts + WaitStart::kDelivery + milliseconds(10)) {
        ASSERT_LE(taken.sent - sensed.at, kPatience + milliseconds(1));
      }
    }
  }
}

// An IMU's first sample, and all of a part that boots anew in the stop; its clock tells nothing of either.
TEST(WaitStart, AnImuSampleIsNoYoungerForAStopOfTheProcess) {
  for (const bool boots_anew : {false, true}) {
    for (const Situation& one : situations()) {
      ImuReading reading({1, 0, 0, 0});
      std::uint16_t counter = 0;
      for (const Taken& taken : take(one.sent, one.stop, one.stop.at + one.stop.lasts + seconds(1))) {
        if (!boots_anew && taken.heard.at < one.stop.at) continue;  // opened just before the stop
        const std::int64_t ticks = (taken.sent - (taken.sent < one.stop.at ? MonoTime{} : one.stop.at)).ns / 100'000;
        const auto made = reading.take(
            {.counter = ++counter, .ticks = static_cast<std::uint32_t>(ticks), .rotation = {1, 0, 0, 0}}, taken.heard);
        ASSERT_LE(made->sensed_at - taken.sent, one.period) << "stopped for " << one.stop.lasts.milliseconds() << " ms";
      }
    }
  }
}

TEST(WaitStart, AStopCountsForAWhileAndThenNoMore) {
  WaitStart waits(milliseconds(5));
  waits.begin(kStart);
  EXPECT_EQ(waits.since(kStart + seconds(2)), kStart) << "however long the wait";
  const MonoTime again = kStart + seconds(2);
  waits.begin(again);
  EXPECT_EQ(waits.since(again + milliseconds(4)), kStart);
  MonoTime now = again;
  for (; now <= again + WaitStart::kDelivery; now = now + milliseconds(5)) {
    waits.begin(now);
    EXPECT_EQ(waits.since(now), kStart);
  }
  waits.begin(now);
  EXPECT_EQ(waits.since(now + milliseconds(1)), now);
}

// A machine that is slow for good, not stopped, is not taken for ever to be where it was.
TEST(WaitStart, SlownessForGoodCostsNoMoreThanTheDelivery) {
  WaitStart waits(milliseconds(5));
  MonoTime now = kStart;
  for (int i = 0; i < 1'000; ++i) {
    waits.begin(now);
    now = now + milliseconds(30);
    ASSERT_LE(now - waits.since(now), WaitStart::kDelivery + milliseconds(60));
  }
}

}  // namespace
}  // namespace takt::sensors

// SPDX-License-Identifier: Apache-2.0
// Goal: each fault of a drive's connection does what it is called, and nothing else; nothing is ever reordered.
// Method: numbered frames in virtual time; what arrives is listed with the millisecond of its arrival.
#include "simulation/reply_path.hpp"

#include <gtest/gtest.h>

#include <algorithm>
#include <span>
#include <utility>
#include <vector>

#include "config/load.hpp"
#include "simulation/plant.hpp"

namespace takt::simulation {
namespace {

using Arrivals = std::vector<std::pair<int, int>>;  // millisecond, number of the frame

class ReplyPathTest : public testing::Test {
 protected:
  // Frames `first` to `last`, one per millisecond, then `quiet` milliseconds without.
  void say(int first, int last, int quiet = 0) {
    for (int number = first; number <= last + quiet; ++number, ++ms_) {
      const MonoTime now = MonoTime{1} + milliseconds(ms_);
      if (number <= last) path_.take({drivers::CanFrame{.id = static_cast<std::uint32_t>(number)}}, now);
      Frames arrived;
      path_.deliver(now, arrived);
      for (const drivers::CanFrame& frame : arrived) arrivals_.emplace_back(ms_, static_cast<int>(frame.id));
    }
  }
  ReplyPath path_{7};
  Arrivals arrivals_;
  int ms_ = 0;
};

TEST_F(ReplyPathTest, WithoutAFaultEverythingArrivesAtOnce) {
  say(0, 3);
  EXPECT_EQ(arrivals_, (Arrivals{{0, 0}, {1, 1}, {2, 2}, {3, 3}}));
}

TEST_F(ReplyPathTest, SilentLosesWhatIsSaidMeanwhileAndOnlyThat) {
  say(0, 0);
  path_.set({.silent = true});
  say(1, 2);
  path_.set({});
  say(3, 3);
  EXPECT_EQ(arrivals_, (Arrivals{{0, 0}, {3, 3}}));
}

TEST_F(ReplyPathTest, RepeatDeliversEachTwiceInARow) {
  path_.set({.repeat = true});
  say(0, 1);
  EXPECT_EQ(arrivals_, (Arrivals{{0, 0}, {0, 0}, {1, 1}, {1, 1}}));
}

TEST_F(ReplyPathTest, DelayedFramesArriveLateAndKeepTheirOrderWhenTheDelayEnds) {
  path_.set({.delay = milliseconds(3)});
  say(0, 2);
  path_.set({});
  say(3, 4, 3);
  // 0 to 2 are on their way until 3, 4 and 5 ms; 3 and 4, said at 3 and 4 ms, do not overtake 2.
  EXPECT_EQ(arrivals_, (Arrivals{{3, 0}, {4, 1}, {5, 2}, {5, 3}, {5, 4}}));
}

TEST_F(ReplyPathTest, WhatWasOnItsWayArrivesThoughTheDriveFellSilent) {
  path_.set({.delay = milliseconds(2)});
  say(0, 0);
  path_.set({.silent = true});
  say(1, 1, 2);
  EXPECT_EQ(arrivals_, (Arrivals{{2, 0}}));
}

TEST_F(ReplyPathTest, DropLosesItsShareTheSameOnesForTheSameSeed) {
  path_.set({.drop = 0.3});
  say(0, 9999);
  EXPECT_NEAR(static_cast<double>(arrivals_.size()), 7000, 200);  // 4 sigma: 183
  ReplyPath same(7), other(8);
  Frames from_same, from_other;
  for (ReplyPath* path : {&same, &other}) path->set({.drop = 0.3});
  for (std::uint32_t i = 0; i < 10'000; ++i) {
    same.take({drivers::CanFrame{.id = i}}, MonoTime{1});
    other.take({drivers::CanFrame{.id = i}}, MonoTime{1});
    same.deliver(MonoTime{1}, from_same);
    other.deliver(MonoTime{1}, from_other);
  }
  ASSERT_EQ(from_same.size(), arrivals_.size());
  for (std::size_t i = 0; i < from_same.size(); ++i)
    ASSERT_EQ(static_cast<int>(from_same[i].id), arrivals_[i].second) << i;
  bool differs = from_other.size() != from_same.size();
  for (std::size_t i = 0; !differs && i < from_same.size(); ++i) differs = from_other[i].id != from_same[i].id;
  EXPECT_TRUE(differs);
}

TEST_F(ReplyPathTest, DropOfOneLosesAll) {
  path_.set({.drop = 1});
  say(0, 999);
  EXPECT_TRUE(arrivals_.empty());
}

TEST_F(ReplyPathTest, WhatIsOnItsWayIsBounded) {
  path_.set({.delay = seconds(100)});
  say(0, 2 * static_cast<int>(ReplyPath::kMaxOnTheWay));
  Frames arrived;
  path_.deliver(MonoTime{1} + seconds(1000), arrived);
  EXPECT_EQ(arrived.size(), ReplyPath::kMaxOnTheWay);
}

// A plant takes a short way where nothing is wrong with a line; it has to see that something is still on its way.
TEST(PlantLine, ThatIsWellAgainKeepsTheOrder) {
  config::RobotConfig robot = config::load("config/arm6.yaml").value();
  robot.joints.resize(1);  // a Damiao drive
  ASSERT_EQ(robot.joints[0].bus, 0U);
  Plant plant = Plant::on_free_inertias(robot).value();
  drivers::CanFrame frame{.id = robot.joints[0].drive.id, .length = 8};
  std::ranges::fill(std::span(frame.data).first<8>(), std::uint8_t{0xFF});
  Frames answers;
  const auto say = [&](std::uint8_t code) {
    frame.data[7] = code;
    return plant.receive(0, frame, answers);
  };
  const auto reported = [&](std::size_t answer) { return answers.at(answer).data[0] >> 4; };

  EXPECT_TRUE(say(0xFC));  // answered before it is obeyed: disabled
  ASSERT_EQ(answers.size(), 1U);
  EXPECT_EQ(reported(0), 0);
  plant.set_line(0, {.delay = milliseconds(5)});
  EXPECT_TRUE(say(0xFD));  // enabled
  plant.set_line(0, {});
  EXPECT_TRUE(say(0xFD));  // disabled again
  EXPECT_EQ(answers.size(), 1U);
  while (plant.now() < MonoTime{1} + milliseconds(5)) plant.step();
  plant.collect(0, answers);
  ASSERT_EQ(answers.size(), 3U);
  EXPECT_EQ(reported(1), 1);
  EXPECT_EQ(reported(2), 0);
}

}  // namespace
}  // namespace takt::simulation

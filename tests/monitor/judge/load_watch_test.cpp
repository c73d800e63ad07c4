// SPDX-License-Identifier: Apache-2.0
// Goal: masses that are not the robot's are said once after each arming, and nothing else is. Method: the demo arm at
// rest, its measured torque a multiple of what the model says; every condition of the rest broken in turn.
#include "monitor/judge/load_watch.hpp"

#include <gtest/gtest.h>

#include <limits>

#include "config/load.hpp"

namespace takt::monitor {
namespace {

constexpr int kRestTicks = 501;
constexpr float kModel = 10;  // Nm, far beyond a gear's friction

class LoadWatchTest : public testing::Test {
 protected:
  static config::RobotConfig robot() { return config::load("config/arm6.yaml").value(); }
  // All joints at rest; joint 1 measures `measured`.
  [[nodiscard]] TickRecord at_rest(float measured) const {
    TickRecord record;
    record.header.joint_count = static_cast<std::uint8_t>(robot_.joints.size());
    record.header.drives_enabled = 1;
    for (std::size_t joint = 0; joint < robot_.joints.size(); ++joint) {
      record.joints[joint].drive_enabled = 1;
      record.joints[joint].feedback.tau = record.joints[joint].tau_gravity = joint == 1 ? kModel : 0;
    }
    record.joints[1].feedback.tau = measured;
    return record;
  }
  std::vector<LoadMismatch> after(TickRecord record, int ticks, LoadWatch& watch) {
    std::vector<LoadMismatch> all;
    for (int tick = 0; tick < ticks; ++tick) {
      now_ = now_ + milliseconds(1);
      record.header.now = now_;
      record.header.tick = ++tick_;
      const auto found = watch.tick(record);
      all.insert(all.end(), found.begin(), found.end());
    }
    return all;
  }
  std::vector<LoadMismatch> after(const TickRecord& record, int ticks) { return after(record, ticks, watch_); }

  const config::RobotConfig robot_ = robot();
  LoadWatch watch_{robot_};
  MonoTime now_;
  std::uint64_t tick_ = 0;
};

TEST_F(LoadWatchTest, AHeavierArmIsSaidOncePerArming) {
  const TickRecord heavy = at_rest(1.5F * kModel);
  ASSERT_TRUE(after(heavy, kRestTicks - 1).empty()) << "half a second is awaited";
  const auto found = after(heavy, 1);
  ASSERT_EQ(found.size(), 1U);
  EXPECT_EQ(found[0].joint, 1U);
  EXPECT_NEAR(found[0].measured, 15, 1e-3);
  EXPECT_EQ(sentence_of(found[0], robot_),
            "joint shoulder holds 15 Nm at rest, by `model` 10 (+50 %): correct the "
            "masses, or enter what it carries; a stop carries what `model` says");
  EXPECT_TRUE(after(heavy, 3 * kRestTicks).empty());
  TickRecord off = heavy;
  off.header.drives_enabled = 0;
  EXPECT_TRUE(after(off, 1).empty());
  EXPECT_EQ(after(heavy, kRestTicks).size(), 1U) << "armed anew";
}

TEST_F(LoadWatchTest, ALighterArmAndAWrongSignAreSaid) {
  EXPECT_EQ(after(at_rest(0.5F * kModel), kRestTicks).size(), 1U);
  LoadWatch another(robot_);
  EXPECT_EQ(after(at_rest(-kModel), kRestTicks, another).size(), 1U);
}

TEST_F(LoadWatchTest, WhatFitsAndWhatFrictionHoldsIsNot) {
  EXPECT_TRUE(after(at_rest(1.19F * kModel), kRestTicks).empty());
  LoadWatch another(robot_);
  TickRecord rubs = at_rest(kModel);
  rubs.joints[5].feedback.tau = static_cast<float>(0.049 * robot_.joints[5].limits.torque);
  EXPECT_TRUE(after(rubs, kRestTicks, another).empty()) << "the model says 0, the gear holds the rest";
}

TEST_F(LoadWatchTest, OnlyARestOnDrivesIsJudged) {
  const TickRecord heavy = at_rest(2 * kModel);
  const auto spoiled = [&](auto spoil) {
    LoadWatch watch(robot_);
    TickRecord once = heavy;
    spoil(once);
    std::size_t found = after(heavy, kRestTicks - 1, watch).size();
    found += after(once, 1, watch).size();
    return found + after(heavy, kRestTicks - 1, watch).size();
  };
  EXPECT_EQ(spoiled([](TickRecord&) {}), 1U);
  EXPECT_EQ(spoiled([](TickRecord& once) { once.joints[3].dq_estimate = 0.03F; }), 0U);
  EXPECT_EQ(spoiled([](TickRecord& once) { once.joints[3].drive_enabled = 0; }), 0U);
  EXPECT_EQ(spoiled([](TickRecord& once) {
              once.joints[3].feedback.tau = once.joints[3].dq_estimate = std::numeric_limits<float>::quiet_NaN();
            }),
            0U);
  EXPECT_EQ(spoiled([](TickRecord& once) { once.header.joint_count = 2; }), 0U);
}

TEST_F(LoadWatchTest, NothingIsSaidWithoutAModelOrOnLegs) {
  config::RobotConfig without = robot_, legged = robot_;
  without.model.reset();
  legged.imu.emplace();
  for (const config::RobotConfig& robot : {without, legged}) {
    LoadWatch watch(robot);
    EXPECT_TRUE(after(at_rest(3 * kModel), 2 * kRestTicks, watch).empty());
  }
}

}  // namespace
}  // namespace takt::monitor

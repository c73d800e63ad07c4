// SPDX-License-Identifier: Apache-2.0
// Goal: each outside sensor's share of the ages has its name, and nothing else is counted as one. Method: the demo arm
// with a camera beside its target; observations at known instants, answers whose samples were sensed so long before.
#include "monitor/judge/sensor_ages.hpp"

#include <gtest/gtest.h>

#include "config/load.hpp"

namespace takt::monitor {
namespace {

constexpr std::uint32_t kTarget = 0, kCamera = 1;

class SensorAgesTest : public testing::Test {
 protected:
  static config::RobotConfig robot() {
    config::RobotConfig robot = config::load("config/arm6.yaml").value();
    config::Sensor camera = robot.sensors[0];
    camera.name = "cam0";
    robot.sensors.push_back(camera);
    return robot;
  }
  static MonoTime published(std::uint64_t observation) {
    return MonoTime{} + seconds(10) + milliseconds(20) * static_cast<std::int64_t>(observation);
  }
  void publish(std::uint64_t observation) {
    TickRecordHeader header;
    header.observation_published = observation;
    header.now = published(observation);
    ages_.tick(header);
    ages_.tick(TickRecordHeader{});  // one that publishes none
  }
  static PolicyInputSample sample(std::uint32_t sensor, std::uint64_t observation, std::int64_t before_ms) {
    PolicyInputSample one;
    one.sequence = observation;
    one.sensor = sensor;
    one.sensed_at = published(observation) - milliseconds(before_ms);
    return one;
  }
  void answer(std::uint64_t observation, std::vector<PolicyInputSample> samples, Player sender = Player::policy) {
    RecordedPolicyInput recorded;
    recorded.sender = sender;
    recorded.input.header.observation_id = observation;
    recorded.input.samples = std::move(samples);
    ages_.input(recorded);
  }

  const config::RobotConfig robot_ = robot();
  SensorAges ages_{robot_};
};

TEST_F(SensorAgesTest, EachIsAsOldAsItsNewestSampleWasWhenAsked) {
  for (std::uint64_t observation = 1; observation <= 3; ++observation) publish(observation);
  // Of a history the newest counts.
  answer(1, {sample(kCamera, 1, 80), sample(kCamera, 1, 40), sample(kTarget, 1, 10)});
  answer(2, {sample(kCamera, 2, 60), sample(kTarget, 2, 10)});
  answer(3, {sample(kCamera, 3, 5), sample(kTarget, 3, 30)});
  const std::vector<SensorAge> ages = ages_.ages();
  ASSERT_EQ(ages.size(), 2U);
  EXPECT_EQ(ages[0].sensor, "target");
  EXPECT_EQ(ages[1].sensor, "cam0");
  EXPECT_EQ(ages[1].age.count, 3U);
  EXPECT_EQ(ages[1].age.p50, 40e6);
  EXPECT_EQ(ages[1].age.max, 60e6);
  EXPECT_EQ(ages[1].oldest, 2U);
  EXPECT_EQ(ages[0].oldest, 1U);
}

TEST_F(SensorAgesTest, WhatNobodySensedAndWhoIsNotInChargeDoNotCount) {
  publish(7);
  PolicyInputSample absent = sample(kTarget, 7, 0);
  absent.sequence = UINT64_MAX;
  answer(7, {absent, sample(9, 7, 50)});                  // a person who says nothing; no sensor of this robot
  answer(8, {sample(kCamera, 8, 50)});                    // an observation that was not recorded
  answer(7, {sample(kCamera, 7, 50)}, Player::fallback);  // not of the policy in charge
  EXPECT_TRUE(ages_.ages().empty());
}

}  // namespace
}  // namespace takt::monitor

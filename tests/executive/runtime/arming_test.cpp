// SPDX-License-Identifier: Apache-2.0
// Goal: an operator whom the robot refuses to arm is told what the drive itself said, not only that it said something.
// Method: a record in which one drive reports that its time-out is off, and the sentence that comes of it.
#include "executive/runtime/arming.hpp"

#include <gtest/gtest.h>

#include <algorithm>
#include <memory>
#include <string_view>

#include "config/load.hpp"
#include "drivers/protocol/joint_driver.hpp"
#include "executive/setup/tick_config_of.hpp"

namespace takt::runtime {
namespace {

TEST(Arming, ARefusalNamesTheSettingThatTheDriveLacks) {
  const config::RobotConfig robot = config::load("config/arm6.yaml").value();
  const auto config = std::make_unique<pipeline::TickConfig>(setup::tick_config_of(robot, 1));
  const auto record = std::make_unique<TickRecord>();
  record->header.tick = 1;
  record->header.joint_count = static_cast<std::uint32_t>(robot.joints.size());
  record->header.now = MonoTime{1'000'000};
  for (std::size_t joint = 0; joint < robot.joints.size(); ++joint) {
    JointFeedback& feedback = record->joints[joint].feedback;
    feedback.received_at = record->header.now;
    feedback.drive_state = DriveState::disabled;
  }
  JointFeedback& elbow = record->joints[2].feedback;
  elbow.drive_state = DriveState::fault;
  elbow.error_code = drivers::setup_fault_code(drivers::SetupFault::watchdog_off, 9);
  std::string all;
  for (const std::string& sentence :
       missing_for_arming(*record, *config, robot, {.policy_attached = true, .realtime = true}))
    all += sentence + "\n";
  EXPECT_NE(all.find("joint " + robot.joints[2].name +
                     ": the drive reports a fault: the drive's own time-out is off or longer than 1 s"),
            std::string::npos)
      << all;
  EXPECT_NE(all.find("time-out (register 9)"), std::string::npos) << all;
}

TEST(Arming, SaysWhatTheProcessItselfLacks) {
  const config::RobotConfig robot = config::load("config/arm6.yaml").value();
  const auto config = std::make_unique<pipeline::TickConfig>(setup::tick_config_of(robot, 1));
  const auto record = std::make_unique<TickRecord>();
  const auto says = [&](const ArmingSituation& situation, std::string_view text) {
    const auto sentences = missing_for_arming(*record, *config, robot, situation);
    return std::ranges::any_of(sentences, [&](const std::string& one) { return one.find(text) != std::string::npos; });
  };
  EXPECT_TRUE(says({.realtime = true}, "no policy is attached"));
  EXPECT_FALSE(says({.policy_attached = true, .realtime = true}, "no policy is attached"));
  EXPECT_TRUE(says({.realtime = true, .policy_in_file = false}, "the robot file has no `policy`"));
  EXPECT_FALSE(says({.realtime = true, .policy_in_file = false}, "no policy is attached"));
  record->header.candidate.in_charge = 1;
  EXPECT_TRUE(says({.realtime = true}, "the candidate in charge does not run"));
  EXPECT_FALSE(says({.realtime = true}, "no policy is attached"));
  record->header.candidate.in_charge = 0;
  EXPECT_TRUE(says({.policy_attached = true}, "real-time set-up is incomplete"));
  EXPECT_FALSE(says({.policy_attached = true, .allow_non_realtime = true}, "real-time set-up is incomplete"));
  EXPECT_TRUE(says({.policy_attached = true}, "the control loop has not run yet"));
  record->header.tick = 1;
  EXPECT_FALSE(says({.policy_attached = true}, "the control loop has not run yet"));
  EXPECT_TRUE(says({.shutting_down = true}, "shutting down"));
}

// Goal: a bus that takes our frames again, while the share of dropped ones still falls to its limit, is not told as one
// without another node: share, limit and the time left are. Method: 400 ticks with a drop in each, 200 of them bus-off,
// then ticks without; as many more as the sentence names clear the fault of the executive's own watch.
TEST(Arming, AShareThatStillFallsIsToldAsOne) {
  const config::RobotConfig robot = config::load("config/arm6.yaml").value();
  const auto config = std::make_unique<pipeline::TickConfig>(setup::tick_config_of(robot, 1));
  const auto record = std::make_unique<TickRecord>();
  TickRecordHeader& header = record->header;
  header.bus_count = static_cast<std::uint8_t>(robot.buses.size());
  BusShares shares(*config);
  const auto watch = std::make_unique<pipeline::LinkWatch>();
  const auto go = [&](int ticks, BusState state, std::uint32_t drops) {
    for (int i = 0; i < ticks; ++i) {
      header.now = MonoTime{config->period.ns * static_cast<std::int64_t>(++header.tick)};
      header.buses[1].state = state;
      header.buses[1].tx_dropped += drops;
      pipeline::watch_links(*watch, *config, *record);
      header.causes_active = pipeline::link_faults(*watch, *record, *config);
      shares.take(header);
    }
  };
  const auto of_buses = [&] {
    std::string all;
    for (const std::string& sentence : missing_for_arming(*record, *config, robot, {&shares, true, true}))
      if (sentence.find("bus") != std::string::npos || sentence.find("CAN") != std::string::npos)
        all += sentence + "\n";
    return all;
  };
  const std::string asks = "a CAN bus does not take our frames: is another node there to acknowledge them?\n";
  go(100, BusState::up, 0);
  EXPECT_EQ(of_buses(), "");
  go(200, BusState::up, 1);
  EXPECT_EQ(of_buses(), asks);
  go(200, BusState::bus_off, 1);
  EXPECT_EQ(of_buses(), "") << "that it is off is another sentence";
  go(50, BusState::up, 0);
  EXPECT_EQ(of_buses(), asks) << "not over before 100 ms";
  go(1000, BusState::up, 0);
  EXPECT_EQ(of_buses(), "bus " + robot.buses[1].name +
                            ": no dropped frame for 1.1 s, but bus_faults.transmit_drops is still 12 % (limit 5 %): "
                            "wait 0.8 s\n");
  go(900, BusState::up, 0);
  EXPECT_EQ(of_buses(), "") << "as long as was said, and a little";
  go(300, BusState::up, 1);
  EXPECT_EQ(of_buses(), asks) << "a fault that comes again";
}

// Goal: a policy is not blamed for commands that it cannot give, for want of observations. Method: the demo arm with
// some joints silent, one that never answered, all, and none; then with the silent IMU of a free base.
TEST(Observations, ASilentJointOrSensorIsNamedAndNotThePolicy) {
  config::RobotConfig robot = config::load("config/arm6.yaml").value();
  const auto config = std::make_unique<pipeline::TickConfig>(setup::tick_config_of(robot, 1));
  const auto record = std::make_unique<TickRecord>();
  TickRecordHeader& header = record->header;
  header.joint_count = static_cast<std::uint32_t>(robot.joints.size());
  header.tick = 1;
  header.now = MonoTime{} + seconds(5);
  const auto lack = [&] { return lack_of_observations(*record, *config, robot); };
  for (std::size_t joint = 0; joint < robot.joints.size(); ++joint)
    record->joints[joint].feedback.received_at = header.now - config->feedback_timeout;
  EXPECT_EQ(lack(), "");
  record->joints[3].feedback.received_at = header.now - milliseconds(21);
  EXPECT_EQ(lack(), "it gets no fresh observation: joint wrist_roll is silent");
  record->joints[0].feedback.received_at = {};
  EXPECT_EQ(lack(), "it gets no fresh observation: joints base_yaw, wrist_roll are silent");
  for (std::size_t joint = 0; joint < robot.joints.size(); ++joint) record->joints[joint].feedback.received_at = {};
  EXPECT_EQ(lack(), "it gets no fresh observation: joints base_yaw, shoulder, elbow and 3 more are silent");
  for (std::size_t joint = 0; joint < robot.joints.size(); ++joint)
    record->joints[joint].feedback.received_at = header.now;
  robot.imu = config::Imu{.sensor = "torso", .tilt = 1.0, .angular_velocity = 6.0, .frozen_after = {}};
  config->imu.present = true;
  config->imu.timeout = milliseconds(50);
  header.imu.sensed_at = header.now - milliseconds(50);
  EXPECT_EQ(lack(), "");
  header.imu.sensed_at = header.now - milliseconds(51);
  EXPECT_EQ(lack(), "it gets no fresh observation: sensor torso is silent");
}

// Goal: who is refused a reset learns which joint to look at. Method: three joints, of which the fastest is not asked.
TEST(Reset, NamesTheFastestJointThatIsAskedToRest) {
  const config::RobotConfig robot = config::load("config/arm6.yaml").value();
  const auto config = std::make_unique<pipeline::TickConfig>(setup::tick_config_of(robot, 1));
  const auto record = std::make_unique<TickRecord>();
  record->header.joint_count = 6;
  record->joints[0].dq_estimate = 2;
  record->joints[1].dq_estimate = 0.04F;
  record->joints[3].dq_estimate = -0.05F;
  const JointMask all_but_first = 0b111110;
  EXPECT_TRUE(still_moves(*record, all_but_first, *config, robot.joints)
                  .starts_with("joint " + robot.joints[3].name +
                               " still moves, at 0.05 rad/s, and rests once below 0.02 for 100 ms: wait until "))
      << still_moves(*record, all_but_first, *config, robot.joints);
  EXPECT_TRUE(still_moves(*record, 0, *config, robot.joints).starts_with("the robot still moves: wait until "));
}

}  // namespace
}  // namespace takt::runtime

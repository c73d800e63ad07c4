// SPDX-License-Identifier: Apache-2.0
// Goal: a joint's configuration becomes a driver, or one sentence that names the joint.
#include "drivers/protocol/protocol_table.hpp"

#include <gtest/gtest.h>

#include <array>

#include "config/load.hpp"

namespace takt::drivers {
namespace {

TEST(MakeDriver, BuildsEveryJointOfTheDemoArm) {
  const auto robot = config::load("config/arm6.yaml");
  ASSERT_TRUE(robot) << robot.error();
  for (std::size_t joint = 0; joint < robot->joints.size(); ++joint) {
    const auto driver = make_joint_driver(*robot, joint);
    ASSERT_TRUE(driver) << driver.error();
    std::array<CanFrame, kMaxFramesPerDrive> out;
    ASSERT_EQ((*driver)->encode(false, {}, {}, {}, out), 1U);
    EXPECT_EQ(out[0].id, robot->joints[joint].drive.id);
  }
}

TEST(MakeDriver, RefusesWhatItCannotBuild) {
  config::Joint good;
  good.name = "elbow";
  good.drive.variant = "tmotor";
  good.drive.id = 1;
  good.drive.position_range = 12.5;
  good.drive.velocity_range = 50;
  good.drive.torque_range = 18;
  good.drive.kp_range = 500;
  good.drive.kd_range = 5;
  config::RobotConfig robot;
  robot.joints = {good};
  ASSERT_TRUE(make_joint_driver(robot, 0));
  const auto refused_for = [&good](auto spoil) {
    config::RobotConfig bad;
    bad.joints = {good};
    spoil(bad.joints[0].drive);
    const auto driver = make_joint_driver(bad, 0);
    return driver ? std::string("accepted") : driver.error();
  };
  using config::Drive;
  EXPECT_EQ(refused_for([](Drive& d) { d.variant = "x"; }),
            "joint elbow: mit variant 'x' is unknown: write tmotor, damiao or robstride");
  EXPECT_NE(refused_for([](Drive& d) { d.torque_range = 0; }).find("ranges"), std::string::npos);
  EXPECT_NE(refused_for([](Drive& d) { d.id = 0x800; }).find("11-bit"), std::string::npos);
  EXPECT_NE(refused_for([](Drive& d) { d.direction = 2; }).find("direction"), std::string::npos);
  EXPECT_NE(refused_for([](Drive& d) { d.gear_ratio = 0; }).find("gear_ratio"), std::string::npos);
}

}  // namespace
}  // namespace takt::drivers

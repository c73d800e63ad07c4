// SPDX-License-Identifier: Apache-2.0
// Goal: a bus that cannot carry its load is refused with the arithmetic. Expectations worked out from ISO 11898-1.
#include "drivers/protocol/bus_load.hpp"

#include <gtest/gtest.h>

namespace takt::drivers {
namespace {

TEST(BusLoad, BitsOfAFrame) {
  EXPECT_EQ(least_frame_bits(8, false), 111U);
  EXPECT_EQ(most_frame_bits(8, false), 135U);
  EXPECT_EQ(least_frame_bits(0, false), 47U);
  EXPECT_EQ(most_frame_bits(0, false), 55U);   // 47 + floor(33 / 4)
  EXPECT_EQ(most_frame_bits(6, false), 115U);  // 95 + floor(81 / 4)
  EXPECT_EQ(least_frame_bits(8, true), 131U);
  EXPECT_EQ(most_frame_bits(8, true), 160U);  // 131 + floor(117 / 4)
}

config::RobotConfig robot_with(std::size_t drives, const char* variant) {
  config::RobotConfig robot;
  robot.file = "robot.yaml";
  robot.control.period = milliseconds(1);
  config::Bus bus;
  bus.name = "arm";
  bus.bitrate = 1'000'000;
  robot.buses = {bus};
  config::Joint joint;
  joint.drive.variant = variant;
  robot.joints.assign(drives, joint);
  return robot;
}

TEST(BusLoad, ThreeMitDrivesFitOneMegabitAtOneKilohertz) {
  const auto loads = check_bus_load(robot_with(3, "damiao"));
  ASSERT_TRUE(loads) << loads.error();
  ASSERT_EQ(loads->size(), 1U);
  EXPECT_EQ(loads->front().bits_per_tick, 3U * 270U);
  EXPECT_NEAR(loads->front().load, 0.81, 1e-9);
  EXPECT_TRUE(check_bus_load(robot_with(3, "tmotor")));
}

TEST(BusLoad, FourDoNotAndTheSentenceShowsWhy) {
  const auto refused = check_bus_load(robot_with(4, "damiao"));
  ASSERT_FALSE(refused);
  EXPECT_EQ(
      refused.error(),
      "robot.yaml: bus arm cannot carry its 4 drives: 1080 bits per tick (commands and replies, worst stuffing) x "
      "1000 ticks/s = 1080000 bit/s = 108 % of 1000000 bit/s, more than 90 %: move drives to another bus, "
      "write to some every few ticks (drive.every) or lengthen control.period");
  EXPECT_FALSE(check_bus_load(robot_with(4, "tmotor")));
}

TEST(BusLoad, ALongerPeriodOrAnotherBusMakesRoom) {
  config::RobotConfig robot = robot_with(6, "damiao");
  EXPECT_FALSE(check_bus_load(robot));
  robot.buses.push_back(robot.buses[0]);
  for (std::size_t i = 3; i < 6; ++i) robot.joints[i].bus = 1;
  EXPECT_TRUE(check_bus_load(robot));
  robot = robot_with(6, "damiao");
  robot.control.period = milliseconds(2);
  EXPECT_TRUE(check_bus_load(robot));
}

// An FD frame of 8 bytes: 33 bits at 1 Mbit/s and 114 at 5 Mbit/s, worst stuffing: 55.8 us; classic it takes 135.
TEST(BusLoad, CanFdMakesRoomForEightMitDrives) {
  config::RobotConfig robot = robot_with(8, "damiao");
  robot.buses[0].fd = true;
  robot.buses[0].data_bitrate = 5'000'000;
  EXPECT_FALSE(check_bus_load(robot)) << "an FD bus, and classic frames";
  for (config::Joint& joint : robot.joints) joint.drive.fd_bitrate = 5'000'000;
  const auto loads = check_bus_load(robot);
  ASSERT_TRUE(loads) << loads.error();
  const FdFrameBits bits = most_fd_frame_bits(8, false);
  EXPECT_EQ(bits.arbitration, 33U);
  EXPECT_EQ(bits.data, 114U);
  EXPECT_NEAR(loads->front().load, 0.893, 1e-3);
}

TEST(BusLoad, DrivesAtADividedRateShareTheTicks) {
  config::RobotConfig robot = robot_with(6, "damiao");
  EXPECT_FALSE(check_bus_load(robot));
  for (config::Joint& joint : robot.joints) joint.drive.every = 2;
  const auto halved = check_bus_load(robot);
  ASSERT_TRUE(halved) << halved.error();
  EXPECT_EQ(halved->front().bits_per_tick, 3U * 270U) << "three in each tick";
  EXPECT_NEAR(halved->front().undivided, 1.62, 1e-9);

  robot = robot_with(4, "damiao");
  for (std::size_t i = 2; i < 4; ++i) robot.joints[i].drive.every = 2;
  const auto mixed = check_bus_load(robot);
  ASSERT_TRUE(mixed) << mixed.error();
  EXPECT_EQ(mixed->front().bits_per_tick, 3U * 270U) << "two in every tick, and one of the others";
}

TEST(BusLoad, SixteenBusesAreCounted) {
  config::RobotConfig robot = robot_with(48, "damiao");
  robot.buses.assign(16, robot.buses[0]);
  for (std::size_t i = 0; i < 48; ++i) robot.joints[i].bus = i / 3;
  const auto loads = check_bus_load(robot);
  ASSERT_TRUE(loads) << loads.error();
  EXPECT_EQ(loads->size(), 16U);
}

}  // namespace
}  // namespace takt::drivers

// SPDX-License-Identifier: Apache-2.0
// Goal: a configured bus opens where it should, says where, and refuses with one sentence otherwise.
#include "drivers/bus/open_bus.hpp"

#include <gtest/gtest.h>

#include <filesystem>

#include "config/paths.hpp"
#include "drivers/bus/loopback_hub.hpp"

namespace takt::drivers {
namespace {

config::Bus missing_bus(config::WhenBusMissing when_missing) {
  config::Bus bus;
  bus.name = "arm";
  bus.interface = "takt-none0";
  bus.bitrate = 1'000'000;
  bus.when_missing = when_missing;
  return bus;
}

std::string fresh_directory() {
  const std::filesystem::path path = std::filesystem::path(testing::TempDir()) / "takt_open_bus";
  std::filesystem::remove_all(path);
  return path;
}

TEST(OpenBus, RefusesAMissingInterface) {
  const auto opened = open_bus(missing_bus(config::WhenBusMissing::refuse), fresh_directory());
  ASSERT_FALSE(opened);
  EXPECT_NE(opened.error().find("no interface takt-none0"), std::string::npos) << opened.error();
}

TEST(OpenBus, WithoutAHubTheSentenceSaysWhatToStart) {
  const auto opened = open_bus(missing_bus(config::WhenBusMissing::loopback), fresh_directory());
  ASSERT_FALSE(opened);
  EXPECT_NE(opened.error().find("start takt-plant"), std::string::npos) << opened.error();
}

TEST(OpenBus, LandsOnTheLoopbackHubWhenAllowed) {
  const std::string directory = fresh_directory();
  const auto hub = LoopbackHub::listen(config::loopback_socket(directory, "takt-none0"), {});
  ASSERT_TRUE(hub) << hub.error();
  const auto opened = open_bus(missing_bus(config::WhenBusMissing::loopback), directory);
  ASSERT_TRUE(opened) << opened.error();
  EXPECT_TRUE(opened->loopback);
  EXPECT_NE(opened->description.find("loopback hub at " + directory), std::string::npos);
  EXPECT_EQ(opened->bus->health().state, BusState::up);
}

TEST(OpenBus, KnowsWhichIdsEachSideListensTo) {
  config::RobotConfig robot;
  robot.joints.resize(3);
  for (std::uint32_t i = 0; i < 3; ++i) {
    robot.joints[i].bus = i / 2;
    robot.joints[i].drive.id = i + 1;
    robot.joints[i].drive.reply_id = i + 0x11;
  }
  const auto ids = [](const std::vector<config::IdPattern>& patterns) {
    std::vector<std::uint32_t> all;
    for (const config::IdPattern& one : patterns) all.push_back(one.id);
    return all;
  };
  EXPECT_EQ(ids(host_ids(robot, 0)), (std::vector<std::uint32_t>{1, 0x11, 2, 0x12}));
  EXPECT_EQ(ids(host_ids(robot, 1)), (std::vector<std::uint32_t>{3, 0x13}));
  EXPECT_EQ(ids(device_ids(robot, 0)), (std::vector<std::uint32_t>{1, 2}));
}

}  // namespace
}  // namespace takt::drivers

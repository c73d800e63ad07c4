// SPDX-License-Identifier: Apache-2.0
// Goal: drives.json has what the drives said from the first frame on, is written again when a card changes and only
// then, and is gone when the executive is. Method: frames published by hand into a real ring, as RobStride's manual has
// them; the file is read back as JSON.
#include "executive/runtime/drive_cards.hpp"

#include <gtest/gtest.h>

#include <cstdlib>
#include <filesystem>
#include <fstream>
#include <nlohmann/json.hpp>

#include "drivers/bus/can_frame.hpp"
#include "drivers/protocol/seen_angle.hpp"
#include "executive/runtime/published_segments.hpp"
#include "tests/support/temporary_directory.hpp"

namespace takt::runtime {
namespace {

class DriveCardsTest : public testing::Test {
 protected:
  DriveCardsTest() {
    robot_.robot = "two_rollers";
    robot_.sha256 = "abc";
    robot_.buses.push_back({.name = "left", .interface = "can0", .bitrate = 1'000'000});
    robot_.buses.push_back({.name = "right", .interface = "can1", .bitrate = 1'000'000});
    robot_.joints.resize(2);
    for (std::size_t joint = 0; joint < 2; ++joint) {
      config::Joint& one = robot_.joints[joint];
      one.name = joint == 0 ? "left_roller" : "right_roller";
      one.bus = joint;
      one.drive.protocol = config::DriveProtocol::robstride;
      one.drive.model = "RS03";
      one.drive.id = 5;
      one.drive.host_id = 253;
    }
    robot_.joints[1].drive.watchdog_waiver = "seen to stop";
    robot_.joints[1].drive.identity = "00C0FFEE:12345678";
  }

  void publish(std::uint8_t bus, std::uint32_t type_and_data, std::uint32_t target, std::array<std::uint8_t, 8> bytes,
               FrameDirection direction = FrameDirection::received) {
    drivers::CanFrame frame;
    frame.id = type_and_data << 8U | target;
    frame.extended = true;
    frame.length = 8;
    std::ranges::copy(bytes, frame.data);
    published_.frame(drivers::to_record(frame, MonoTime{++stamp_}, 1, bus, direction));
  }
  // Answer to a reading of 7028: 2000 units of 50 us.
  void tell_timeout(std::uint8_t bus) { publish(bus, 17U << 16U | 5, 253, {0x28, 0x70, 0, 0, 0xD0, 0x07, 0, 0}); }
  void tell_identity(std::uint8_t bus, std::uint8_t last) {
    publish(bus, 5, 0xFE, {0x00, 0xC0, 0xFF, 0xEE, 0x12, 0x34, 0x56, last});
  }
  nlohmann::json file() const {
    std::ifstream in(directory_.path("drives.json"));
    return nlohmann::json::parse(in, nullptr, false);
  }
  nlohmann::json fact(std::size_t joint, const std::string& name) const {
    const nlohmann::json json = file();
    for (const auto& one : json.at("drives").at(joint).at("facts"))
      if (one.at("fact") == name) return one;
    return {};
  }

  const test::TemporaryDirectory directory_;
  config::RobotConfig robot_;
  PublishedSegments published_ = PublishedSegments::create(2).value();
  std::int64_t stamp_ = 0;
};

TEST_F(DriveCardsTest, SaysFromTheStartThatNothingIsKnown) {
  const DriveCards cards(robot_, published_.frame_reader(), directory_.path());
  const auto json = file();
  EXPECT_EQ(json.at("schema"), "takt.drives/1");
  EXPECT_EQ(json.at("robot"), "two_rollers");
  EXPECT_EQ(json.at("config_sha256"), "abc");
  ASSERT_EQ(json.at("drives").size(), 2U);
  EXPECT_EQ(json.at("drives")[1].at("joint"), "right_roller");
  EXPECT_EQ(json.at("drives")[1].at("bus"), "can1");
  EXPECT_EQ(json.at("drives")[1].at("watchdog_waiver"), "seen to stop");
  EXPECT_TRUE(json.at("drives")[0].at("watchdog_waiver").is_null());
  for (const auto& one : json.at("drives")[0].at("facts")) {
    EXPECT_TRUE(one.at("value").is_null()) << one;
    EXPECT_EQ(one.at("verdict"), "unknown") << one;
  }
}

TEST_F(DriveCardsTest, KeepsWhatEachDriveSaid) {
  DriveCards cards(robot_, published_.frame_reader(), directory_.path());
  tell_timeout(0);
  tell_identity(1, 0x79);
  cards.catch_up();
  EXPECT_EQ(fact(0, "watchdog").at("value"), "100 ms");
  EXPECT_EQ(fact(0, "watchdog").at("verdict"), "agrees");
  EXPECT_EQ(fact(1, "watchdog").at("verdict"), "waived") << "same number, other bus";
  EXPECT_EQ(fact(1, "identity").at("value"), "00C0FFEE:12345679");
  EXPECT_EQ(fact(1, "identity").at("expected"), "00C0FFEE:12345678");
  EXPECT_EQ(fact(1, "identity").at("verdict"), "differs");
}

TEST_F(DriveCardsTest, OurOwnWordsTellNothing) {
  DriveCards cards(robot_, published_.frame_reader(), directory_.path());
  publish(0, 17U << 16U | 5, 253, {0x28, 0x70, 0, 0, 0xD0, 0x07, 0, 0}, FrameDirection::sent);
  publish(0, 17U << 16U | 5, 253, {0x28, 0x70, 0, 0, 0xD0, 0x07, 0, 0}, FrameDirection::refused);
  cards.catch_up();
  EXPECT_TRUE(fact(0, "watchdog").at("value").is_null());
}

TEST_F(DriveCardsTest, IsWrittenOnlyWhenACardChanges) {
  DriveCards cards(robot_, published_.frame_reader(), directory_.path());
  tell_timeout(0);
  cards.catch_up();
  std::filesystem::remove(directory_.path("drives.json"));
  tell_timeout(0);
  cards.catch_up();
  EXPECT_FALSE(std::filesystem::exists(directory_.path("drives.json"))) << "known already";
  tell_timeout(1);
  cards.catch_up();
  EXPECT_EQ(fact(1, "watchdog").at("value"), "100 ms");
}

// No drive tells its gear: the word of the person who watched it is the card's, until the file has another scale.
TEST_F(DriveCardsTest, HasWhatAPersonSawOfAScale) {
  ASSERT_TRUE(drivers::keep_seen_angle(directory_.path(), robot_, 1, drivers::SeenAngle{0.0873, 0.0890, "2026-11-28"}));
  {
    const DriveCards cards(robot_, published_.frame_reader(), directory_.path());
    EXPECT_EQ(fact(1, "scale").at("value"), "+5.1 deg seen where the drive told +5.0 deg, 2026-11-28");
    EXPECT_EQ(fact(1, "scale").at("source"), "takt joint jog");
    EXPECT_EQ(fact(1, "scale").at("verdict"), "agrees");
    EXPECT_TRUE(fact(0, "scale").is_null()) << "of the other joint no one said anything";
  }
  robot_.joints[1].drive.gear_ratio = 3;
  const DriveCards cards(robot_, published_.frame_reader(), directory_.path());
  EXPECT_TRUE(fact(1, "scale").is_null());
}

TEST_F(DriveCardsTest, GoesWithTheExecutive) {
  { const DriveCards cards(robot_, published_.frame_reader(), directory_.path()); }
  EXPECT_FALSE(std::filesystem::exists(directory_.path("drives.json")));
}

}  // namespace
}  // namespace takt::runtime

// SPDX-License-Identifier: Apache-2.0
// Goal: what a person says of a joint's place is told to the drive in its own units, or kept for one start of the
// executive, and refused where it is in doubt. Method: frames against bytes written down from mjbots/moteus
// docs/protocol/registers.md (131) and odriverobotics/ODriveArduino src/can_simple_messages.hpp (19); notes in a folder
// of the test's own.
#include "commissioning/home_place.hpp"

#include <gtest/gtest.h>

#include <cstring>
#include <filesystem>
#include <fstream>
#include <numbers>

#include "drivers/protocol/home_note.hpp"
#include "tests/support/temporary_directory.hpp"

namespace takt::commissioning {
namespace {

using config::PositionAfterPowerUp;
constexpr double kDegree = std::numbers::pi / 180;

config::Joint joint_with(config::DriveProtocol protocol, PositionAfterPowerUp position) {
  config::Joint joint;
  joint.drive.protocol = protocol;
  joint.drive.id = 3;
  joint.drive.position_after_power_up = position;
  joint.drive.places_per_turn = 9;
  joint.drive.position_range = 12.5;
  joint.limits.q_min = -100 * kDegree;
  joint.limits.q_max = 100 * kDegree;
  return joint;
}

TEST(HomePlace, WhoForgetsIt) {
  using enum config::DriveProtocol;
  EXPECT_TRUE(forgets_home(joint_with(moteus, PositionAfterPowerUp::absolute).drive));
  EXPECT_FALSE(forgets_home(joint_with(odrive, PositionAfterPowerUp::absolute).drive));
  EXPECT_TRUE(forgets_home(joint_with(odrive, PositionAfterPowerUp::unknown).drive));
  EXPECT_TRUE(forgets_home(joint_with(mit, PositionAfterPowerUp::one_of_several).drive));
  EXPECT_TRUE(forgets_home(joint_with(robstride, PositionAfterPowerUp::within_a_turn).drive));
  EXPECT_FALSE(forgets_home(joint_with(cia402, PositionAfterPowerUp::absolute).drive));
}

TEST(HomePlace, AMoteusIsToldTheTurnsOfItsOutput) {
  config::Joint joint = joint_with(config::DriveProtocol::moteus, PositionAfterPowerUp::absolute);
  joint.drive.direction = -1;
  joint.drive.offset = 90 * kDegree;
  const auto frame = home_frame(joint, 0);
  ASSERT_TRUE(frame);
  constexpr std::uint8_t kQuarterTurn[]{0x0D, 0xB1, 0x02, 0x00, 0x00, 0x80, 0x3E};  // 0.25
  ASSERT_EQ(frame->length, sizeof kQuarterTurn);
  EXPECT_EQ(std::memcmp(frame->data, kQuarterTurn, sizeof kQuarterTurn), 0);
  EXPECT_TRUE(frame->fd);
}

TEST(HomePlace, AnOdriveIsToldTheTurnsOfItsMotorAndTheMark) {
  const config::Joint joint = joint_with(config::DriveProtocol::odrive, PositionAfterPowerUp::unknown);
  const auto frame = home_frame(joint, 90 * kDegree);
  ASSERT_TRUE(frame);
  EXPECT_EQ(frame->id, 0x79U);
  ASSERT_EQ(frame->length, 8);
  float turns = 0;
  std::memcpy(&turns, frame->data, sizeof turns);
  EXPECT_EQ(turns - std::floor(turns), 0.25F);
  EXPECT_GT(turns, 2) << "the mark";
  EXPECT_FALSE(home_frame(joint_with(config::DriveProtocol::odrive, PositionAfterPowerUp::absolute), 0));
}

// Places are 40 deg apart: 8 + 40 n deg.
TEST(HomePlace, TheNearestOfSeveralPlacesIsMeantUnlessInDoubt) {
  const config::Joint joint = joint_with(config::DriveProtocol::mit, PositionAfterPowerUp::one_of_several);
  const auto steps = [&](double at) { return shift_between(joint, 8 * kDegree, at * kDegree); };
  EXPECT_NEAR(steps(8).value(), 0, 1e-9);
  EXPECT_NEAR(steps(17).value(), 0, 1e-9);
  EXPECT_NEAR(steps(85).value(), 80 * kDegree, 1e-9);
  EXPECT_NEAR(steps(-80).value(), -80 * kDegree, 1e-9);
  ASSERT_FALSE(steps(28));
  EXPECT_NE(steps(28).error().find("near none of them"), std::string::npos) << steps(28).error();
  ASSERT_FALSE(steps(125)) << "128 deg is no place of the joint's";
  EXPECT_NE(steps(125).error().find("outside limits.position"), std::string::npos) << steps(125).error();
}

TEST(HomePlace, WithinATurnOfTheDrivesOutputStepsAreTurnsOfIt) {
  config::Joint joint = joint_with(config::DriveProtocol::robstride, PositionAfterPowerUp::within_a_turn);
  EXPECT_NEAR(shift_between(joint, 350 * kDegree, -9 * kDegree).value(), -360 * kDegree, 1e-9);
  joint.drive.gear_ratio = 2;
  joint.drive.position_range = 25;
  EXPECT_NEAR(shift_between(joint, 350 * kDegree, -9 * kDegree).value(), -360 * kDegree, 1e-9);
  EXPECT_NEAR(shift_between(joint, 100 * kDegree, -79 * kDegree).value(), -180 * kDegree, 1e-9);
}

// Goal: a reading that says nothing is believed only if it would not be the same after a power cycle. Method: readings
// on either side of 10 deg from where it was switched on, with an offset.
TEST(HomePlace, OfADriveThatCountsFromItsStartAnyAngleIsMeantOnceItHasMoved) {
  config::Joint joint = joint_with(config::DriveProtocol::cia402, PositionAfterPowerUp::unknown);
  joint.drive.position_range = 0;
  joint.drive.offset = 30 * kDegree;
  EXPECT_NEAR(shift_between(joint, 41 * kDegree, -17.3 * kDegree).value(), -58.3 * kDegree, 1e-9);
  EXPECT_NEAR(shift_between(joint, 19 * kDegree, 80 * kDegree).value(), 61 * kDegree, 1e-9);
  ASSERT_FALSE(shift_between(joint, 38 * kDegree, 0));
  EXPECT_NE(shift_between(joint, 38 * kDegree, 0).error().find("move the joint by more than 10.0 deg"),
            std::string::npos);
  EXPECT_FALSE(shift_between(joint, 41 * kDegree, 101 * kDegree)) << "no place of the joint's";
}

TEST(HomePlace, WhatTheDriveCannotSayFromThereIsRefused) {
  config::Joint joint = joint_with(config::DriveProtocol::mit, PositionAfterPowerUp::one_of_several);
  joint.drive.position_range = 150 * kDegree;
  EXPECT_TRUE(shift_between(joint, 0, 40 * kDegree));
  EXPECT_FALSE(shift_between(joint, 0, 80 * kDegree));
}

// Goal: a slide's places are turns of its motor apart, in metres. Method: 100 rad to a metre, so a turn is 62.8 mm; a
// drive that counts from its start is believed beyond 10 degrees of its motor, 1.7 mm.
TEST(HomePlace, OfASlideItIsInMetres) {
  config::Joint slide = joint_with(config::DriveProtocol::robstride, PositionAfterPowerUp::within_a_turn);
  slide.kind = config::JointKind::slide;
  slide.drive.gear_ratio = 100;
  slide.drive.position_range = 25;
  slide.limits.q_min = 0;
  slide.limits.q_max = 0.1;
  EXPECT_NEAR(shift_between(slide, 0.07, 0.008).value(), -0.0628, 1e-4);
  ASSERT_FALSE(shift_between(slide, 0.07, 0.04));
  EXPECT_EQ(
      shift_between(slide, 0.07, 0.04).error(),
      "its drive reads 70.0 mm, so it is at 70.0 mm or a multiple of 62.8 mm from there, and 40.0 mm is near none "
      "of them: look again");
  EXPECT_EQ(check_place(slide, 0.2).error(), "200.0 mm is outside limits.position 0.0 mm to 100.0 mm");
  slide.drive.protocol = config::DriveProtocol::cia402;
  slide.drive.position_after_power_up = PositionAfterPowerUp::unknown;
  EXPECT_NEAR(shift_between(slide, 0.002, 0.03).value(), 0.028, 1e-9);
  ASSERT_FALSE(shift_between(slide, 0.0015, 0.03));
  EXPECT_NE(shift_between(slide, 0.0015, 0.03).error().find("move the joint by more than 1.7 mm"), std::string::npos);
  slide.drive.protocol = config::DriveProtocol::moteus;
  float turns = 0;
  std::memcpy(&turns, home_frame(slide, 0.031415927)->data + 3, sizeof turns);
  EXPECT_NEAR(turns, 0.5, 1e-6) << "of the motor";
  EXPECT_NEAR(drivers::may_have_moved(slide), 0.0005, 1e-9) << "m";
}

class Notes : public testing::Test {
 protected:
  Notes() {
    robot_.hash = 77;
    robot_.joints.push_back(joint_with(config::DriveProtocol::mit, PositionAfterPowerUp::absolute));
    robot_.joints.push_back(joint_with(config::DriveProtocol::mit, PositionAfterPowerUp::one_of_several));
  }
  void write() {
    ASSERT_TRUE(drivers::write_home_note(directory_.path(), robot_, 1, {.shift = 0.698, .left_at = 0.71}));
  }
  [[nodiscard]] std::string file() const { return directory_.path("home-1"); }
  // Its words, with one of them replaced.
  void forge(std::size_t which, const std::string& word) {
    std::vector<std::string> words;
    std::ifstream in(file());
    for (std::string one; in >> one;) words.push_back(one);
    words.at(which) = word;
    std::ofstream out(file());
    for (const std::string& one : words) out << one << ' ';
  }

  const test::TemporaryDirectory directory_;
  config::RobotConfig robot_;
};

TEST_F(Notes, HoldOnce) {
  write();
  const auto first = drivers::take_home_notes(directory_.path(), robot_);
  ASSERT_EQ(first.size(), 2U);
  EXPECT_FALSE(first[0]);
  ASSERT_TRUE(first[1]);
  EXPECT_EQ(first[1]->shift, 0.698);
  EXPECT_EQ(first[1]->left_at, 0.71);
  EXPECT_FALSE(drivers::take_home_notes(directory_.path(), robot_)[1]);
}

TEST_F(Notes, MayBeLookedAtBeforeTheyAreTaken) {
  write();
  ASSERT_TRUE(drivers::home_notes(directory_.path(), robot_)[1]);
  const auto notes = drivers::take_home_notes(directory_.path(), robot_);
  ASSERT_TRUE(notes[1]);
  EXPECT_FALSE(drivers::home_notes(directory_.path(), robot_)[1]);
  const config::RobotConfig homed = drivers::homed_robot(robot_, notes);
  EXPECT_EQ(homed.joints[0].drive.offset, robot_.joints[0].drive.offset);
  EXPECT_EQ(homed.joints[1].drive.offset, robot_.joints[1].drive.offset + 0.698);
}

TEST_F(Notes, OfAnotherRobotFileAnotherStartOfTheComputerOrTooLongAgoAreTakenAwayAndDoNotHold) {
  write();
  robot_.hash = 78;
  EXPECT_FALSE(drivers::take_home_notes(directory_.path(), robot_)[1]);
  EXPECT_FALSE(std::filesystem::exists(file()));
  write();
  forge(0, "00000000-0000-0000-0000-000000000000");
  EXPECT_FALSE(drivers::take_home_notes(directory_.path(), robot_)[1]) << "another boot";
  write();
  forge(2, "-600000000001");
  EXPECT_FALSE(drivers::take_home_notes(directory_.path(), robot_)[1]) << "too old";
  write();
  forge(2, "9000000000000000000");
  EXPECT_FALSE(drivers::take_home_notes(directory_.path(), robot_)[1]) << "from the future";
  write();
  forge(3, "nan");
  EXPECT_FALSE(drivers::take_home_notes(directory_.path(), robot_)[1]);
}

TEST_F(Notes, WhereNothingCanBeWrittenItIsSaid) {
  std::ofstream(directory_.path("file"));
  EXPECT_FALSE(drivers::write_home_note(directory_.path("file"), robot_, 1, {}));
}

}  // namespace
}  // namespace takt::commissioning

// SPDX-License-Identifier: Apache-2.0
// Goal: a drive's card says what the drive said of itself, beside what the robot file says, and leaves unknown what was
// not told: never a 0 or a default.
// Method: each protocol's simulated drive and host driver in virtual time; the card is given what the drive says, frame
// by frame, as an executive would. Expected words were written down here from the simulated drives' headers.
#include "drivers/protocol/drive_card.hpp"

#include <gtest/gtest.h>

#include <algorithm>

#include "config/drive_presets.hpp"
#include "tests/simulation/drive_loop.hpp"

namespace takt::simulation {
namespace {

using config::Drive;
using drivers::CardEntry;
using drivers::CardItem;
using drivers::CardVerdict;
using drivers::DriveCard;

Drive drive_of(config::DriveProtocol protocol, const char* model = "", const char* variant = "") {
  Drive drive;
  drive.protocol = protocol;
  drive.model = model;
  drive.variant = variant;
  drive.id = 3;
  drive.reply_id = 0x13;
  drive.host_id = 253;
  drive.torque_range = 3;
  drive.servo_kp = 20;
  drive.servo_kd = 1;
  drive.counts_per_turn = 1 << 17;
  drive.rated_torque = 10;
  if (const config::DrivePreset* const preset = config::find_drive_preset(protocol, model)) {
    drive.position_range = preset->position;
    drive.velocity_range = preset->velocity;
    drive.torque_range = preset->torque;
    drive.kp_range = preset->kp;
    drive.kd_range = preset->kd;
  }
  return drive;
}

DriveCard card_of(const Drive& drive) {
  config::RobotConfig robot;
  robot.joints.resize(1);
  robot.joints[0].drive = drive;
  return {robot, 0};
}

// What the card says once the drive was set up; `drive`: as it is, where that differs from the file.
std::vector<CardEntry> card_after_set_up(const Drive& file, const Drive& drive,
                                         const std::function<bool(drivers::CanFrame&)>& on_the_way = {}) {
  test::DriveLoop loop(file, milliseconds(100));
  loop.device = make_device(drive, milliseconds(100));
  DriveCard card = card_of(file);
  loop.on_the_way = [&](drivers::CanFrame& frame) {
    if (on_the_way && !on_the_way(frame)) return false;
    (void)card.take(frame);  // the host's own words among them: they tell nothing
    return true;
  };
  for (int i = 0; i < 1500; ++i) loop.tick(false);
  return card.entries();
}

CardEntry entry(const std::vector<CardEntry>& entries, CardItem item) {
  const auto found = std::ranges::find(entries, item, &CardEntry::item);
  return found == entries.end() ? CardEntry{item, {}, "no such row", {}, CardVerdict::unknown} : *found;
}

struct Line {
  CardItem item;
  const char* value;
  CardVerdict verdict;
};

void expect(const std::vector<CardEntry>& entries, const std::vector<Line>& lines) {
  for (const Line& line : lines) {
    const CardEntry found = entry(entries, line.item);
    EXPECT_EQ(found.value, line.value) << name(line.item);
    EXPECT_EQ(name(found.verdict), name(line.verdict)) << name(line.item) << ": " << found.value;
    EXPECT_EQ(found.value.empty(), found.verdict == CardVerdict::unknown || found.verdict == CardVerdict::waived)
        << name(line.item);
  }
}

using enum CardItem;
using enum CardVerdict;

TEST(DriveCard, OfADamiao) {
  const Drive drive = drive_of(config::DriveProtocol::mit, "DM4310", "damiao");
  expect(card_after_set_up(drive, drive), {{identity, "70003", told},
                                           {hardware, "21", told},
                                           {firmware, "5013", told},
                                           {mode, "1 (MIT)", agrees},
                                           {position_range, "12.5 rad", agrees},
                                           {velocity_range, "30 rad/s", agrees},
                                           {torque_range, "10 Nm", agrees},
                                           {watchdog, "50 ms", agrees},
                                           {home, "", unknown}});
}

TEST(DriveCard, OfATMotorIsEmpty) {
  Drive drive = drive_of(config::DriveProtocol::mit, "AK10-9", "tmotor");
  for (const CardEntry& one : card_after_set_up(drive, drive)) {
    EXPECT_EQ(one.value, "") << name(one.item);
    EXPECT_EQ(one.verdict, unknown) << name(one.item);
  }
  drive.watchdog_waiver = "seen to stop";
  EXPECT_EQ(entry(card_after_set_up(drive, drive), watchdog).verdict, waived);
}

TEST(DriveCard, OfARobstride) {
  Drive drive = drive_of(config::DriveProtocol::robstride, "RS03");
  drive.identity = "00C0FFEE:12345678";
  const auto entries = card_after_set_up(drive, drive);
  expect(entries, {{identity, "00C0FFEE:12345678", agrees},
                   {firmware, "", unknown},
                   {mode, "0 (motion)", agrees},
                   {velocity_range, "", unknown},
                   {watchdog, "50 ms", agrees},
                   {home, "1 (-pi to pi)", told}});
  EXPECT_EQ(entry(entries, watchdog).source, "parameter 7028");
  drive.position_after_power_up = config::PositionAfterPowerUp::within_a_turn;
  EXPECT_EQ(entry(card_after_set_up(drive, drive), home).value, "0 (0 to 2 pi)") << "as delivered";
}

TEST(DriveCard, OfACyberGearHasItsStoredTimeOut) {
  const Drive drive = drive_of(config::DriveProtocol::robstride, "CyberGear");
  const auto entries = card_after_set_up(drive, drive);
  expect(entries, {{watchdog, "100 ms", agrees}});
  EXPECT_EQ(entry(entries, watchdog).source, "parameter 200C");
}

TEST(DriveCard, OfAnOdrive) {
  Drive drive = drive_of(config::DriveProtocol::odrive);
  drive.watchdog_waiver = "enable_watchdog and 100 ms";
  expect(card_after_set_up(drive, drive), {{identity, "", unknown},
                                           {hardware, "4.4.58", told},
                                           {firmware, "0.6.10", told},
                                           {watchdog, "", waived},
                                           {home, "", unknown}});
}

TEST(DriveCard, OfAMoteus) {
  Drive drive = drive_of(config::DriveProtocol::moteus);
  drive.identity = "00110022:00330044:8055F0F1";
  expect(card_after_set_up(drive, drive), {{identity, "00110022:00330044:8055F0F1", agrees},
                                           {hardware, "00000011", told},
                                           {firmware, "0.3.8", told},
                                           {watchdog, "in every command", agrees},
                                           {home, "2 (referenced to the output)", agrees}});
}

TEST(DriveCard, OfACia402Drive) {
  Drive drive = drive_of(config::DriveProtocol::cia402);
  drive.identity = "0000009A:00030924";
  drive.mode = config::Cia402Mode::csv;
  const auto entries = card_after_set_up(drive, drive);
  expect(entries, {{identity, "0000009A:00030924:00000007", agrees},
                   {firmware, "00010002", told},
                   {mode, "9 (csv)", agrees},
                   {torque_range, "rated 10 Nm", agrees},
                   {velocity_unit, "00B50300", told},
                   {watchdog, "50 ms", agrees}});
  EXPECT_EQ(entry(entries, watchdog).source, "object 1400:05");
  const auto software = std::ranges::find(entries, "object 100A:00", &CardEntry::source);
  ASSERT_NE(software, entries.end());
  EXPECT_EQ(software->value, "takt-plant 1.4.2") << "in three segments";
  EXPECT_EQ(software->item, firmware);
  EXPECT_EQ(std::ranges::count(entries, identity, &CardEntry::item), 1);
  EXPECT_EQ(std::ranges::count(entries, torque_range, &CardEntry::item), 2) << "rated, and the most it lets through";
}

TEST(DriveCard, OfAPositionDriveHasItsWindow) {
  Drive drive = drive_of(config::DriveProtocol::cia402);
  drive.mode = config::Cia402Mode::csp;
  expect(card_after_set_up(drive, drive), {{following_window, "none: the drive does not watch it", told}});
  drive.mode = config::Cia402Mode::cst;
  EXPECT_EQ(entry(card_after_set_up(drive, drive), following_window).value, "no such row");
}

// Goal: the window of a slide's drive is a length. Method: what a drive with 131072 counts per turn answers, on 100 rad
// to a metre.
TEST(DriveCard, OfASlidesPositionDriveTheWindowIsALength) {
  config::RobotConfig robot;
  robot.joints.resize(1);
  config::Joint& slide = robot.joints[0];
  slide.kind = config::JointKind::slide;
  slide.drive = drive_of(config::DriveProtocol::cia402);
  slide.drive.mode = config::Cia402Mode::csp;
  slide.drive.gear_ratio = 100;
  DriveCard card(robot, 0);
  const auto answer = [&card](std::uint16_t object, std::uint16_t value) {
    const auto low = [](std::uint16_t word) { return static_cast<std::uint8_t>(word & 0xFFU); };
    const auto high = [](std::uint16_t word) { return static_cast<std::uint8_t>(word >> 8U); };
    drivers::CanFrame frame{.id = 0x583, .length = 8};
    const std::uint8_t bytes[] = {0x43, low(object), high(object), 0, low(value), high(value), 0, 0};
    std::ranges::copy(bytes, frame.data);
    (void)card.take(frame);
  };
  answer(0x6065, 20861);  // a radian of the motor
  answer(0x6066, 300);
  EXPECT_EQ(entry(card.entries(), following_window).value, "0.01 m for 300 ms");
}

// What refuses arming stands on the card with both values.
TEST(DriveCard, SaysBothSidesOfADifference) {
  Drive file = drive_of(config::DriveProtocol::mit, "DM4310", "damiao");
  file.firmware = "5013";
  Drive drive = file;
  drive.firmware = "5012";
  drive.velocity_range = 45;
  const CardEntry version = entry(card_after_set_up(file, drive), firmware);
  EXPECT_EQ(version.verdict, unknown) << "its set-up ended at the range before";
  const CardEntry range = entry(card_after_set_up(file, drive), velocity_range);
  EXPECT_EQ(range.verdict, differs);
  EXPECT_EQ(range.value, "45 rad/s");
  EXPECT_EQ(range.expected, "30 rad/s");
  drive.velocity_range = file.velocity_range;
  const CardEntry other = entry(card_after_set_up(file, drive), firmware);
  EXPECT_EQ(other.verdict, differs);
  EXPECT_EQ(other.value, "5012");
  EXPECT_EQ(other.expected, "5013");
}

TEST(DriveCard, ATimeOutThatIsOffIsNoZero) {
  const Drive drive = drive_of(config::DriveProtocol::robstride, "CyberGear");
  const auto off = [](drivers::CanFrame& frame) {
    if (frame.id >> 24 == 17 && frame.data[0] == 0x0C && frame.data[1] == 0x20)
      std::fill_n(frame.data + 4, 4, std::uint8_t{0});
    return true;
  };
  const CardEntry found = entry(card_after_set_up(drive, drive, off), watchdog);
  EXPECT_EQ(found.value, "off");
  EXPECT_EQ(found.verdict, differs);
}

TEST(DriveCard, ASilentDriveSaysNothing) {
  const Drive drive = drive_of(config::DriveProtocol::mit, "DM4310", "damiao");
  for (const CardEntry& one : card_of(drive).entries()) {
    EXPECT_EQ(one.value, "") << name(one.item);
    EXPECT_EQ(one.verdict, unknown) << name(one.item);
  }
}

// A frame that says what is known already changes nothing; that of another drive neither.
TEST(DriveCard, ChangesOnlyByWhatIsNew) {
  const Drive drive = drive_of(config::DriveProtocol::robstride, "RS03");
  DriveCard card = card_of(drive);
  drivers::CanFrame frame;
  frame.id = 17U << 24 | 3U << 8 | 253U;
  frame.extended = true;
  frame.length = 8;
  frame.data[0] = 0x28;
  frame.data[1] = 0x70;
  frame.data[4] = 0xD0;
  frame.data[5] = 0x03;
  EXPECT_TRUE(card.take(frame));
  EXPECT_FALSE(card.take(frame));
  frame.data[5] = 0x07;
  EXPECT_TRUE(card.take(frame));
  frame.data[5] = 0x01;
  frame.id = 17U << 24 | 4U << 8 | 253U;
  EXPECT_FALSE(card.take(frame)) << "drive 4's";
  EXPECT_EQ(entry(card.entries(), watchdog).value, "100 ms");
}

}  // namespace
}  // namespace takt::simulation

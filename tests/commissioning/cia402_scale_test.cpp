// SPDX-License-Identifier: Apache-2.0
// Goal: a robot file's counts are held against what a CiA 402 drive tells of its scale, and what it does not tell is
// not judged. Method: kinds of drives as makers build them, answering as simulated ones, each with the file's counts
// right, doubled and halved; a drive that answers nothing.
#include "commissioning/cia402_scale.hpp"

#include <gtest/gtest.h>

#include <functional>

#include "simulation/cia402_device.hpp"

namespace takt::commissioning {
namespace {

using simulation::Cia402Profile;
using Verdict = OwnScale::Verdict;

config::Drive file() {
  config::Drive drive;
  drive.protocol = config::DriveProtocol::cia402;
  drive.id = 5;
  drive.counts_per_turn = 10'000;
  drive.rated_torque = drive.torque_range = 10;
  return drive;
}

OwnScale asked(const config::Drive& drive, const Cia402Profile& profile) {
  simulation::Cia402Device device(file(), milliseconds(100), profile);
  Cia402Scale scale(drive);
  MonoTime now{1};
  for (int ms = 0; ms < 3000 && !scale.asked(); ++ms, now = now + milliseconds(1)) {
    simulation::Frames said;
    if (const auto question = scale.ask(false, now)) device.receive(*question, now, said);
    for (const drivers::CanFrame& frame : said) scale.take(frame);
  }
  EXPECT_TRUE(scale.asked());
  return scale.judge();
}

struct Kind {
  const char* when;
  std::optional<Cia402Profile::Ratio> encoder, gear, feed;
  std::optional<std::uint32_t> unit;
  const char* told;  // its counts per motor turn, all 10000
};

const Kind kKinds[] = {
    {"everything", {{131'072, 1}}, {{1, 1}}, {{10'000, 1}}, 0x00B5'0000, "(6092, 6091)"},
    {"an encoder alone", {{10'000, 1}}, {}, {}, {}, "(608F)"},
    {"an encoder of two turns", {{20'000, 2}}, {{1, 1}}, {}, 0, "(608F)"},
    {"units of its shaft behind a gear", {{131'072, 1}}, {{10, 1}}, {{100'000, 1}}, {}, "(6092, 6091)"},
    {"units per turn as delivered", {{10'000, 1}}, {{1, 1}}, {{1, 1}}, {}, "(608F)"},
    {"ten-thousandths of a turn", {{131'072, 1}}, {{1, 1}}, {}, 0xFCB4'0000, "(60A8, 6091)"},
};

TEST(Cia402Scale, TheFilesCountsAreHeldAgainstTheDrives) {
  for (const Kind& kind : kKinds) {
    Cia402Profile profile;
    profile.encoder = kind.encoder;
    profile.gear = kind.gear;
    profile.feed = kind.feed;
    profile.position_unit = kind.unit;
    for (const std::uint32_t counts : {5'000U, 10'000U, 20'000U}) {
      config::Drive drive = file();
      drive.counts_per_turn = counts;
      const OwnScale own = asked(drive, profile);
      EXPECT_EQ(own.verdict, counts == 10'000 ? Verdict::right : Verdict::wrong) << kind.when << ": " << own.sentence;
      EXPECT_NE(own.sentence.find("10000 counts per motor turn"), std::string::npos) << kind.when << own.sentence;
      EXPECT_NE(own.sentence.find(kind.told), std::string::npos) << kind.when << ": " << own.sentence;
    }
  }
}

// The drive's own gear may be the file's: then its counts are those of the encoder, behind the gear.
TEST(Cia402Scale, AGearThatTheDriveHasIsJudgedWithTheCounts) {
  Cia402Profile profile;
  profile.gear = {10, 1};
  profile.feed = {100'000, 1};
  config::Drive drive = file();
  drive.gear_ratio = 10;
  OwnScale own = asked(drive, profile);
  EXPECT_EQ(own.verdict, Verdict::right) << own.sentence;
  EXPECT_TRUE(own.with_gear);
  drive.counts_per_turn = 100'000;
  own = asked(drive, profile);
  EXPECT_EQ(own.verdict, Verdict::wrong) << own.sentence;
}

TEST(Cia402Scale, WhatIsNotToldIsNotJudged) {
  const auto not_judged = [](const std::function<void(Cia402Profile&)>& change, const char* why) {
    Cia402Profile profile;
    change(profile);
    const OwnScale own = asked(file(), profile);
    EXPECT_EQ(own.verdict, Verdict::not_judged) << own.sentence;
    EXPECT_NE(own.sentence.find(why), std::string::npos) << own.sentence;
  };
  not_judged([](Cia402Profile&) {}, "no encoder (608F)");
  not_judged(
      [](Cia402Profile& profile) {
        profile.encoder = {131'072, 1};
        profile.position_unit = 0xFD01'0000;
      },
      "60A8) is FD010000");
  not_judged(
      [](Cia402Profile& profile) {
        profile.encoder = {131'072, 1};
        profile.gear = {10, 1};
      },
      "a gear of its own (6091)");
  not_judged([](Cia402Profile& profile) { profile.encoder = {0, 1}; }, "no encoder (608F)");
}

TEST(Cia402Scale, ADriveThatDoesNotAnswerIsAskedThreeTimes) {
  Cia402Scale scale(file());
  MonoTime now{1};
  int questions = 0, ms = 0;
  for (; ms < 5000 && !scale.asked(); ++ms, now = now + milliseconds(1)) questions += scale.ask(false, now) ? 1 : 0;
  EXPECT_EQ(questions, 8 * Cia402Scale::kTries);
  EXPECT_LT(ms, 1300);
  EXPECT_EQ(scale.judge().verdict, Verdict::not_judged);
}

}  // namespace
}  // namespace takt::commissioning

// SPDX-License-Identifier: Apache-2.0
// Goal: a drive is told exactly what the script says, one question at a time, whatever it answers or leaves unanswered.
// Method: the whole conversation written out by hand; answers made by hand, dropped, delayed, refused.
#include "drivers/protocol/cia402/cia402_setup.hpp"

#include <gtest/gtest.h>

#include <algorithm>
#include <vector>

#include "drivers/protocol/drive_card.hpp"
#include "drivers/protocol/protocol_table.hpp"
#include "tests/drivers/protocol/cia402/cia402_frames.hpp"

namespace takt::drivers::cia402 {
namespace {

using test::sdo_answer;
using test::text;

constexpr std::uint32_t kRated_mNm = 10'000;
constexpr SetupValues kCst{
    .node = 5, .mode = config::Cia402Mode::cst, .period = {1, -3}, .rated_torque_mNm = kRated_mNm};

class Conversation {
 public:
  explicit Conversation(SetupValues values = kCst,
                        SetupPatience patience = {.answer_ticks = 4, .tries = 3, .pause_ticks = 10})
      : setup(values, patience) {}

  void answer(const CanFrame& frame) {
    const auto decoded = decode_sdo_answer(frame);
    ASSERT_TRUE(decoded);
    setup.take(*decoded);
  }
  // Agrees until the question about this object; returns it, unanswered.
  CanFrame agree_until(ObjectId object) {
    for (int tick = 0; tick < 200; ++tick) {
      const auto question = setup.tick();
      if (!question) continue;
      const auto* data = question->data;
      if (question->id == 0x605 && (data[2] << 8 | data[1]) == object.index && data[3] == object.sub) return *question;
      if (question->id == 0x605) answer(agreeing.answer(*question));
    }
    ADD_FAILURE() << "never asked";
    return {};
  }
  void agree_with(ObjectId object) { answer(agreeing.answer(agree_until(object))); }
  int ticks_until_asked() {
    for (int tick = 1; tick < 100; ++tick)
      if (setup.tick()) return tick;
    return -1;
  }
  Setup setup;
  test::AgreeingDrive agreeing{kRated_mNm};
};

// Segments are fetched by alternate requests; a late answer to one that was asked twice is none, and a text without end
// is broken off. Whatever comes of it, the script goes on.
class SoftwareText : public testing::Test {
 protected:
  std::string ask() {
    const auto question = talk.setup.tick();
    return question ? text(*question) : "";
  }
  void segment(std::uint8_t command) {
    CanFrame frame;
    frame.id = 0x585;
    frame.length = 8;
    frame.data[0] = command;
    talk.setup.take(*decode_sdo_segment(frame));
  }
  Conversation talk;
  const std::string next_row = "605#4002650000000000";
};

TEST_F(SoftwareText, IsFetchedSegmentBySegment) {
  talk.answer(sdo_answer(talk.agree_until({0x100A, 0}), 0x41, 16));
  EXPECT_EQ(ask(), "605#6000000000000000");
  segment(0x00);
  EXPECT_EQ(ask(), "605#7000000000000000");
  segment(0x00);
  EXPECT_EQ(ask(), "") << "the first one again: still waiting";
  segment(0x10);
  EXPECT_EQ(ask(), "605#6000000000000000");
  segment(0x0B);
  EXPECT_EQ(ask(), next_row);
}

TEST_F(SoftwareText, WithoutEndIsBrokenOff) {
  talk.answer(sdo_answer(talk.agree_until({0x100A, 0}), 0x40));
  for (std::uint32_t i = 0; i < kTextSegments; ++i) {
    ASSERT_NE(ask(), "");
    segment(i % 2 == 0 ? 0x00 : 0x10);
  }
  EXPECT_EQ(ask(), "605#800a100000000008");
  EXPECT_EQ(ask(), next_row);
}

TEST_F(SoftwareText, ThatIsNotThereOrNotToldMissesNobody) {
  talk.answer(sdo_answer(talk.agree_until({0x100A, 0}), 0x80, 0x0602'0000));
  EXPECT_EQ(ask(), next_row);
  Conversation silent;
  silent.answer(sdo_answer(silent.agree_until({0x100A, 0}), 0x41, 16));
  for (int tick = 0; tick < 40 && !silent.setup.fault(); ++tick)
    if (const auto question = silent.setup.tick(); question && text(*question) == next_row) return;
  FAIL() << "it is waited for";
}

TEST(Cia402Setup, TheWholeConversationWithATorqueDrive) {
  const char* const expected[] = {
      "000#8005",              // pre-operational
      "605#4000100000000000",  // what are you?
      "605#4018100100000000",  // whose?
      "605#4018100200000000",  // which product?
      "605#4018100300000000",  // which revision?
      "605#4018100400000000",  // which one of them?
      "605#400a100000000000",  // which software?
      "605#4002650000000000",  // which modes do you have?
      "605#2300140105020080",  // RPDO off: 80000205
      "605#2f00160000000000",  // empty its map
      "605#2300160110004060",  // 60400010
      "605#2300160208006060",  // 60600008
      "605#2300160310007160",  // 60710010
      "605#2f00160003000000",  // three entries
      "605#2f00140201000000",  // at every SYNC
      "605#2b00140532000000",  // deadline 50 ms
      "605#4000140500000000",  // and is it?
      "605#2300140105020000",  // RPDO on
      "605#23001801850100c0",  // TPDO off: C0000185
      "605#2f001a0000000000",
      "605#23001a0110004160",  // 60410010
      "605#23001a0220006460",  // 60640020
      "605#23001a0310007760",  // 60770010
      "605#2f001a0003000000",
      "605#2f00180201000000",
      "605#2300180185010040",  // TPDO on: 40000185
      "605#23011801850200c0",  // TPDO 2 to 4 off
      "605#23021801850300c0",
      "605#23031801850400c0",
      "605#2b17100064000000",  // heartbeat every 100 ms
      "605#2f6060000a000000",  // torque mode
      "605#4061600000000000",  // is it?
      "605#2fc2600101000000",  // 1
      "605#2fc26002fd000000",  // times 10^-3 s
      "605#4076600000000000",  // rated torque
      "605#2b726000e8030000",  // no more than 1000 per mille of it
      "605#4072600000000000",  // and is it?
      "000#0105",              // start
  };
  Conversation talk;
  for (const char* const one : expected) {
    const auto frame = talk.setup.tick();
    ASSERT_TRUE(frame) << one;
    EXPECT_EQ(text(*frame), one);
    if (frame->id == 0x605) {
      EXPECT_FALSE(talk.setup.configured());
      EXPECT_FALSE(talk.setup.tick()) << "one question in flight";
      talk.answer(talk.agreeing.answer(*frame));
    }
  }
  EXPECT_TRUE(talk.setup.configured());
  EXPECT_FALSE(talk.setup.done()) << "the drive has not said so";
  talk.setup.take_operational();
  EXPECT_TRUE(talk.setup.done());
  EXPECT_FALSE(talk.setup.fault());
  EXPECT_FALSE(talk.setup.tick());
}

TEST(Cia402Setup, OtherModesDifferInMapAndMode) {
  SetupValues values = kCst;
  values.mode = config::Cia402Mode::csp;
  Conversation position(values);
  EXPECT_EQ(text(position.agree_until({0x1600, 3})), "605#2300160320007a60");
  position.setup.restart();
  EXPECT_EQ(text(position.agree_until({0x6060, 0})), "605#2f60600008000000");
  values.mode = config::Cia402Mode::csv;
  Conversation velocity(values);
  EXPECT_EQ(text(velocity.agree_until({0x1600, 3})), "605#230016032000ff60");
  velocity.setup.restart();
  EXPECT_EQ(text(velocity.agree_until({0x6060, 0})), "605#2f60600009000000");
}

TEST(Cia402Setup, AsksAgainThenGivesUpThenStartsOver) {
  Conversation talk;
  const std::string first = text(talk.agree_until({0x1600, 2}));
  for (int again = 0; again < 2; ++again) {
    for (int tick = 1; tick < 4; ++tick) EXPECT_FALSE(talk.setup.tick()) << tick;
    const auto repeated = talk.setup.tick();
    ASSERT_TRUE(repeated);
    EXPECT_EQ(text(*repeated), first);
  }
  EXPECT_FALSE(talk.setup.fault());
  for (int tick = 1; tick <= 4; ++tick) EXPECT_FALSE(talk.setup.tick());
  EXPECT_EQ(talk.setup.fault(), SetupFault::settings_unread);
  for (int tick = 1; tick <= 10; ++tick) EXPECT_FALSE(talk.setup.tick()) << "pause";
  const auto over = talk.setup.tick();
  ASSERT_TRUE(over);
  EXPECT_EQ(text(*over), "000#8005");
  EXPECT_TRUE(talk.setup.fault()) << "until it ends well";
  talk.agree_with({0x6072, 0});
  talk.agree_with({0x6072, 0});
  EXPECT_EQ(text(*talk.setup.tick()), "000#0105");
  talk.setup.take_operational();
  EXPECT_TRUE(talk.setup.done());
  EXPECT_FALSE(talk.setup.fault());
}

TEST(Cia402Setup, ADriveThatNeverSaysItIsOperationalIsAskedAgain) {
  Conversation talk;
  talk.agree_with({0x6072, 0});
  talk.agree_with({0x6072, 0});
  EXPECT_EQ(talk.ticks_until_asked(), 1);
  EXPECT_EQ(talk.ticks_until_asked(), 4);
  EXPECT_EQ(talk.ticks_until_asked(), 4);
  EXPECT_EQ(talk.ticks_until_asked(), 4 + 10 + 1) << "given up, paused, started over";
  EXPECT_EQ(talk.setup.fault(), SetupFault::settings_unread);
}

TEST(Cia402Setup, ARefusalKeepsItsReason) {
  Conversation talk;
  talk.answer(sdo_answer(talk.agree_until({0x6060, 0}), 0x80, 0x06090030));
  EXPECT_EQ(talk.setup.fault(), SetupFault::setup_refused);
  EXPECT_EQ(talk.setup.abort_code(), 0x06090030U);
  EXPECT_EQ(talk.setup.fault_object(), (ObjectId{0x6060, 0}));
  config::Drive drive;
  drive.protocol = config::DriveProtocol::cia402;
  EXPECT_EQ(error_name(drive, talk.setup.error_code()),
            "the drive refused its set-up: object 6060:00, abort 06090030, value out of range");
  EXPECT_FALSE(talk.setup.configured());
}

TEST(Cia402Setup, OnlyPdosThatNobodyNeedsMayBeAbsent) {
  for (const std::uint32_t absent : {0x06020000U, 0x06090011U}) {
    Conversation talk;
    talk.answer(sdo_answer(talk.agree_until({0x1801, 1}), 0x80, absent));
    EXPECT_FALSE(talk.setup.fault());
    EXPECT_EQ(text(*talk.setup.tick()), "605#23021801850300c0");
    Conversation no_heartbeat;
    no_heartbeat.answer(sdo_answer(no_heartbeat.agree_until({0x1017, 0}), 0x80, absent));
    EXPECT_EQ(no_heartbeat.setup.fault(), SetupFault::setup_refused);
  }
  Conversation talk;
  talk.answer(sdo_answer(talk.agree_until({0x1801, 1}), 0x80, 0x08000022));
  EXPECT_EQ(talk.setup.fault(), SetupFault::setup_refused) << "there, and not willing";
}

std::string name_of(const Setup& setup) {
  config::Drive drive;
  drive.protocol = config::DriveProtocol::cia402;
  return error_name(drive, setup.error_code());
}

// Goal: sub-index 5 of 1400 is optional (CiA 301): such a drive is made to watch our heartbeat, and that is read back.
TEST(Cia402Setup, ADriveWithoutADeadlineWatchesOurHeartbeat) {
  Conversation talk;
  EXPECT_FALSE(talk.setup.needs_our_heartbeat());
  talk.answer(sdo_answer(talk.agree_until({0x1400, 5}), 0x80, 0x06090011));
  EXPECT_TRUE(talk.setup.needs_our_heartbeat());
  for (const char* const expected : {
           "605#2316100132007f00",  // node 127, 50 ms
           "605#4016100100000000",  // and is it?
           "605#2b07600001000000",  // its loss is a fault
           "605#4007600000000000",  //
           "605#2300140105020000",  // RPDO on
       }) {
    const auto question = talk.setup.tick();
    ASSERT_TRUE(question) << expected;
    EXPECT_EQ(text(*question), expected);
    talk.answer(talk.agreeing.answer(*question));
  }
  talk.agree_with({0x6072, 0});
  talk.agree_with({0x6072, 0});
  EXPECT_TRUE(talk.setup.tick());
  EXPECT_TRUE(talk.setup.configured());
}

TEST(Cia402Setup, NeitherDeadlineNorHeartbeatIsRefusedUnlessWaived) {
  Conversation talk;
  talk.answer(sdo_answer(talk.agree_until({0x1400, 5}), 0x80, 0x06090011));
  talk.answer(sdo_answer(talk.agree_until({0x1016, 1}), 0x80, 0x06020000));
  EXPECT_EQ(
      name_of(talk.setup),
      "the drive's own time-out is off or longer than 1 s, so nothing stops it when this computer dies (set it, or "
      "write drive.watchdog_waiver): object 1016:01, abort 06020000, no such object");
  // Heard, and to no effect: 6007 stays 0.
  Conversation idle;
  idle.answer(sdo_answer(idle.agree_until({0x1400, 5}), 0x80, 0x06090011));
  idle.agree_with({0x6007, 0});
  idle.answer(sdo_answer(idle.agree_until({0x6007, 0}), 0x4B, 0));
  EXPECT_NE(name_of(idle.setup).find("object 6007:00"), std::string::npos) << name_of(idle.setup);
  // 1 is a fault, 3 a quick stop: both end the torque. 4 is neither.
  for (const std::uint32_t reaction : {1U, 3U, 4U}) {
    Conversation other;
    other.answer(sdo_answer(other.agree_until({0x1400, 5}), 0x80, 0x06090011));
    other.agree_with({0x6007, 0});
    other.answer(sdo_answer(other.agree_until({0x6007, 0}), 0x4B, reaction));
    EXPECT_EQ(other.setup.fault().has_value(), reaction > 3) << reaction;
  }
  SetupValues waived = kCst;
  waived.watchdog_waived = true;
  Conversation allowed(waived);
  for (const ObjectId object : {ObjectId{0x1400, 5}, ObjectId{0x1016, 1}, ObjectId{0x1016, 1}, ObjectId{0x6007, 0}})
    allowed.answer(sdo_answer(allowed.agree_until(object), 0x80, 0x06020000));
  EXPECT_FALSE(allowed.setup.fault());
}

// Goal: what cannot be written is no refusal where it is already so: drives with a fixed mapping.
TEST(Cia402Setup, WhatIsNotToBeWrittenMustAlreadyBeSo) {
  for (const bool same : {true, false}) {
    Conversation talk;
    talk.answer(sdo_answer(talk.agree_until({0x1600, 0}), 0x80, 0x06010002));
    EXPECT_FALSE(talk.setup.fault()) << "its entries will tell";
    talk.answer(sdo_answer(talk.agree_until({0x1600, 1}), 0x80, 0x06010002));
    const auto question = talk.setup.tick();
    ASSERT_TRUE(question);
    EXPECT_EQ(text(*question), "605#4000160100000000");
    talk.answer(sdo_answer(*question, 0x43, same ? 0x60400010 : 0x60410010));
    EXPECT_EQ(talk.setup.fault().has_value(), !same);
    if (same)
      EXPECT_EQ(text(*talk.setup.tick()), "605#2300160208006060");
    else
      EXPECT_EQ(name_of(talk.setup), "the drive refused its set-up: object 1600:01, abort 06010002, can only be read");
  }
}

TEST(Cia402Setup, TheModeIsWaitedFor) {
  Conversation talk;
  auto question = talk.agree_until({0x6061, 0});
  for (int i = 0; i < 2; ++i) {
    talk.answer(sdo_answer(question, 0x4F, 0));  // no mode yet
    EXPECT_EQ(talk.ticks_until_asked(), 4);
  }
  talk.answer(sdo_answer(question, 0x4F, 10));
  EXPECT_EQ(text(*talk.setup.tick()), "605#2fc2600101000000");
  Conversation other;
  question = other.agree_until({0x6061, 0});
  for (int i = 0; i < 20; ++i) {
    other.answer(sdo_answer(question, 0x4F, 1));  // profile position, and it stays so
    other.setup.tick();
  }
  EXPECT_EQ(name_of(other.setup), "the drive's own settings differ from the robot file: object 6061:00");
}

// Goal: the card names the modes it knows, and shows any other as the number it is. Method: the drive's own answers;
// modes 7 and 11 are next to those that have a name.
TEST(Cia402Card, ShowsWhateverModeTheDriveTells) {
  config::RobotConfig robot;
  robot.joints.resize(1);
  robot.joints[0].drive.protocol = config::DriveProtocol::cia402;
  robot.joints[0].drive.id = 5;
  robot.joints[0].drive.mode = config::Cia402Mode::cst;
  DriveCard card(robot, 0);
  struct Row {
    std::uint32_t mode;
    const char* value;
    CardVerdict verdict;
  };
  for (const Row& row : {Row{7, "7", CardVerdict::differs}, Row{8, "8 (csp)", CardVerdict::differs},
                         Row{10, "10 (cst)", CardVerdict::agrees}, Row{11, "11", CardVerdict::differs}}) {
    EXPECT_TRUE(card.take(test::frame(0x585, {0x4F, 0x61, 0x60, 0, row.mode, 0, 0, 0})));
    const std::vector<CardEntry> entries = card.entries();
    const auto told = std::ranges::find(entries, CardItem::mode, &CardEntry::item);
    ASSERT_NE(told, entries.end());
    EXPECT_EQ(told->value, row.value);
    EXPECT_EQ(told->verdict, row.verdict);
  }
}

// Goal: 1 rad/s never becomes 68. Method: the unit that drives' manuals give for 60A9 (00B44700: rpm).
TEST(Cia402Setup, TheUnitOfTargetVelocityIsComparedWhereTheDriveTellsIt) {
  struct Row {
    config::Cia402VelocityUnit file;
    std::uint32_t told;
    bool agrees;
  };
  using enum config::Cia402VelocityUnit;
  for (const Row& row : {Row{rpm, 0x00B44700, true}, Row{counts_per_s, 0x00B44700, false}, Row{rpm, 0x00B50300, false},
                         Row{tenth_rpm, 0xFFB44700, true}, Row{rpm, 0xFFB44700, false},
                         Row{hundredth_rpm, 0xFEB44700, true}, Row{thousandth_rpm, 0xFDB44700, true}}) {
    SetupValues values = kCst;
    values.mode = config::Cia402Mode::csv;
    values.velocity_unit = row.file;
    Conversation talk(values);
    talk.answer(sdo_answer(talk.agree_until({0x60A9, 0}), 0x43, row.told));
    EXPECT_EQ(talk.setup.fault().has_value(), !row.agrees) << std::hex << row.told;
    Conversation silent(values);
    silent.answer(sdo_answer(silent.agree_until({0x60A9, 0}), 0x80, 0x06020000));
    EXPECT_FALSE(silent.setup.fault()) << "the robot file's word stands";
  }
}

// Goal: a CSP drive watches its position error where the robot file stops the robot for it, and is never told to
// otherwise; a drive without the objects, and one that was told nothing, is set up all the same.
TEST(Cia402Setup, TheWindowOfAPositionDriveIsWrittenWhereTheRobotStopsForIt) {
  SetupValues values = kCst;
  values.mode = config::Cia402Mode::csp;
  values.following_window = 1304;
  values.following_timeout_ms = 1000;
  Conversation told(values);
  EXPECT_EQ(text(told.agree_until({0x6065, 0})), "605#2365600018050000");
  told.agree_with({0x6065, 0});
  EXPECT_EQ(text(told.agree_until({0x6066, 0})), "605#2b666000e8030000");
  told.agree_with({0x6066, 0});
  told.answer(sdo_answer(told.agree_until({0x6065, 0}), 0x43, 1305));
  ASSERT_TRUE(told.setup.fault()) << "it kept another window";
  EXPECT_EQ(*told.setup.fault(), SetupFault::settings_differ);
  Conversation absent(values);
  absent.answer(sdo_answer(absent.agree_until({0x6065, 0}), 0x80, 0x06020000));
  absent.answer(sdo_answer(absent.agree_until({0x6066, 0}), 0x80, 0x06020000));
  EXPECT_FALSE(absent.setup.fault());
  values.following_window = 0;
  Conversation asked(values);
  EXPECT_EQ(text(asked.agree_until({0x6065, 0})), "605#4065600000000000") << "read, for the card";
  EXPECT_EQ(text(asked.agree_until({0x6066, 0})), "605#4066600000000000");
}

// Goal: what is sent to a drive that closes its own loop limits no torque, so the drive must.
TEST(Cia402Setup, TorqueIsLimitedInTheDriveWhereNothingElseDoes) {
  for (const auto mode : {config::Cia402Mode::csp, config::Cia402Mode::csv, config::Cia402Mode::cst}) {
    SetupValues values = kCst;
    values.mode = mode;
    values.max_torque_per_mille = 800;
    Conversation absent(values);
    absent.answer(sdo_answer(absent.agree_until({0x6072, 0}), 0x80, 0x06020000));
    EXPECT_EQ(absent.setup.fault().has_value(), mode != config::Cia402Mode::cst);
    Conversation deaf(values);
    deaf.agree_with({0x6072, 0});
    deaf.answer(sdo_answer(deaf.agree_until({0x6072, 0}), 0x4B, 801));
    EXPECT_EQ(deaf.setup.fault(), SetupFault::settings_differ);
    Conversation stricter(values);
    stricter.answer(sdo_answer(stricter.agree_until({0x6072, 0}), 0x80, 0x06010002));
    stricter.answer(sdo_answer(stricter.agree_until({0x6072, 0}), 0x4B, 500));
    EXPECT_FALSE(stricter.setup.fault());
  }
}

TEST(Cia402Setup, ComparesWhatTheDriveIs) {
  const auto verdict_on = [](ObjectId object, std::uint32_t found) {
    Conversation talk;
    talk.answer(sdo_answer(talk.agree_until(object), 0x43, found));
    return talk.setup.fault();
  };
  EXPECT_EQ(verdict_on({0x6076, 0}, 10'050), std::nullopt) << "half a percent";
  EXPECT_EQ(verdict_on({0x6076, 0}, 9'950), std::nullopt);
  EXPECT_EQ(verdict_on({0x6076, 0}, 10'051), SetupFault::settings_differ);
  EXPECT_EQ(verdict_on({0x6076, 0}, 0), SetupFault::settings_differ);
  EXPECT_EQ(verdict_on({0x6076, 0}, 0xFFFF'FFFF), SetupFault::settings_differ);
  EXPECT_EQ(verdict_on({0x6502, 0}, 0x200), std::nullopt);
  EXPECT_EQ(verdict_on({0x6502, 0}, 0x1FF), SetupFault::settings_differ) << "everything but torque mode";
  EXPECT_EQ(verdict_on({0x1000, 0}, 0x00420192), std::nullopt) << "any drive of the profile";
  EXPECT_EQ(verdict_on({0x1000, 0}, 0x00020191), SetupFault::settings_differ) << "an I/O module";
}

// Goal: a watchdog is not taken on trust. Method: a drive that acknowledges the deadline, and has none.
TEST(Cia402Setup, ADeadlineThatDoesNotStayIsAFaultThatNamesIt) {
  Conversation talk;
  talk.agree_with({0x1400, 5});
  const auto question = talk.setup.tick();
  ASSERT_TRUE(question);
  EXPECT_EQ(text(*question), "605#4000140500000000");
  talk.answer(sdo_answer(*question, 0x4B, 0));
  config::Drive drive;
  drive.protocol = config::DriveProtocol::cia402;
  const std::string name = error_name(drive, talk.setup.error_code());
  EXPECT_NE(name.find("own time-out is off"), std::string::npos) << name;
  EXPECT_NE(name.find("object 1400:05"), std::string::npos) << name;
}

TEST(Cia402Setup, AnswersToOtherQuestionsAreNone) {
  Conversation talk;
  const CanFrame question = talk.agree_until({0x1600, 1});
  talk.answer(sdo_answer(test::frame(0x605, {0, 0x00, 0x16, 0}), 0x60));
  talk.answer(sdo_answer(test::frame(0x605, {0, 0x00, 0x16, 2}), 0x80, 0x06020000));
  talk.answer(sdo_answer(question, 0x43, 3));  // a value where "written" belongs
  EXPECT_FALSE(talk.setup.fault());
  EXPECT_FALSE(talk.setup.tick());
  talk.answer(sdo_answer(question, 0x60));
  talk.answer(sdo_answer(question, 0x60));  // twice: asked twice
  EXPECT_EQ(text(*talk.setup.tick()), "605#2300160208006060");
}

TEST(Cia402Setup, AnAnswerOfBeforeARestartIsNone) {
  Conversation talk;
  EXPECT_EQ(text(*talk.setup.tick()), "000#8005");
  const CanFrame first = *talk.setup.tick();
  talk.setup.restart();
  EXPECT_EQ(text(*talk.setup.tick()), "000#8005");
  talk.answer(talk.agreeing.answer(first));
  EXPECT_EQ(text(*talk.setup.tick()), text(first));
}

TEST(Cia402Setup, PeriodsThatObject60C2CanHold) {
  struct Row {
    Duration period;
    int value, exponent;
  };
  for (const Row& row : {Row{milliseconds(1), 1, -3}, Row{milliseconds(2), 2, -3}, Row{milliseconds(10), 1, -2},
                         Row{microseconds(500), 5, -4}, Row{microseconds(1250), 125, -5},
                         Row{microseconds(125), 125, -6}, Row{seconds(1), 1, 0}, Row{milliseconds(255), 255, -3}}) {
    const auto period = interpolation_period(row.period);
    ASSERT_TRUE(period) << row.period.ns;
    EXPECT_EQ(period->value, row.value) << row.period.ns;
    EXPECT_EQ(period->exponent, row.exponent) << row.period.ns;
  }
  EXPECT_FALSE(interpolation_period(nanoseconds(1'000'001)));
  EXPECT_FALSE(interpolation_period(microseconds(1001)));
  EXPECT_FALSE(interpolation_period(milliseconds(256)));
  EXPECT_FALSE(interpolation_period({}));
}

}  // namespace
}  // namespace takt::drivers::cia402

// SPDX-License-Identifier: Apache-2.0
// Goal: the driver enables, drives and disables as its header promises, in joint units.
// Method: the drive's replies and answers are written by hand, byte for byte, and the frames that come out are read.
#include "drivers/protocol/mit/mit_driver.hpp"

#include <gtest/gtest.h>

#include <array>
#include <bit>
#include <cmath>
#include <limits>
#include <map>
#include <optional>
#include <vector>

namespace takt::drivers {
namespace {

const MitRange kDm4310{12.5F, 30, 500, 5, 10};

class Bench {
 public:
  explicit Bench(MitDriveSettings settings) : driver(settings), settings_(settings) {}

  // The command; a question beside it is kept in `question`.
  CanFrame encode(bool enable, const DriveSetpoint& setpoint = {}) {
    std::array<CanFrame, kMaxFramesPerDrive> out;
    const std::size_t count = driver.encode(enable, setpoint, {}, {}, out);
    EXPECT_TRUE(count == 1 || count == 2);
    EXPECT_EQ(out[0].id, settings_.id);
    EXPECT_EQ(out[0].length, 8);
    for (std::size_t i = 0; i < count; ++i)
      EXPECT_TRUE(out[i].fd == settings_.fd() && out[i].bit_rate_switch == out[i].fd);
    question = count == 2 ? std::optional(out[1]) : std::nullopt;
    return out[0];
  }
  int code_after_seven_ff(bool enable) {
    const CanFrame frame = encode(enable);
    for (int i = 0; i < 7; ++i)
      if (frame.data[i] != 0xFF) return -1;
    return frame.data[7];
  }
  // A Damiao drive's answer to a question about a register.
  bool answer(int register_number, std::uint32_t value, int operation = 0x33, std::uint32_t drive = 4) {
    ReceivedFrame received;
    received.received_at = MonoTime{++stamp_};
    received.frame.id = settings_.reply_id;
    received.frame.length = 8;
    received.frame.fd = received.frame.bit_rate_switch = settings_.fd();
    const std::array<std::uint32_t, 8> bytes{drive & 0xFFU,
                                             drive >> 8U,
                                             static_cast<std::uint32_t>(operation),
                                             static_cast<std::uint32_t>(register_number),
                                             value & 0xFFU,
                                             value >> 8U & 0xFFU,
                                             value >> 16U & 0xFFU,
                                             value >> 24U};
    for (std::size_t i = 0; i < 8; ++i) received.frame.data[i] = static_cast<std::uint8_t>(bytes[i]);
    return driver.decode(received);
  }
  // Ticks in which the drive reports that it is disabled and tells its settings, but for those it lacks.
  Bench& live(int ticks, const std::map<int, std::uint32_t>& told, bool enable = false) {
    for (int tick = 0; tick < ticks; ++tick) {
      const int code = code_after_seven_ff(enable);
      EXPECT_TRUE(code == 0xFD || may_enter) << "nothing but the exit while settings are unknown or wrong";
      reply(0x04);
      if (!question) continue;
      ++questions;
      const int number = question->data[3];
      EXPECT_EQ(question->id, 0x7FFU);
      if (question->data[2] == 0x55) {
        --questions;
        ++orders;
        EXPECT_EQ(number, 9);
        ordered = question->data[4] | question->data[5] << 8;
        EXPECT_TRUE(answer(9, obeys ? static_cast<std::uint32_t>(ordered) : told.contains(9) ? told.at(9) : 0, 0x55));
        continue;
      }
      if (told.contains(number)) {
        EXPECT_TRUE(answer(number, told.at(number)));
      }
    }
    return *this;
  }
  // As the robot file says; 2000 units of 50 us.
  static std::map<int, std::uint32_t> right() {
    return {{9, 2000},    {10, 1},          {13, 21},         {14, 5013},
            {15, 70'004}, {21, 0x41480000}, {22, 0x41F00000}, {23, 0x41200000}};  // 12.5, 30, 10
  }
  Bench& set_up() { return live(40, right()); }

  // Position 0x8000, velocity and torque in the middle.
  bool reply(int first_byte, int length = 8) {
    ReceivedFrame received;
    received.received_at = MonoTime{++stamp_};
    received.frame.id = settings_.reply_id;
    received.frame.length = static_cast<std::uint8_t>(length);
    received.frame.fd = received.frame.bit_rate_switch = settings_.fd() && !answers_classic;
    const std::array<int, 8> bytes{first_byte, 0x80, 0x00, 0x80, 0x08, 0x00, 30, 40};
    for (std::size_t i = 0; i < bytes.size(); ++i) received.frame.data[i] = static_cast<std::uint8_t>(bytes[i]);
    return driver.decode(received);
  }

  MitDriver driver;
  std::optional<CanFrame> question;
  int questions = 0, orders = 0, ordered = -1;
  bool obeys = true;  // an order's answer says what was ordered, whatever is told later
  bool may_enter = false;
  bool answers_classic = false;  // though it is spoken to in CAN FD

 private:
  MitDriveSettings settings_;
  std::int64_t stamp_ = 100;
};

MitDriveSettings damiao() {
  return {.range = kDm4310,
          .variant = MitVariant::damiao,
          .id = 4,
          .reply_id = 0x14,
          .mapping = {},
          .timeout = {2000, false}};
}
MitDriveSettings tmotor() {
  return {.range = kDm4310,
          .variant = MitVariant::tmotor,
          .id = 4,
          .reply_id = 0x14,
          .mapping = {},
          .timeout = {2000, true}};
}

constexpr int kDisabled = 0x04, kEnabled = 0x14, kLost = 0xD4;

TEST(MitDriver, KnowsNothingBeforeTheFirstReply) {
  Bench bench(damiao());
  EXPECT_FALSE(bench.driver.feedback().received_at.is_set());
  EXPECT_EQ(bench.driver.feedback().drive_state, DriveState::unknown);
}

TEST(MitDriver, DamiaoIsEnabledByItsOwnWord) {
  Bench bench = Bench(damiao()).set_up();
  EXPECT_EQ(bench.code_after_seven_ff(false), 0xFD);
  EXPECT_TRUE(bench.reply(kDisabled));
  EXPECT_EQ(bench.driver.feedback().drive_state, DriveState::disabled);
  EXPECT_EQ(bench.code_after_seven_ff(true), 0xFC);
  EXPECT_TRUE(bench.reply(kDisabled)) << "sent before the drive read the command";
  EXPECT_EQ(bench.code_after_seven_ff(true), 0xFC) << "not before the drive says so";
  EXPECT_TRUE(bench.reply(kEnabled));
  EXPECT_EQ(bench.driver.feedback().drive_state, DriveState::enabled);
  EXPECT_EQ(bench.code_after_seven_ff(true), -1) << "now motion commands";
  EXPECT_EQ(bench.code_after_seven_ff(false), 0xFD);
}

TEST(MitDriver, TMotorIsEnabledByTheFirstReplyAfterTheRequest) {
  Bench bench(tmotor());
  EXPECT_TRUE(bench.reply(4, 6));
  EXPECT_EQ(bench.driver.feedback().drive_state, DriveState::unknown);
  bench.encode(false);
  EXPECT_TRUE(bench.reply(4, 6));
  EXPECT_EQ(bench.driver.feedback().drive_state, DriveState::disabled);
  EXPECT_EQ(bench.code_after_seven_ff(true), 0xFC);
  EXPECT_EQ(bench.code_after_seven_ff(true), 0xFC) << "no reply, not enabled";
  EXPECT_TRUE(bench.reply(4, 6));
  EXPECT_EQ(bench.driver.feedback().drive_state, DriveState::enabled);
  EXPECT_EQ(bench.code_after_seven_ff(true), -1);
}

TEST(MitDriver, DoesNotBringBackADriveThatLeftByItself) {
  Bench bench = Bench(damiao()).set_up();
  bench.encode(true);
  bench.reply(kEnabled);
  bench.encode(true);
  for (const int state : {kDisabled, kLost}) {
    bench.reply(state);
    EXPECT_EQ(bench.code_after_seven_ff(true), -1) << state;
  }
  bench.encode(false);
  bench.reply(kDisabled);
  bench.set_up();
  EXPECT_EQ(bench.code_after_seven_ff(true), 0xFC) << "after a disable in between it may";
}

TEST(MitDriver, ReportsAndClearsADamiaoErrorWhileDisabled) {
  Bench bench(damiao());
  bench.reply(kLost);
  EXPECT_EQ(bench.driver.feedback().drive_state, DriveState::fault);
  EXPECT_EQ(bench.driver.feedback().error_code, 0xDU);
  EXPECT_EQ(bench.code_after_seven_ff(false), 0xFB);
  EXPECT_EQ(bench.code_after_seven_ff(false), 0xFD);
  EXPECT_EQ(bench.code_after_seven_ff(false), 0xFB);
  bench.reply(kDisabled);
  EXPECT_EQ(bench.driver.feedback().error_code, 0U);
  EXPECT_EQ(bench.code_after_seven_ff(false), 0xFD);
}

TEST(MitDriver, ATMotorDriveIsAskedNothing) {
  Bench bench(tmotor());
  for (int tick = 0; tick < 50; ++tick) {
    bench.encode(false);
    EXPECT_FALSE(bench.question);
    bench.reply(4, 6);
  }
  EXPECT_EQ(bench.code_after_seven_ff(true), 0xFC);
}

TEST(MitDriver, ASilentDamiaoDriveIsAskedNothing) {
  Bench bench(damiao());
  for (int tick = 0; tick < 1000; ++tick) {
    bench.encode(false);
    ASSERT_FALSE(bench.question);
  }
  EXPECT_EQ(bench.driver.feedback().error_code, 0U) << "a drive without power is not one that hides its settings";
}

TEST(MitDriver, AsksForEverySettingOnceAndKeepsTheDriveReporting) {
  Bench bench(damiao());
  std::vector<int> asked;
  for (int tick = 0; tick < 40; ++tick) {
    EXPECT_EQ(bench.code_after_seven_ff(false), 0xFD);
    bench.reply(kDisabled);
    if (!bench.question) continue;
    const CanFrame& question = *bench.question;
    // [drive low, drive high, 33 or 55, register, value]
    EXPECT_EQ(question.data[0] | question.data[1] << 8, 4);
    EXPECT_EQ(question.length, 8);
    asked.push_back(question.data[2] << 8 | question.data[3]);
    EXPECT_TRUE(bench.answer(question.data[3], Bench::right().at(question.data[3]), question.data[2]));
  }
  EXPECT_EQ(asked, (std::vector<int>{0x330A, 0x3315, 0x3316, 0x3317, 0x330D, 0x330E, 0x330F, 0x5509, 0x3309}));
  EXPECT_EQ(bench.driver.feedback().replies, 40) << "answers are no reports, and replace none";
  EXPECT_EQ(bench.driver.feedback().drive_state, DriveState::disabled);
  EXPECT_EQ(bench.driver.stored_timeout(), milliseconds(100));
  EXPECT_EQ(bench.code_after_seven_ff(true), 0xFC);
}

TEST(MitDriver, IsNotEnabledBeforeItsSettingsAreKnown) {
  Bench bench(damiao());
  auto told = Bench::right();
  told.erase(9);
  bench.live(44, told, true);
  EXPECT_EQ(bench.driver.feedback().drive_state, DriveState::disabled) << "waiting is no fault";
  EXPECT_EQ(bench.driver.stored_timeout(), std::nullopt);
  bench.may_enter = true;
  bench.live(8, Bench::right(), true);
  EXPECT_EQ(bench.code_after_seven_ff(true), 0xFC);
}

TEST(MitDriver, SettingsHalfReadBeforeSilenceAreReadAgain) {
  Bench bench(damiao());
  bench.live(14, Bench::right());
  EXPECT_GT(bench.questions, 1);
  EXPECT_LT(bench.questions, 5);
  for (int tick = 0; tick < 50; ++tick) bench.encode(false);  // another drive may come back with this id
  bench.questions = 0;
  bench.live(40, Bench::right());
  EXPECT_EQ(bench.questions, 8) << "each of them";
}

TEST(MitDriver, ASettingThatDiffersIsAFaultThatNamesIt) {
  const float nan = std::numeric_limits<float>::quiet_NaN();
  struct Row {
    int number;
    std::uint32_t value;
    const char* name;
  };
  const Row rows[] = {
      {10, 2, "control mode (register 10)"},
      {21, std::bit_cast<std::uint32_t>(12.566F), "position range (register 21)"},
      {22, std::bit_cast<std::uint32_t>(45.0F), "velocity range (register 22)"},
      {23, std::bit_cast<std::uint32_t>(-10.0F), "torque range (register 23)"},
      {23, std::bit_cast<std::uint32_t>(10.0001F), "torque range (register 23)"},
      {21, std::bit_cast<std::uint32_t>(nan), "position range (register 21)"},
  };
  for (const Row& row : rows) {
    Bench bench(damiao());
    auto told = Bench::right();
    told[row.number] = row.value;
    bench.live(100, told, true);
    EXPECT_EQ(bench.driver.feedback().drive_state, DriveState::fault) << row.name;
    EXPECT_EQ(bench.driver.feedback().error_code,
              setup_fault_code(SetupFault::settings_differ, static_cast<std::uint32_t>(row.number)));
    config::Drive drive;
    drive.variant = "damiao";
    EXPECT_EQ(error_name(drive, bench.driver.feedback().error_code),
              "the drive's own settings differ from the robot file: " + std::string(row.name));
  }
}

// Goal: no Damiao drive is armed while nothing would stop it when this computer dies. Method: drives whose register 9
// (time-out, units of 50 us, 0: off) holds each kind of value and does not take ours.
TEST(MitDriver, ATimeoutThatIsOffOrUnknownIsAFaultThatNamesIt) {
  struct Row {
    const char* when;
    std::optional<std::uint32_t> told;
    std::uint32_t code;  // 0: may be enabled
    const char* name;
  };
  const Row rows[] = {
      {"off", 0U, setup_fault_code(SetupFault::watchdog_off, 9), "off or longer than 1 s"},
      {"an hour", 72'000'000U, setup_fault_code(SetupFault::watchdog_off, 9), "off or longer than 1 s"},
      {"untold", std::nullopt, setup_fault_code(SetupFault::watchdog_unknown, 9), "does not tell"},
      {"another one that stops it soon enough", 1600U, 0, ""},
  };
  for (const Row& row : rows) {
    Bench bench(damiao());
    bench.obeys = false;
    bench.may_enter = row.code == 0;
    auto told = Bench::right();
    told.erase(9);
    if (row.told) told[9] = *row.told;
    bench.live(150, told, true);
    EXPECT_EQ(bench.ordered, 2000) << row.when;
    EXPECT_EQ(bench.driver.feedback().error_code, row.code) << row.when;
    if (row.code == 0) {
      EXPECT_EQ(bench.code_after_seven_ff(true), 0xFC) << row.when;
      continue;
    }
    EXPECT_EQ(bench.driver.feedback().drive_state, DriveState::fault) << row.when;
    config::Drive drive;
    drive.variant = "damiao";
    const std::string name = error_name(drive, row.code);
    EXPECT_NE(name.find(row.name), std::string::npos) << name;
    EXPECT_NE(name.find("register 9"), std::string::npos) << name;

    MitDriveSettings waived = damiao();
    waived.timeout.waived = true;
    Bench allowed(waived);
    allowed.obeys = false;
    allowed.live(150, told);
    EXPECT_EQ(allowed.driver.feedback().error_code, 0U) << row.when;
    EXPECT_EQ(allowed.code_after_seven_ff(true), 0xFC) << row.when << ": waived";
  }
}

TEST(MitDriver, ATMotorDriveNeedsAWaiverSinceItTellsNoTimeout) {
  MitDriveSettings settings = tmotor();
  settings.timeout.waived = false;
  Bench bench(settings);
  for (int tick = 0; tick < 100; ++tick) {
    EXPECT_EQ(bench.code_after_seven_ff(true), 0xFD);
    bench.reply(4, 6);
  }
  EXPECT_EQ(bench.driver.feedback().drive_state, DriveState::fault);
  EXPECT_EQ(bench.driver.feedback().error_code, setup_fault_code(SetupFault::watchdog_unknown));
  config::Drive drive;
  drive.variant = "tmotor";
  EXPECT_NE(error_name(drive, bench.driver.feedback().error_code).find("watchdog_waiver"), std::string::npos);
}

// It tells neither time-out nor state, and its frame for clearing an error is sent by no one: what it answered would
// look like a reading.
TEST(MitDriver, ARobstrideInMitProtocolNeedsAWaiverAndIsTakenForWhatItWasTold) {
  MitDriveSettings settings = tmotor();
  settings.variant = MitVariant::robstride;
  Bench waived(settings);
  EXPECT_EQ(waived.code_after_seven_ff(false), 0xFD);
  waived.reply(4, 8);
  EXPECT_EQ(waived.driver.feedback().drive_state, DriveState::disabled);
  EXPECT_EQ(waived.code_after_seven_ff(true), 0xFC);
  waived.reply(4, 8);
  EXPECT_EQ(waived.driver.feedback().drive_state, DriveState::enabled);
  settings.timeout.waived = false;
  Bench refused(settings);
  for (int tick = 0; tick < 100; ++tick) {
    EXPECT_EQ(refused.code_after_seven_ff(true), 0xFD);
    refused.reply(4, 8);
  }
  EXPECT_EQ(refused.driver.feedback().error_code, setup_fault_code(SetupFault::watchdog_unknown));
}

// Goal: a drive with other firmware is refused by name, not as one that is silent or a stranger. Method: a drive that
// answers nothing and reports as AK V3 firmware does (29-bit id, 0x29 in front of its number).
TEST(MitDriver, AkV3FirmwareIsRefusedByName) {
  Bench bench(tmotor());
  ReceivedFrame v3;
  v3.frame.id = 0x2904;
  v3.frame.extended = true;
  v3.frame.length = 8;
  EXPECT_TRUE(bench.driver.decode(v3)) << "no stranger";
  EXPECT_EQ(bench.driver.feedback().replies, 0) << "and no reading";
  EXPECT_EQ(bench.driver.feedback().drive_state, DriveState::fault);
  config::Drive drive;
  drive.variant = "tmotor";
  EXPECT_NE(error_name(drive, bench.driver.feedback().error_code).find("AK V3 firmware"), std::string::npos);
  EXPECT_EQ(bench.code_after_seven_ff(true), 0xFD) << "not enabled";
  for (std::uint32_t tick = 0; tick < MitDriver::kTicksToForget; ++tick) bench.encode(false);
  bench.reply(4, 6);
  EXPECT_EQ(bench.driver.feedback().drive_state, DriveState::disabled) << "set right with the maker's tool";
  v3.frame.id = 0x2905;
  EXPECT_FALSE(bench.driver.decode(v3)) << "another drive's";
}

// The order is lost with the supply: a drive that was silent, and one that was driven since, gets it again.
TEST(MitDriver, TheTimeoutIsWrittenAgainAfterSilenceAndAfterEveryStop) {
  Bench bench = Bench(damiao()).set_up();
  EXPECT_EQ(bench.live(200, Bench::right()).orders, 1) << "a drive that goes on answering was told once";
  for (int tick = 0; tick < 50; ++tick) bench.encode(false);
  bench.reply(kDisabled);
  EXPECT_EQ(bench.code_after_seven_ff(true), 0xFD) << "it may have been without power: not before it was told again";
  EXPECT_EQ(bench.live(40, Bench::right()).orders, 2);
  bench.encode(true);
  bench.reply(kEnabled);
  bench.encode(true);
  bench.reply(kDisabled);
  EXPECT_EQ(bench.live(40, Bench::right()).orders, 3) << "its supply may have blinked while it was driven";
}

TEST(MitDriver, ADriveThatDoesNotTellIsAFaultAfterAFewTries) {
  Bench bench(damiao());
  bench.live(100, {});
  EXPECT_EQ(bench.questions, 10);
  EXPECT_EQ(bench.driver.feedback().drive_state, DriveState::fault);
  EXPECT_EQ(bench.driver.feedback().error_code, setup_fault_code(SetupFault::settings_unread, 10));
}

TEST(MitDriver, ASettingsFaultStaysUntilTheDriveAgreesWhateverIsCleared) {
  Bench bench(damiao());
  auto told = Bench::right();
  told[23] = std::bit_cast<std::uint32_t>(28.0F);
  bench.live(100, told);
  EXPECT_EQ(bench.code_after_seven_ff(false), 0xFD) << "there is nothing to clear in the drive";
  bench.reply(kLost);
  EXPECT_EQ(bench.driver.feedback().error_code, 0xDU) << "the drive's own fault shows first";
  EXPECT_EQ(bench.code_after_seven_ff(false), 0xFB);
  bench.reply(kDisabled);
  bench.live(2000, told);
  EXPECT_EQ(bench.driver.feedback().error_code, setup_fault_code(SetupFault::settings_differ, 23));
  // Set right with the maker's tool: within half a second at 1 kHz it is noticed.
  bench.live(560, Bench::right());
  EXPECT_EQ(bench.driver.feedback().drive_state, DriveState::disabled);
  EXPECT_EQ(bench.driver.feedback().error_code, 0U);
  EXPECT_EQ(bench.code_after_seven_ff(true), 0xFC);
}

TEST(MitDriver, AnswersThatNobodyAskedForChangeNothing) {
  Bench bench = Bench(damiao()).set_up();
  EXPECT_TRUE(bench.answer(23, std::bit_cast<std::uint32_t>(28.0F))) << "its own, and no reading";
  EXPECT_EQ(bench.driver.feedback().replies, 40);
  EXPECT_EQ(bench.driver.feedback().drive_state, DriveState::disabled);
  EXPECT_FALSE(bench.answer(23, 0, 0x33, 5)) << "another drive's";
  Bench fresh(damiao());
  for (const int number : {10, 21, 22, 23, 9}) fresh.answer(number, Bench::right().at(number));
  EXPECT_EQ(fresh.code_after_seven_ff(true), 0xFD) << "not asked: not believed";
}

TEST(MitDriver, IgnoresWhatIsNotItsOwnAndCountsWhatIsMalformed) {
  Bench bench(damiao());
  EXPECT_FALSE(bench.reply(0x15)) << "another drive behind the same master id";
  EXPECT_EQ(bench.driver.malformed_frames(), 0U);
  EXPECT_FALSE(bench.reply(kEnabled, 6));
  EXPECT_FALSE(bench.reply(kEnabled, 0));
  EXPECT_EQ(bench.driver.malformed_frames(), 2U);
  ReceivedFrame foreign;
  foreign.frame.id = 0x13;
  foreign.frame.length = 8;
  EXPECT_FALSE(bench.driver.decode(foreign));
  EXPECT_FALSE(bench.driver.feedback().received_at.is_set());
}

// Goal: a drive whose replies lost their stamps goes silent, it does not go back in time. What is older than the newest
// reading, or of unknown age, only counts.
TEST(MitDriver, AReplyOlderThanTheNewestOnlyCounts) {
  Bench bench = Bench(damiao()).set_up();
  bench.reply(kDisabled);
  const JointFeedback before = bench.driver.feedback();
  ReceivedFrame old;
  old.received_at = before.received_at - Duration{1};
  old.frame.id = 0x14;
  old.frame.length = 8;
  old.frame.data[0] = 0x04;
  old.frame.data[1] = 0xC0;
  EXPECT_TRUE(bench.driver.decode(old));
  EXPECT_EQ(bench.driver.feedback().received_at, before.received_at);
  EXPECT_EQ(bench.driver.feedback().q, before.q);
  EXPECT_EQ(bench.driver.feedback().replies, before.replies + 1);
}

TEST(MitDriver, StampsAndTemperatureOfTheNewestReply) {
  Bench bench(damiao());
  bench.reply(kDisabled);
  bench.reply(kDisabled);
  EXPECT_EQ(bench.driver.feedback().received_at.ns, 102);
  EXPECT_EQ(bench.driver.feedback().temperature_C, 40);
}

// Goal: direction, offset and gear are applied once, both ways, gains squared.
MitDriveSettings damiao_fd() {
  MitDriveSettings settings = damiao();
  settings.fd_bit_rate_code = 9;  // 5 Mbit/s
  return settings;
}

TEST(MitDriver, OverCanFdEveryFrameIsOneAndTheDriveMustSayItsRate) {
  std::map<int, std::uint32_t> told = Bench::right();
  told[35] = 9;
  Bench agrees(damiao_fd());
  agrees.may_enter = true;
  agrees.live(60, told).live(3, told, true);
  EXPECT_EQ(agrees.driver.feedback().error_code, 0U);
  EXPECT_EQ(agrees.code_after_seven_ff(true), 0xFC);

  told[35] = 5;  // 2 Mbit/s
  Bench differs(damiao_fd());
  differs.live(60, told);
  EXPECT_EQ(differs.driver.feedback().error_code, setup_fault_code(SetupFault::settings_differ, 35));
  EXPECT_EQ(differs.code_after_seven_ff(true), 0xFD);

  told.erase(35);
  Bench untold(damiao_fd());
  untold.live(100, told);
  EXPECT_EQ(untold.driver.feedback().error_code, setup_fault_code(SetupFault::settings_unread, 35));
  EXPECT_STREQ(damiao_register_name(35), "bit rate of CAN FD (register 35)");
}

TEST(MitDriver, AClassicAnswerIsNoneOfADriveThatSpeaksCanFd) {
  Bench bench(damiao_fd());
  bench.answers_classic = true;
  EXPECT_TRUE(bench.reply(kDisabled)) << "no stranger's";
  EXPECT_FALSE(bench.driver.feedback().received_at.is_set());
  EXPECT_EQ(bench.driver.feedback().error_code, setup_fault_code(SetupFault::other_protocol, MitDriver::kOtherFrames));
  bench.answers_classic = false;
  EXPECT_TRUE(bench.reply(kDisabled));
  Bench classic(damiao());
  EXPECT_TRUE(classic.reply(kDisabled));
}

TEST(MitDriver, TheOutputStageIsToldApartFromTheWinding) {
  Bench bench(damiao());
  bench.reply(kDisabled);
  EXPECT_EQ(bench.driver.feedback().casing_C, 30);
  Bench one(tmotor());
  one.reply(0x04, 6);
  EXPECT_EQ(one.driver.feedback().casing_C, 0);
}

// Two public sources name them; what one alone knows is none.
TEST(DamiaoRegisters, BitRatesAreTheCodesOnWhichSourcesAgree) {
  EXPECT_EQ(damiao_bit_rate_code(2'000'000), 5U);
  EXPECT_EQ(damiao_bit_rate_code(2'500'000), 6U);
  EXPECT_EQ(damiao_bit_rate_code(3'200'000), 7U);
  EXPECT_EQ(damiao_bit_rate_code(4'000'000), 8U);
  EXPECT_EQ(damiao_bit_rate_code(5'000'000), 9U);
  EXPECT_EQ(damiao_bit_rate_code(8'000'000), 0U);
  EXPECT_EQ(damiao_bit_rate_code(1'000'000), 0U);
}

TEST(MitDriver, NamesTheErrorsOfBothVariantsAndNoOthers) {
  config::Drive drive;
  drive.variant = "damiao";
  EXPECT_EQ(mit_error_name(drive, 7), "");
  EXPECT_EQ(mit_error_name(drive, 8), "over-voltage");
  EXPECT_EQ(mit_error_name(drive, 14), "overload");
  EXPECT_EQ(mit_error_name(drive, 15), "");
  drive.variant = "tmotor";
  EXPECT_EQ(mit_error_name(drive, 1), "over-temperature");
  EXPECT_EQ(mit_error_name(drive, 6), "phase unbalance");
  EXPECT_EQ(mit_error_name(drive, 7), "");
}

TEST(MitDriver, ConvertsBetweenJointAndMotor) {
  MitDriveSettings settings = damiao();
  settings.mapping.offset = 0.5F;
  settings.mapping.ratio = -2;
  Bench bench = Bench(settings).set_up();
  bench.encode(true);
  bench.reply(kEnabled);
  const CanFrame frame = bench.encode(true, {.q = 1.5F, .dq = 2, .kp = 40, .kd = 4, .tau = 3});
  // Motor side: p = (1.5 - 0.5) * -2 = -2 rad, v = -4 rad/s, kp = 40 / 4, kd = 4 / 4, t = 3 / -2.
  const MitPayload expected = encode_mit_command(kDm4310, {.p = -2, .v = -4, .kp = 10, .kd = 1, .t = -1.5F});
  for (std::size_t i = 0; i < 8; ++i) EXPECT_EQ(frame.data[i], expected[i]) << i;

  // Motor 0x8000 is +0.19 mrad: almost at zero, hence the joint almost at its offset.
  EXPECT_NEAR(bench.driver.feedback().q, 0.5, 4e-4);
  ReceivedFrame received;
  received.received_at = bench.driver.feedback().received_at + milliseconds(1);
  received.frame.id = 0x14;
  received.frame.length = 8;
  // Position code 0xC000 is 12.5 * (2 * 49152 / 65535 - 1) = 6.2502 rad; velocity and torque codes
  // 0xC00: 15.005, 5.0012.
  const std::uint8_t bytes[8]{0x14, 0xC0, 0x00, 0xC0, 0x0C, 0x00, 0, 0};
  std::copy_n(bytes, 8, received.frame.data);
  EXPECT_TRUE(bench.driver.decode(received));
  EXPECT_NEAR(bench.driver.feedback().q, 6.2502 / -2 + 0.5, 1e-3);
  EXPECT_NEAR(bench.driver.feedback().dq, 15.005 / -2, 1e-2);
  EXPECT_NEAR(bench.driver.feedback().tau, 5.0012 * -2, 1e-2);
}

}  // namespace
}  // namespace takt::drivers

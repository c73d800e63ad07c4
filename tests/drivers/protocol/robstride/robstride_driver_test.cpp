// SPDX-License-Identifier: Apache-2.0
// Goal: the driver sets its drive up, enables, drives and stops it as its header promises, in joint units.
// Method: the drive's words are written by hand, byte for byte, and the frames that come out are read.
#include "drivers/protocol/robstride/robstride_driver.hpp"

#include <gtest/gtest.h>

#include <array>
#include <cstdio>
#include <map>
#include <string>
#include <vector>

#include "drivers/protocol/bus_load.hpp"

namespace takt::drivers {
namespace {

const RobstrideRange kCyberGear{12.566371F, 30, 500, 5, 12};
constexpr std::uint32_t kDrive = 0x05, kHost = 0xFD;

enum Type : std::uint32_t { get_id = 0, motion = 1, enable = 3, stop = 4, question = 17, setting = 18 };

RobstrideDriveSettings settings(JointMapping mapping = {}) {
  return {.range = kCyberGear, .address = {kDrive, kHost}, .mapping = mapping, .timeout = {.units = 2000}};
}

// "7028"
std::string index_of(const CanFrame& frame) {
  std::array<char, 8> digits{};
  std::snprintf(digits.data(), digits.size(), "%02X%02X", frame.data[1], frame.data[0]);
  return digits.data();
}

class Bench {
 public:
  explicit Bench(const RobstrideDriveSettings& from = settings()) : driver(from) {}

  std::vector<CanFrame> encode(bool enabled, const DriveSetpoint& setpoint = {}) {
    std::array<CanFrame, kMaxFramesPerDrive> out;
    const std::size_t count = driver.encode(enabled, setpoint, {}, {}, out);
    for (std::size_t i = 0; i < count; ++i) {
      EXPECT_TRUE(out[i].extended);
      EXPECT_EQ(out[i].length, 8);
      EXPECT_EQ(out[i].id & 0xFFU, kDrive);
    }
    return {out.begin(), out.begin() + static_cast<std::ptrdiff_t>(count)};
  }
  std::uint32_t first_type(bool enabled) { return encode(enabled).at(0).id >> 24U; }

  // A frame from the drive.
  bool hears(std::uint32_t id, std::array<int, 8> bytes, int length = 8) {
    ReceivedFrame received;
    received.received_at = MonoTime{++stamp_};
    received.frame.id = id;
    received.frame.extended = true;
    received.frame.length = static_cast<std::uint8_t>(length);
    for (std::size_t i = 0; i < 8; ++i) received.frame.data[i] = static_cast<std::uint8_t>(bytes[i]);
    return driver.decode(received);
  }
  // Everything in the middle, 30 degrees.
  bool feedback(std::uint32_t mode, std::uint32_t faults = 0) {
    return hears(2U << 24U | mode << 22U | faults << 16U | kDrive << 8U | kHost,
                 {0x80, 0, 0x80, 0, 0x80, 0, 0x01, 0x2C});
  }
  bool answer(int index, int value) {
    return hears(17U << 24U | kDrive << 8U | kHost, {index & 0xFF, index >> 8, 0, 0, value & 0xFF, value >> 8, 0, 0});
  }
  bool refuses(int index) {
    return hears(17U << 24U | 1U << 16U | kDrive << 8U | kHost, {index & 0xFF, index >> 8, 0, 0, 0, 0, 0, 0});
  }
  // What an honest drive does in a standby tick. Returns the frames it got. `told`: of which parameters it says what,
  // by index; silent about others.
  std::vector<CanFrame> honest_tick(bool enabled,
                                    const std::map<int, int>& told = {{0x7005, 0}, {0x7028, 2000}, {0x7029, 0}}) {
    const auto frames = encode(enabled);
    for (const CanFrame& frame : frames) {
      if (frame.id >> 24U == get_id) {
        if (tells_id) hears(kDrive << 8U | 0xFEU, {0x00, 0xC0, 0xFF, 0xEE, 0x12, 0x34, 0x56, 0x78});
        continue;
      }
      if (frame.id >> 24U != question) {
        feedback(0);
        continue;
      }
      const int index = frame.data[0] | frame.data[1] << 8;
      if (told.contains(index)) answer(index, told.at(index));
    }
    return frames;
  }
  Bench& set_up() {
    for (int tick = 0; tick < 60; ++tick) honest_tick(false);
    EXPECT_TRUE(driver.stored_timeout());
    return *this;
  }

  RobstrideDriver driver;
  bool tells_id = true;

 private:
  std::int64_t stamp_ = 100;
};

TEST(RobstrideDriver, KnowsNothingBeforeTheFirstFeedback) {
  Bench bench;
  EXPECT_FALSE(bench.driver.feedback().received_at.is_set());
  EXPECT_EQ(bench.driver.feedback().drive_state, DriveState::unknown);
}

TEST(RobstrideDriver, AsksASilentDriveNothing) {
  Bench bench;
  for (int tick = 0; tick < 1000; ++tick) {
    const auto frames = bench.encode(false);
    ASSERT_EQ(frames.size(), 1U);
    ASSERT_EQ(frames[0].id >> 24U, stop);
  }
  EXPECT_EQ(bench.driver.feedback().error_code, 0U) << "a drive without power is not one that refuses";
}

TEST(RobstrideDriver, SetsRunModeAndTimeoutAndReadsThemBack) {
  Bench bench;
  std::vector<std::string> told;
  int reports = 0;
  for (int tick = 0; tick < 40; ++tick) {
    for (const CanFrame& frame : bench.honest_tick(false)) {
      reports += frame.id >> 24U != question && frame.id >> 24U != get_id ? 1 : 0;
      if (frame.id >> 24U == get_id) told.emplace_back("who");
      if (frame.id >> 24U == setting) told.push_back("write " + index_of(frame));
      if (frame.id >> 24U == question) told.push_back("read " + index_of(frame));
      EXPECT_EQ(frame.id >> 8U & 0xFFFFU, kHost);
    }
  }
  EXPECT_EQ(told, (std::vector<std::string>{"write 7005", "read 7005", "write 7028", "read 7028", "read 7029", "who"}))
      << "each once";
  EXPECT_EQ(reports, 40) << "one frame per tick that feedback answers";
  EXPECT_EQ(bench.driver.stored_timeout(), milliseconds(100)) << "2000 units of 50 us";
}

TEST(RobstrideDriver, DoesNotTouchTheModeOfADriveThatRuns) {
  Bench bench;
  for (int tick = 0; tick < 20; ++tick) {
    bench.feedback(2);
    EXPECT_EQ(bench.encode(false).size(), 1U);
    EXPECT_EQ(bench.first_type(false), stop);
  }
}

TEST(RobstrideDriver, IsNotEnabledBeforeItsRunModeAndTimeoutAreKnown) {
  Bench bench;
  bool known = false;
  for (int tick = 0; tick < 40; ++tick) {
    for (const CanFrame& frame : bench.encode(true)) {
      const std::uint32_t type = frame.id >> 24U;
      EXPECT_EQ(type == enable, known);
      if (type == get_id) known = bench.hears(kDrive << 8U | 0xFEU, {1, 2, 3, 4, 5, 6, 7, 8});
      if (type != question && type != get_id) bench.feedback(0);
      if (type != question) continue;
      const int index = frame.data[0] | frame.data[1] << 8;
      bench.answer(index, index == 0x7028 ? 2000 : 0);
    }
  }
  EXPECT_TRUE(known);
}

TEST(RobstrideDriver, ARunModeThatDoesNotStayIsAFaultUntilItDoes) {
  Bench bench;
  for (int tick = 0; tick < 100; ++tick) {
    for (const CanFrame& frame : bench.honest_tick(true, {{0x7005, 2}})) ASSERT_NE(frame.id >> 24U, enable);
  }
  EXPECT_EQ(bench.driver.feedback().drive_state, DriveState::fault);
  EXPECT_EQ(bench.driver.feedback().error_code, setup_fault_code(SetupFault::setup_refused, 0x7005));
  config::Drive drive;
  drive.protocol = config::DriveProtocol::robstride;
  EXPECT_EQ(error_name(drive, bench.driver.feedback().error_code),
            "the drive refused its set-up: run mode (parameter 7005)");
  for (int tick = 0; tick < 600; ++tick) bench.honest_tick(false);
  EXPECT_EQ(bench.driver.feedback().drive_state, DriveState::disabled) << "tried again";
  EXPECT_EQ(bench.driver.feedback().error_code, 0U);
}

// Goal: a drive that cannot be set up is asked twice a second and no more: others share its bus.
TEST(RobstrideDriver, AFailedSetUpRestsForHalfASecond) {
  Bench bench;
  const auto asks = [&bench] {
    return std::ranges::any_of(bench.honest_tick(false, {{0x7005, 2}}), [](const CanFrame& frame) {
      const std::uint32_t type = frame.id >> 24U;
      return type == question || type == setting;
    });
  };
  int ticks = 0;
  for (; bench.driver.feedback().drive_state != DriveState::fault && ticks < 200; ++ticks) asks();
  ASSERT_LT(ticks, 200);
  int resting = 0;
  while (resting < 1000 && !asks()) ++resting;
  EXPECT_GE(resting, 490);
  EXPECT_LE(resting, 510);
}

TEST(RobstrideDriver, ADriveThatDoesNotAnswerIsAFault) {
  Bench bench;
  for (int tick = 0; tick < 100; ++tick) {
    ASSERT_NE(bench.first_type(true), enable);
    bench.feedback(0);
  }
  EXPECT_EQ(bench.driver.feedback().error_code, setup_fault_code(SetupFault::settings_unread, 0x7005));
}

// Goal: nothing arms while nothing would stop the drive, and the sentence names the parameter. Method: drives as the
// manuals have them: 7028 that does not stay (RS), none but 200C (CyberGear: silent about 7028; or refused by answer).
TEST(RobstrideDriver, ATimeoutThatIsOffOrUnknownIsAFaultThatNamesItsParameter) {
  struct Row {
    const char* when;
    std::map<int, int> told;
    std::uint32_t code;  // 0: may be enabled
    const char* name;
  };
  const std::uint32_t off_7028 = setup_fault_code(SetupFault::watchdog_off, 0x7028),
                      off_200c = setup_fault_code(SetupFault::watchdog_off, 0x200C),
                      unknown = setup_fault_code(SetupFault::watchdog_unknown, 0x200C);
  const Row rows[] = {
      {"7028 stays 0", {{0x7005, 0}, {0x7028, 0}}, off_7028, "off or longer"},
      {"7028 stays at an hour", {{0x7005, 0}, {0x7028, 72'000'000}}, off_7028, "off or longer"},
      {"7028 stays at 80 ms", {{0x7005, 0}, {0x7028, 1600}}, 0, ""},
      {"200C alone, off as delivered", {{0x7005, 0}, {0x200C, 0}}, off_200c, "off or longer"},
      {"200C alone, 1 s", {{0x7005, 0}, {0x200C, 20000}}, 0, ""},
      {"neither", {{0x7005, 0}}, unknown, "does not tell"},
  };
  for (const Row& row : rows) {
    Bench bench;
    for (int tick = 0; tick < 400; ++tick)
      for (const CanFrame& frame : bench.honest_tick(row.code != 0, row.told))
        ASSERT_NE(frame.id >> 24U, enable) << row.when;
    EXPECT_EQ(bench.driver.feedback().error_code, row.code) << row.when;
    EXPECT_EQ(bench.driver.feedback().drive_state, row.code == 0 ? DriveState::disabled : DriveState::fault)
        << row.when;
    if (row.code == 0) {
      EXPECT_EQ(bench.first_type(true), enable) << row.when;
      continue;
    }
    config::Drive drive;
    drive.protocol = config::DriveProtocol::robstride;
    const std::string name = error_name(drive, row.code);
    EXPECT_NE(name.find(row.name), std::string::npos) << name;
    EXPECT_NE(name.find(row.code == off_7028 ? "parameter 7028" : "parameter 200C"), std::string::npos) << name;
  }
}

// Goal: a joint below its drive's zero reads right only where the drive begins to count at -pi. Method: 7029 told as 0,
// as 1, not at all, and refused, where it matters and where it does not.
TEST(RobstrideDriver, WhereItBeginsToCountIsJudgedWhereItMatters) {
  struct Row {
    const char* when;
    bool matters;
    std::map<int, int> told;
    bool is_refused, may_enable;
  };
  const Row rows[] = {
      {"0 to 2 pi", true, {{0x7029, 0}}, false, false},
      {"-pi to pi", true, {{0x7029, 1}}, false, true},
      {"0 to 2 pi, and limits or a person tell the turn", false, {{0x7029, 0}}, false, true},
      {"silence", true, {}, false, true},
      {"no such parameter", true, {}, true, true},
  };
  for (const Row& row : rows) {
    RobstrideDriveSettings wanted = settings();
    wanted.begins_below_zero = row.matters;
    Bench bench(wanted);
    std::map<int, int> told = row.told;
    told.insert({{0x7005, 0}, {0x7028, 2000}});
    for (int tick = 0; tick < 150; ++tick)
      for (const CanFrame& frame : bench.honest_tick(false, told))
        if (row.is_refused && index_of(frame) == "7029") bench.refuses(0x7029);
    EXPECT_EQ(bench.driver.feedback().error_code,
              row.may_enable ? 0U : setup_fault_code(SetupFault::settings_differ, 0x7029))
        << row.when;
    EXPECT_EQ(bench.first_type(true) == enable, row.may_enable) << row.when;
  }
}

// By the robot file: which joints those are.
TEST(RobstrideDriver, ItMattersForAbsoluteJointsBelowTheirDrivesZero) {
  using config::PositionAfterPowerUp;
  config::Joint joint;
  joint.limits.q_min = -1;
  joint.limits.q_max = 2;
  EXPECT_TRUE(begins_below_zero(joint));
  joint.drive.offset = -1;
  EXPECT_FALSE(begins_below_zero(joint));
  joint.drive.direction = -1;
  EXPECT_TRUE(begins_below_zero(joint));
  joint.drive.position_after_power_up = PositionAfterPowerUp::within_a_turn;
  EXPECT_FALSE(begins_below_zero(joint));
}

// Goal: an answer that the reading failed carries a 0 that means nothing. Method: a drive that refuses 7028 and 200C.
TEST(RobstrideDriver, AFailedReadingIsUnknownAndNotZero) {
  Bench bench;
  for (int tick = 0; tick < 200; ++tick) {
    for (const CanFrame& frame : bench.encode(true)) {
      const std::string index = index_of(frame);
      if (frame.id >> 24U != question)
        bench.feedback(0);
      else if (index == "7005")
        bench.answer(0x7005, 0);
      else
        bench.refuses(index == "7028" ? 0x7028 : 0x200C);
    }
  }
  EXPECT_EQ(bench.driver.stored_timeout(), std::nullopt);
  EXPECT_EQ(bench.driver.feedback().error_code, setup_fault_code(SetupFault::watchdog_unknown, 0x200C));
}

TEST(RobstrideDriver, AWaiverLetsADriveWithoutTimeoutPass) {
  RobstrideDriveSettings waived = settings();
  waived.timeout.waived = true;
  Bench bench(waived);
  for (int tick = 0; tick < 400; ++tick) bench.honest_tick(false, {{0x7005, 0}, {0x7028, 0}});
  EXPECT_EQ(bench.driver.stored_timeout(), Duration{0});
  EXPECT_EQ(bench.driver.feedback().error_code, 0U);
  EXPECT_EQ(bench.first_type(true), enable);
}

// 7028 is lost with the supply: a drive that was silent, and one that was driven since, is told again.
TEST(RobstrideDriver, TheTimeoutIsWrittenAgainAfterSilenceAndAfterEveryStop) {
  const auto writes = [](Bench& bench) {
    int count = 0;
    for (int tick = 0; tick < 60; ++tick)
      for (const CanFrame& frame : bench.honest_tick(false))
        count += frame.id >> 24U == setting && index_of(frame) == "7028" ? 1 : 0;
    return count;
  };
  Bench bench = Bench().set_up();
  EXPECT_EQ(writes(bench), 0) << "a drive that goes on answering was told once";
  for (int tick = 0; tick < 50; ++tick) bench.encode(false);
  bench.feedback(0);
  EXPECT_NE(bench.first_type(true), enable) << "it may have been without power: not before it was told again";
  EXPECT_EQ(writes(bench), 1);
  bench.encode(true);
  bench.feedback(2);
  bench.encode(true);
  bench.feedback(0);
  EXPECT_EQ(writes(bench), 1) << "its supply may have blinked while it was driven";
}

TEST(RobstrideDriver, AnAnswerOfBeforeItsSilenceSettlesNothing) {
  Bench bench;
  while (
      !std::ranges::any_of(bench.honest_tick(false, {}), [](const CanFrame& f) { return f.id >> 24U == question; })) {
  }
  for (int tick = 0; tick < 50; ++tick) bench.encode(false);
  bench.answer(0x7005, 0);  // to the question above
  std::vector<std::string> told;
  for (int tick = 0; tick < 40; ++tick)
    for (const CanFrame& frame : bench.honest_tick(false))
      if (frame.id >> 24U == setting) told.push_back(index_of(frame));
  EXPECT_EQ(told, (std::vector<std::string>{"7005", "7028"}));
}

TEST(RobstrideDriver, IsEnabledByTheDrivesOwnWord) {
  Bench bench = Bench().set_up();
  EXPECT_EQ(bench.driver.feedback().drive_state, DriveState::disabled);
  EXPECT_EQ(bench.first_type(true), enable);
  bench.feedback(0);
  EXPECT_EQ(bench.first_type(true), enable) << "not before the drive says so";
  bench.feedback(2);
  EXPECT_EQ(bench.driver.feedback().drive_state, DriveState::enabled);
  EXPECT_EQ(bench.first_type(true), motion);
  EXPECT_EQ(bench.first_type(false), stop);
}

TEST(RobstrideDriver, DoesNotBringBackADriveThatStoppedByItself) {
  Bench bench = Bench().set_up();
  bench.encode(true);
  bench.feedback(2);
  bench.encode(true);
  for (const std::uint32_t faults : {0U, 2U}) {
    bench.feedback(0, faults);
    EXPECT_EQ(bench.first_type(true), motion) << faults;
  }
  bench.feedback(0);
  bench.set_up();
  EXPECT_EQ(bench.first_type(true), enable) << "after a stop in between it may";
}

TEST(RobstrideDriver, ReportsAndClearsAFaultWhileDisabled) {
  Bench bench = Bench().set_up();
  bench.feedback(0, 0b000110);
  EXPECT_EQ(bench.driver.feedback().drive_state, DriveState::fault);
  EXPECT_EQ(bench.driver.feedback().error_code, 6U);
  EXPECT_EQ(bench.encode(false)[0].data[0], 1) << "clears";
  EXPECT_EQ(bench.encode(false)[0].data[0], 0) << "every other tick";
  EXPECT_EQ(bench.encode(false)[0].data[0], 1);
  bench.feedback(0);
  EXPECT_EQ(bench.driver.feedback().drive_state, DriveState::disabled);
  EXPECT_EQ(bench.driver.feedback().error_code, 0U);
  EXPECT_EQ(bench.encode(false)[0].data[0], 0);
}

TEST(RobstrideDriver, AFaultReportCountsUntilItWasClearedAndNotRepeated) {
  Bench bench = Bench().set_up();
  constexpr std::uint32_t kReport = 21U << 24U | kDrive << 8U | kHost;
  EXPECT_TRUE(bench.hears(kReport, {0x08, 0, 0, 0, 0, 0, 0, 0}));  // over-voltage, which feedback has no bit for
  EXPECT_EQ(bench.driver.feedback().drive_state, DriveState::fault);
  EXPECT_EQ(bench.driver.feedback().error_code, 0x800U);
  bench.feedback(0);
  EXPECT_EQ(bench.driver.feedback().drive_state, DriveState::fault) << "not cleared yet";
  EXPECT_EQ(bench.encode(false)[0].data[0], 1);
  EXPECT_TRUE(bench.hears(kReport, {0x08, 0, 0, 0, 0, 0, 0, 0}));
  bench.feedback(0);
  EXPECT_EQ(bench.driver.feedback().drive_state, DriveState::fault) << "it came back";
  bench.encode(false);
  bench.encode(false);
  bench.feedback(0);
  EXPECT_EQ(bench.driver.feedback().drive_state, DriveState::disabled);
}

TEST(RobstrideDriver, NamesItsFaults) {
  config::Drive drive;
  drive.protocol = config::DriveProtocol::robstride;
  EXPECT_EQ(error_name(drive, 0b000001), "under-voltage");
  EXPECT_EQ(error_name(drive, 0b100010), "over-current, not calibrated");
  EXPECT_EQ(error_name(drive, 0x800), "supply over-voltage");
  EXPECT_EQ(error_name(drive, 0x0002'0000), "overload");
  EXPECT_EQ(error_name(drive, 0x40), "error code 0x40");
  // Id bit 20, the fifth of the faults: stall overload by the makers' manuals of RS00 to RS06, Hall by CyberGear's.
  EXPECT_EQ(error_name(drive, 0b010000), "stall overload");
  drive.model = "CyberGear";
  EXPECT_EQ(error_name(drive, 0b010000), "Hall encoder fault");
}

TEST(RobstrideDriver, IgnoresWhatIsNotItsOwnAndCountsWhatIsMalformed) {
  Bench bench;
  EXPECT_FALSE(bench.hears(0x020006FD, {})) << "another drive";
  EXPECT_FALSE(bench.hears(0x020005FC, {})) << "to another host";
  EXPECT_EQ(bench.driver.malformed_frames(), 0U);
  for (const std::uint32_t type : {2U, 17U, 21U}) {
    EXPECT_FALSE(bench.hears(type << 24U | 0x05FDU, {}, 7));
    EXPECT_FALSE(bench.hears(type << 24U | 0x05FDU, {}, 0));
  }
  EXPECT_EQ(bench.driver.malformed_frames(), 6U);
  EXPECT_FALSE(bench.driver.feedback().received_at.is_set());
  EXPECT_EQ(bench.driver.feedback().drive_state, DriveState::unknown);
  EXPECT_TRUE(bench.hears(0x000005FE, {})) << "its identity";
  // Type 24, running, at the middle of everything.
  EXPECT_TRUE(bench.hears(0x188005FD, {0x80, 0, 0x80, 0, 0x80, 0, 0x01, 0x2C})) << "its own, though nobody asked";
  EXPECT_EQ(bench.driver.feedback().replies, 0) << "is no reading";
}

// Goal: direction, offset and gear are applied once, both ways, gains squared.
TEST(RobstrideDriver, ConvertsBetweenJointAndMotor) {
  Bench bench = Bench(settings({.ratio = -2, .offset = 0.5F})).set_up();
  bench.encode(true);
  bench.feedback(2);
  const CanFrame frame = bench.encode(true, {.q = 1.5F, .dq = 2, .kp = 40, .kd = 4, .tau = 3}).at(0);
  // Motor side: p = (1.5 - 0.5) * -2 = -2 rad, v = -4 rad/s, kp = 40 / 4, kd = 4 / 4, t = 3 / -2.
  const CanFrame expected =
      encode_robstride_motion(kCyberGear, {kDrive, kHost}, {.p = -2, .v = -4, .kp = 10, .kd = 1, .t = -1.5F});
  EXPECT_EQ(frame.id, expected.id);
  for (std::size_t i = 0; i < 8; ++i) EXPECT_EQ(frame.data[i], expected.data[i]) << i;

  // Codes 0xC000: p 49152 * 25.132742 / 65535 - 12.566371 = 6.28347 rad; v 15.00069 rad/s; t 6.000275 Nm. 40 degrees.
  EXPECT_TRUE(bench.hears(0x028005FD, {0xC0, 0, 0xC0, 0, 0xC0, 0, 0x01, 0x90}));
  EXPECT_NEAR(bench.driver.feedback().q, 6.28347 / -2 + 0.5, 1e-5);
  EXPECT_NEAR(bench.driver.feedback().dq, 15.00069 / -2, 1e-5);
  EXPECT_NEAR(bench.driver.feedback().tau, 6.000275 * -2, 1e-5);
  EXPECT_EQ(bench.driver.feedback().temperature_C, 40);
}

config::RobotConfig robot_of(std::size_t drives) {
  config::RobotConfig robot;
  config::Joint joint;
  joint.name = "hip";
  joint.drive.protocol = config::DriveProtocol::robstride;
  joint.drive.id = 1;
  joint.drive.host_id = 253;
  joint.drive.position_range = 12.5;
  joint.drive.velocity_range = 30;
  joint.drive.torque_range = 12;
  joint.drive.kp_range = 500;
  joint.drive.kd_range = 5;
  robot.joints.assign(drives, joint);
  config::Bus bus;
  bus.name = "can0";
  bus.bitrate = 1'000'000;
  robot.buses = {bus};
  robot.control.period = milliseconds(1);
  return robot;
}

TEST(RobstrideDriver, IsMadeFromItsConfigurationOrRefused) {
  config::RobotConfig robot = robot_of(1);
  EXPECT_TRUE(make_joint_driver(robot, 0));
  robot.joints[0].drive.kd_range = 0;
  EXPECT_NE(make_joint_driver(robot, 0).error().find("joint hip: the drive's packed ranges"), std::string::npos);
  robot = robot_of(1);
  robot.joints[0].drive.id = 128;
  EXPECT_NE(make_joint_driver(robot, 0).error().find("1 to 127"), std::string::npos);
  robot = robot_of(1);
  robot.joints[0].drive.host_id = 1;
  EXPECT_NE(make_joint_driver(robot, 0).error().find("host_id"), std::string::npos);
}

// 67 + 64 bits and (118 - 1) / 4 = 29 stuff bits make 160 per frame: 320 bits per drive and tick, so that two drives
// take 64 % of 1 Mbit/s and three 96 %.
TEST(RobstrideDriver, TwoOfThemFitABusAtOneKilohertz) {
  EXPECT_EQ(check_bus_load(robot_of(2))->at(0).bits_per_tick, 640U);
  EXPECT_FALSE(check_bus_load(robot_of(3)));
}

}  // namespace
}  // namespace takt::drivers

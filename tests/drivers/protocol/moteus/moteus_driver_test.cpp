// SPDX-License-Identifier: Apache-2.0
// Goal: the driver enables, drives and disables as its header promises, in joint units, and never asks for more torque,
// or for longer, than allowed.
// Method: the drive's replies are written by hand, byte for byte; commands are read by fixed offsets of their layout.
#include "drivers/protocol/moteus/moteus_driver.hpp"

#include <gtest/gtest.h>
#include <rapidcheck.h>

#include <array>
#include <cmath>
#include <cstring>

#include "tests/drivers/bus/frame_text.hpp"

namespace takt::drivers {
namespace {

using test::frame_of;
using test::hex;

constexpr float kTorqueRange = 6, kServoKp = 20, kServoKd = 1;
constexpr int kSilentTicks = 20;  // MoteusDriveSettings: silence over period
constexpr const char* kQuery = "11001f01120e110a";
const std::string kStop = "01000011001f01120e130a50";                  // and asks for the home state besides
const std::string kStopAlone = "010000" + std::string(kQuery) + "50";  // a drive that left and is enabled again
const std::string kQueryOnly = kQuery;
constexpr MonoTime kNow{1'000'000'000};

struct Law {
  float position, velocity, torque, kp_scale, kd_scale, max_torque, watchdog;
};

class Bench {
 public:
  explicit Bench(JointMapping mapping = {})
      : driver(
            {.id = 3, .torque_range = kTorqueRange, .servo_kp = kServoKp, .servo_kd = kServoKd, .mapping = mapping}) {}

  CanFrame encode(bool enable, const DriveSetpoint& setpoint = {}, Duration budget = milliseconds(100)) {
    std::array<CanFrame, kMaxFramesPerDrive> out;
    EXPECT_EQ(driver.encode(enable, setpoint, kNow, budget.ns != 0 ? kNow + budget : MonoTime{}, out), 1U);
    EXPECT_EQ(out[0].id, 0x8003U);
    EXPECT_TRUE(out[0].extended && out[0].fd && out[0].bit_rate_switch);
    return out[0];
  }
  std::string say(bool enable) { return hex(encode(enable)); }
  // 48 bytes: mode 10, six floats from 020, one at 027, two limits off, the query.
  Law law(const DriveSetpoint& setpoint = {}, Duration budget = milliseconds(100)) {
    const CanFrame frame = encode(true, setpoint, budget);
    const std::string bytes = hex(frame);
    EXPECT_EQ(frame.length, 48);
    EXPECT_EQ(bytes.substr(0, 12), "01000a0c0620");
    EXPECT_EQ(bytes.substr(60, 4), "0d27");
    EXPECT_EQ(bytes.substr(72, 8), "0228ffff");
    EXPECT_EQ(bytes.substr(80), kQuery);
    Law law;
    std::memcpy(&law, frame.data + 6, 24);
    std::memcpy(&law.watchdog, frame.data + 32, 4);
    return law;
  }
  bool hear(std::string_view bytes, std::uint32_t id = 0x300, bool extended = false) {
    now = now + milliseconds(1);
    return driver.decode({frame_of(id, bytes, true, extended), now});
  }
  // A quarter turn, half a turn per second, 1.5 Nm; 40 and 50 deg C; where home state is told: referenced to the
  // output.
  bool reply(std::string_view mode, std::string_view fault = "00", bool extended = false,
             std::string_view home = "02") {
    const std::string end = mode == "0a" ? "210a32" : "230a3200" + std::string(home);
    return hear("2100" + std::string(mode) + "2f010000803e0000003f0000c03f" + "220e28" + std::string(fault) + end,
                0x300, extended);
  }
  void enable() {
    reply("00");
    encode(true);
    reply("0a");
  }

  MoteusDriver driver;
  MonoTime now{1};
};

TEST(MoteusDriver, KnowsNothingBeforeTheFirstReply) {
  Bench bench;
  EXPECT_FALSE(bench.driver.feedback().received_at.is_set());
  EXPECT_EQ(bench.driver.feedback().drive_state, DriveState::unknown);
}

TEST(MoteusDriver, StandbyStopsAndAsks) {
  Bench bench;
  EXPECT_EQ(bench.say(false), kStop);
  EXPECT_TRUE(bench.reply("00"));
  EXPECT_EQ(bench.driver.feedback().drive_state, DriveState::disabled);
  EXPECT_EQ(bench.say(false), kStop);
}

// Goal: a drive that says itself that its position means nothing is not armed, and is once it was told.
// Method: register 00C as its maker's page has it: 0 relative, 1 referenced to the rotor, 2 to the output.
TEST(MoteusDriver, AnUnknownHomeIsAFaultUntilTheDriveKnowsIt) {
  Bench bench;
  config::Drive drive;
  drive.protocol = config::DriveProtocol::moteus;
  for (const std::string_view home : {"00", "01"}) {
    EXPECT_EQ(bench.say(false), kStop);
    bench.reply("00", "00", false, home);
    EXPECT_EQ(bench.driver.feedback().drive_state, DriveState::fault) << home;
    const std::string name = error_name(drive, bench.driver.feedback().error_code);
    EXPECT_NE(name.find("where the joint is, is not known"), std::string::npos) << name;
    EXPECT_NE(name.find("register 00C"), std::string::npos) << name;
  }
  bench.reply("00");
  EXPECT_EQ(bench.driver.feedback().drive_state, DriveState::disabled);
  EXPECT_EQ(bench.driver.feedback().error_code, 0U);
  bench.say(false);
  bench.reply("00", "00", false, "00");
  EXPECT_EQ(bench.driver.feedback().drive_state, DriveState::fault) << "its supply blinked";
}

TEST(MoteusDriver, EnabledByTheDrivesOwnWord) {
  Bench bench;
  bench.reply("00");
  const DriveSetpoint push{.q = 1, .dq = 0, .kp = 10, .kd = 0, .tau = 2};
  for (int tick = 0; tick < 3; ++tick) {
    const Law limp = bench.law(push);
    EXPECT_EQ(limp.kp_scale, 0) << "not before the drive says so";
    EXPECT_EQ(limp.kd_scale, 0);
    EXPECT_EQ(limp.torque, 0);
    bench.reply(tick < 2 ? "02" : "0a");
  }
  EXPECT_EQ(bench.driver.feedback().drive_state, DriveState::enabled);
  EXPECT_EQ(bench.law(push).kp_scale, 0.5F);
  EXPECT_EQ(bench.say(false), kStop);
}

TEST(MoteusDriver, AReplyFromBeforeTheRequestProvesNothing) {
  Bench bench;
  bench.reply("00");
  bench.reply("0a");
  EXPECT_EQ(bench.law({.q = 1, .dq = 0, .kp = 10, .kd = 0, .tau = 2}).kp_scale, 0);
  EXPECT_EQ(bench.law({.q = 1, .dq = 0, .kp = 10, .kd = 0, .tau = 2}).kp_scale, 0);
}

TEST(MoteusDriver, DoesNotBringBackADriveThatLeftByItself) {
  for (const char* mode : {"00", "01", "0b", "0c", "0f"}) {
    Bench bench;
    bench.enable();
    bench.law();
    bench.reply(mode);
    EXPECT_NE(bench.driver.feedback().drive_state, DriveState::enabled);
    for (int tick = 0; tick < 5; ++tick) EXPECT_EQ(bench.say(true), kQueryOnly) << mode;
    bench.reply("0a");
    EXPECT_EQ(bench.say(true), kStopAlone) << "not even when it returns by itself";
    EXPECT_EQ(bench.say(false), kStop);
    bench.law();
  }
}

// Goal: a drive that restarted unseen, between two replies, gets no position command it would obey.
TEST(MoteusDriver, SilenceEndsDriving) {
  Bench bench;
  bench.enable();
  for (int tick = 0; tick < kSilentTicks; ++tick) bench.law();
  bench.reply("0a");
  for (int tick = 0; tick < kSilentTicks; ++tick) bench.law();
  EXPECT_EQ(bench.say(true), kStopAlone);
  bench.reply("00");
  EXPECT_EQ(bench.driver.feedback().drive_state, DriveState::disabled);
  EXPECT_EQ(bench.say(true), kQueryOnly);
}

TEST(MoteusDriver, FaultsAndTimeoutsAreFaultsAndLimitsAreNot) {
  struct Row {
    const char* mode;
    const char* fault;
    DriveState state;
    std::uint32_t code;
    const char* name;
  };
  const Row rows[] = {{"01", "26", DriveState::fault, 38, "over-temperature"},
                      {"01", "20", DriveState::fault, 32, "calibration fault"},
                      {"01", "30", DriveState::fault, 48, "position limits out of range"},
                      {"01", "00", DriveState::fault, 1, "fault without a code"},
                      {"0b", "00", DriveState::fault, 11, "command watchdog expired"},
                      {"0a", "66", DriveState::enabled, 0, ""},  // limited by the commanded maximum torque
                      {"0a", "60", DriveState::enabled, 0, ""},
                      {"00", "26", DriveState::disabled, 0, ""}};
  for (const Row& row : rows) {
    Bench bench;
    EXPECT_TRUE(bench.reply(row.mode, row.fault));
    EXPECT_EQ(bench.driver.feedback().drive_state, row.state);
    EXPECT_EQ(bench.driver.feedback().error_code, row.code);
    EXPECT_EQ(moteus_error_name({}, row.code), row.name);
  }
}

TEST(MoteusDriver, TheWatchdogIsTheCommandsRemainingLife) {
  Bench bench;
  bench.enable();
  EXPECT_NEAR(bench.law({}, milliseconds(70)).watchdog, 0.070, 1e-7);
  // Never 0 (the drive's default) nor NaN (for ever).
  EXPECT_NEAR(bench.law({}, Duration{}).watchdog, 0.020, 1e-7);
  EXPECT_NEAR(bench.law({}, milliseconds(-5)).watchdog, 0.020, 1e-7);
  EXPECT_NEAR(bench.law({}, seconds(3600)).watchdog, 1, 1e-7);
  EXPECT_NEAR(bench.law({}, seconds(-3600)).watchdog, 0.020, 1e-7);
}

TEST(MoteusDriver, ConvertsBetweenJointAndMotor) {
  Bench bench({.ratio = -2, .offset = 0.5F});
  bench.enable();
  EXPECT_NEAR(bench.driver.feedback().q, M_PI_2 / -2 + 0.5, 1e-6);
  EXPECT_NEAR(bench.driver.feedback().dq, M_PI / -2, 1e-6);
  EXPECT_NEAR(bench.driver.feedback().tau, 1.5 * -2, 1e-6);
  EXPECT_EQ(bench.driver.feedback().temperature_C, 50);
  const Law law = bench.law({.q = 1.5F, .dq = 2, .kp = 40, .kd = 2, .tau = 3});
  // Motor side: -2 rad, -4 rad/s, kp 10 of 20, kd 0.5 of 1, -1.5 Nm.
  EXPECT_NEAR(law.position, -2 / (2 * M_PI), 1e-6);
  EXPECT_NEAR(law.velocity, -4 / (2 * M_PI), 1e-6);
  EXPECT_EQ(law.kp_scale, 0.5F);
  EXPECT_EQ(law.kd_scale, 0.5F);
  EXPECT_NEAR(law.torque, -1.5, 1e-6);
  EXPECT_EQ(law.max_torque, kTorqueRange);
}

// Goal: what the scales cannot say is not made up here: the setpoint brings it in its torque.
TEST(MoteusDriver, ScalesSaturateAndTheTorqueIsTheSetpoints) {
  Bench bench;
  bench.enable();  // q = pi/2, dq = pi
  const Law damping = bench.law({.q = 0, .dq = 0, .kp = 0, .kd = 0.5F, .tau = 0.25F});
  EXPECT_EQ(damping.kp_scale, 0);
  EXPECT_EQ(damping.kd_scale, 0);
  EXPECT_EQ(damping.torque, 0.25F);
  const Law stiff = bench.law({.q = 2, .dq = 0, .kp = 50, .kd = 0, .tau = 0});
  EXPECT_EQ(stiff.kp_scale, 1);
  EXPECT_EQ(stiff.torque, 0);
  const Law damped = bench.law({.q = 0, .dq = 4, .kp = 4, .kd = 1.5F, .tau = 0});
  EXPECT_EQ(damped.kp_scale, 0.2F);
  EXPECT_EQ(damped.kd_scale, 0.2F);
}

TEST(MoteusDriver, PositionsBeyondThreeTurnsArrive) {
  Bench bench;
  bench.enable();
  EXPECT_NEAR(bench.law({.q = 100, .dq = 0, .kp = 1, .kd = 0, .tau = 0}).position, 100 / (2 * M_PI), 1e-5);
}

TEST(MoteusDriver, NoSetpointMakesAFrameThatIsNoCommand) {
  EXPECT_TRUE(rc::check([] {
    Bench bench({.ratio = *rc::gen::element(1.0F, -1.0F, 9.0F, 1e-3F), .offset = 0.3F});
    bench.enable();
    using test::any_float;
    const DriveSetpoint setpoint{any_float(), any_float(), any_float(), any_float(), any_float()};
    const Law law = bench.law(setpoint, Duration{*rc::gen::arbitrary<std::int64_t>()});
    RC_ASSERT(std::isfinite(law.torque));
    RC_ASSERT(law.max_torque == kTorqueRange);
    RC_ASSERT(law.kp_scale >= 0 && law.kp_scale <= 1);
    RC_ASSERT(law.kd_scale >= 0 && law.kd_scale <= 1);
    RC_ASSERT(std::isfinite(law.position) && std::isfinite(law.velocity));
    RC_ASSERT(law.watchdog >= 0.02F && law.watchdog <= 1);
    for (const float part : {setpoint.q, setpoint.dq, setpoint.kp, setpoint.kd, setpoint.tau})
      if (!std::isfinite(part)) RC_ASSERT(law.torque == 0 && law.kp_scale == 0 && law.kd_scale == 0);
  }));
}

TEST(MoteusDriver, TakesRepliesWithEitherKindOfId) {
  Bench bench;
  EXPECT_TRUE(bench.reply("0a", "00", false));
  EXPECT_TRUE(bench.reply("0a", "00", true));
  EXPECT_EQ(bench.driver.feedback().replies, 2);
}

TEST(MoteusDriver, IgnoresWhatIsNotItsOwnAndCountsWhatIsMalformed) {
  Bench bench;
  const std::string good = "2100002f010000803e0000003f0000c03f";
  EXPECT_FALSE(bench.hear(good, 0x200)) << "id 2";
  EXPECT_FALSE(bench.hear(good, 0x301)) << "to somebody else";
  EXPECT_FALSE(bench.hear(good, 0x8003, true)) << "our own command's id";
  EXPECT_EQ(bench.driver.malformed_frames(), 0U);
  EXPECT_FALSE(bench.hear(""));
  EXPECT_FALSE(bench.hear("210000")) << "no position";
  EXPECT_TRUE(bench.hear("2100002f010000c07f0000003f0000c03f")) << "position NaN: no reading, and no stranger";
  EXPECT_TRUE(bench.hear("2100002f010000803e0000003f0000807f")) << "torque infinite";
  EXPECT_TRUE(bench.hear("2100002f01ffff7f7f0000003f0000c03f")) << "turns beyond any radian";
  EXPECT_FALSE(bench.hear("01000a")) << "a command";
  EXPECT_FALSE(bench.hear(good + "24")) << "a torn end";
  EXPECT_EQ(bench.driver.malformed_frames(), 7U);
  EXPECT_FALSE(bench.driver.feedback().received_at.is_set());
  for (bool CanFrame::*flag : {&CanFrame::remote, &CanFrame::error}) {
    ReceivedFrame odd{frame_of(0x300, good, true), MonoTime{5}};
    odd.frame.*flag = true;
    EXPECT_FALSE(bench.driver.decode(odd));
  }
  EXPECT_TRUE(bench.hear(good));
}

TEST(MoteusDriver, TheRowsRefusalsAndTraffic) {
  config::RobotConfig robot;
  robot.buses.resize(1);
  robot.buses[0].fd = true;
  robot.joints.resize(1);
  config::Drive& drive = robot.joints[0].drive;
  drive.id = 1;
  drive.torque_range = drive.servo_kp = drive.servo_kd = 1;
  EXPECT_TRUE(make_moteus_driver(robot, 0));
  robot.buses[0].fd = false;
  EXPECT_NE(make_moteus_driver(robot, 0).error().find("fd"), std::string::npos);
  robot.buses[0].fd = true;
  drive.servo_kd = 0;
  EXPECT_FALSE(make_moteus_driver(robot, 0));
  Bench bench;
  bench.enable();
  const auto traffic = moteus_traffic(robot, 0);
  ASSERT_EQ(traffic.size(), 2U);
  EXPECT_TRUE(traffic[0].fd && traffic[1].fd);
  EXPECT_EQ(traffic[0].bytes, bench.encode(true).length) << "padded";
  EXPECT_EQ(traffic[1].bytes, 24U) << "3 + 14 + 4 + 3";
}

}  // namespace
}  // namespace takt::drivers

// SPDX-License-Identifier: Apache-2.0
// Goal: the driver enables, drives and disables as its header promises, in joint units, and never asks for more torque
// than allowed.
// Method: the drive's reports are written by hand, byte for byte, and the frames that come out are read.
#include "drivers/protocol/odrive/odrive_driver.hpp"

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

constexpr std::uint32_t kNode = 3;

// What a frame of ours says, for reading tests aloud.
std::string word(const CanFrame& frame) {
  if (frame.id == 0x067) return hex(frame) == "08000000" ? "closed loop" : hex(frame) == "01000000" ? "idle" : "state?";
  if (frame.id == 0x06B) return hex(frame) == "0100000001000000" ? "torque control" : "mode?";
  if (frame.id == 0x078) return "clear errors";
  if (frame.id == 0x060) return frame.remote && frame.length == 0 ? "version?" : "?";
  if (frame.id == 0x06E) return hex(frame) == "00000000" ? "zero" : "torque";
  return "?";
}

float torque_of(const CanFrame& frame) {
  EXPECT_EQ(frame.id, 0x06EU);
  EXPECT_EQ(frame.length, 4);
  float torque = NAN;
  std::memcpy(&torque, frame.data, 4);
  return torque;
}

class Bench {
 public:
  explicit Bench(JointMapping mapping = {}, bool waived = true)
      : Bench(OdriveDriveSettings{.node = kNode, .mapping = mapping, .watchdog_waived = waived}) {}
  explicit Bench(const OdriveDriveSettings& settings) : driver(settings) {}

  CanFrame encode(bool enable, const DriveSetpoint& setpoint = {}) {
    std::array<CanFrame, kMaxFramesPerDrive> out;
    EXPECT_EQ(driver.encode(enable, setpoint, {}, {}, out), 1U);
    return out[0];
  }
  std::string say(bool enable) { return word(encode(enable)); }
  bool hear(std::uint32_t id, std::string_view bytes) {
    now = now + milliseconds(1);
    return driver.decode({frame_of(id, bytes), now});
  }
  bool heartbeat(int state, std::string_view error = "00000000") {
    return hear(0x061, std::string(error) + "0" + std::to_string(state) + "000000");
  }
  // A quarter turn, 0.5 turn/s.
  bool estimates() { return hear(0x069, "0000803e0000003f"); }
  // Up to the first torque that counts.
  void enable() {
    estimates();
    heartbeat(1);
    for (int tick = 0; tick < 3; ++tick) encode(true);
    heartbeat(8);
  }

  OdriveDriver driver;
  MonoTime now{1};
};

constexpr DriveSetpoint kPush{.q = 0, .dq = 0, .kp = 0, .kd = 0, .tau = 2};

// Goal: a drive whose time-out cannot be read is not armed on trust. Method: a drive at rest that would obey.
TEST(OdriveDriver, NeedsAWaiverSinceItsTimeoutCannotBeRead) {
  Bench bench({}, false);
  bench.estimates();
  bench.heartbeat(1);
  for (int tick = 0; tick < 20; ++tick) EXPECT_NE(bench.say(tick > 0), "closed loop");
  EXPECT_EQ(bench.driver.feedback().drive_state, DriveState::fault);
  EXPECT_EQ(bench.driver.feedback().error_code, setup_fault_code(SetupFault::watchdog_unknown));
  config::Drive drive;
  drive.protocol = config::DriveProtocol::odrive;
  EXPECT_NE(error_name(drive, bench.driver.feedback().error_code).find("watchdog_waiver"), std::string::npos);
}

TEST(OdriveDriver, KnowsNothingBeforeTheFirstReport) {
  Bench bench;
  EXPECT_FALSE(bench.driver.feedback().received_at.is_set());
  EXPECT_EQ(bench.driver.feedback().drive_state, DriveState::unknown);
  EXPECT_TRUE(bench.estimates());
  EXPECT_EQ(bench.driver.feedback().drive_state, DriveState::unknown) << "a position is not a state";
  EXPECT_EQ(bench.driver.feedback().replies, 1);
}

TEST(OdriveDriver, StandbyKeepsTheDriveIdleAndInTorqueControl) {
  Bench bench;
  bench.heartbeat(1);
  EXPECT_EQ(bench.driver.feedback().drive_state, DriveState::disabled);
  for (int round = 0; round < 3; ++round) {
    EXPECT_EQ(bench.say(false), "idle");
    EXPECT_EQ(bench.say(false), "torque control");
    EXPECT_EQ(bench.say(false), "zero");
  }
}

TEST(OdriveDriver, EnabledByTheDrivesOwnWord) {
  Bench bench;
  bench.estimates();
  bench.heartbeat(1);
  EXPECT_EQ(bench.say(true), "torque control");
  EXPECT_EQ(bench.say(true), "zero");
  EXPECT_EQ(bench.say(true), "closed loop");
  EXPECT_EQ(torque_of(bench.encode(true, kPush)), 0) << "not before the drive says so";
  bench.heartbeat(1);
  EXPECT_EQ(torque_of(bench.encode(true, kPush)), 0) << "sent before the drive read the request";
  bench.heartbeat(8);
  EXPECT_EQ(bench.driver.feedback().drive_state, DriveState::enabled);
  EXPECT_EQ(torque_of(bench.encode(true, kPush)), 2);
  std::array<CanFrame, kMaxFramesPerDrive> out;
  ASSERT_EQ(bench.driver.encode(false, {}, {}, {}, out), 2U);
  EXPECT_EQ(word(out[0]), "idle");
  EXPECT_EQ(word(out[1]), "zero");
}

TEST(OdriveDriver, AHeartbeatFromBeforeTheRequestProvesNothing) {
  Bench bench;
  bench.estimates();
  bench.heartbeat(8);  // left enabled by another host
  for (int tick = 0; tick < 20; ++tick) {
    const CanFrame frame = bench.encode(true, kPush);
    EXPECT_NE(word(frame), "torque") << tick;
  }
}

TEST(OdriveDriver, AsksAgainSeldomWhenTheDriveDoesNotFollow) {
  Bench bench;
  bench.estimates();
  bench.heartbeat(1);
  int requests = 0;
  for (std::uint32_t tick = 0; tick < 3 * OdriveDriver::kAskAgainTicks; ++tick) {
    bench.heartbeat(1);
    requests += bench.say(true) == "closed loop" ? 1 : 0;
  }
  EXPECT_EQ(requests, 3);
}

TEST(OdriveDriver, DoesNotBringBackADriveThatLeftByItself) {
  Bench bench;
  bench.enable();
  ASSERT_EQ(torque_of(bench.encode(true, kPush)), 2);
  bench.heartbeat(1);
  EXPECT_EQ(bench.driver.feedback().drive_state, DriveState::disabled);
  for (std::uint32_t tick = 0; tick < 2 * OdriveDriver::kAskAgainTicks; ++tick)
    ASSERT_EQ(bench.say(true), "zero") << tick;
  bench.heartbeat(8);
  EXPECT_EQ(word(bench.encode(true, kPush)), "idle") << "not even when it returns by itself";
  bench.encode(true);
  std::array<CanFrame, kMaxFramesPerDrive> out;
  bench.driver.encode(false, {}, {}, {}, out);
  EXPECT_EQ(bench.say(true), "torque control") << "after a disable in between it may";
}

TEST(OdriveDriver, TellsWhyTheDriveLeftEvenWhenTheErrorHasPassed) {
  Bench bench;
  bench.enable();
  bench.encode(true);
  bench.heartbeat(1);
  bench.encode(true);
  bench.hear(0x063, "0000000000000001");
  EXPECT_EQ(bench.driver.feedback().drive_state, DriveState::fault);
  EXPECT_EQ(bench.driver.feedback().error_code, 0x0100'0000U);
  std::array<CanFrame, kMaxFramesPerDrive> out;
  bench.driver.encode(false, {}, {}, {}, out);
  EXPECT_EQ(bench.driver.feedback().drive_state, DriveState::disabled) << "then it is history";
  EXPECT_EQ(bench.driver.feedback().error_code, 0U);
}

TEST(OdriveDriver, ReportsAndClearsAnErrorWhileDisabled) {
  Bench bench;
  bench.heartbeat(1, "00200000");
  EXPECT_EQ(bench.driver.feedback().drive_state, DriveState::fault);
  EXPECT_EQ(bench.driver.feedback().error_code, 0x2000U);
  EXPECT_EQ(bench.say(false), "idle");
  EXPECT_EQ(bench.say(false), "torque control");
  EXPECT_EQ(bench.say(false), "clear errors");
  bench.heartbeat(1);
  EXPECT_EQ(bench.driver.feedback().error_code, 0U);
  for (int tick = 0; tick < 6; ++tick) EXPECT_NE(bench.say(false), "clear errors");
  bench.heartbeat(8, "00200000");
  EXPECT_EQ(bench.driver.feedback().drive_state, DriveState::fault) << "an error outranks the state";
}

// Goal: a drive whose heartbeat stopped while its estimates still come is not taken for enabled, and gets no torque.
TEST(OdriveDriver, AMissingHeartbeatIsAFault) {
  Bench bench;
  bench.enable();
  bench.now = bench.now + kOdriveHeartbeatTimeout - milliseconds(1);
  bench.estimates();
  EXPECT_EQ(bench.driver.feedback().drive_state, DriveState::enabled) << "exactly at the limit";
  ASSERT_EQ(torque_of(bench.encode(true, kPush)), 2);
  bench.estimates();
  EXPECT_EQ(bench.driver.feedback().drive_state, DriveState::fault);
  EXPECT_EQ(odrive_error_name({}, bench.driver.feedback().error_code), "heartbeat missing");
  EXPECT_EQ(torque_of(bench.encode(true, kPush)), 0);
  bench.heartbeat(8);
  EXPECT_EQ(word(bench.encode(true, kPush)), "idle") << "until disabled";
}

// Goal: a drive that counts from wherever it was switched on is enabled on the user's word of where it is, only while
// it reads so, and no longer than it is heard. Method: a quarter turn is what it reads.
TEST(OdriveDriver, SomebodysWordIsItsHomeUntilItFallsSilent) {
  constexpr float kQuarterTurn = 1.5708F;
  Bench bench({.node = kNode, .mapping = {}, .watchdog_waived = true, .home_mark = OdriveHomeMark{100, 50}});
  const auto setup_fault = [&] {
    bench.heartbeat(1);
    bench.estimates();
    return bench.driver.feedback().error_code;
  };
  EXPECT_EQ(setup_fault(), setup_fault_code(SetupFault::home_unknown));
  bench.driver.assume_home(1.0F, 0.05F);
  EXPECT_EQ(setup_fault(), setup_fault_code(SetupFault::home_unknown)) << "it reads another place";
  bench.driver.assume_home(kQuarterTurn, 0.05F);
  EXPECT_EQ(setup_fault(), 0U);
  bench.now = bench.now + kOdriveHeartbeatTimeout;
  EXPECT_EQ(setup_fault(), setup_fault_code(SetupFault::home_unknown)) << "it may have been switched off";
}

// Goal: a drive that the robot file knows by its firmware is not enabled on trust. Method: it is wanted from the first
// tick on, and tells late; 02.. protocol 2, hardware 4.4.58, firmware 0.6.10 as message 00 has them.
TEST(OdriveDriver, IsNotEnabledBeforeItTellsTheFirmwareThatIsNamed) {
  OdriveDriver driver({.node = kNode, .mapping = {}, .watchdog_waived = true, .firmware = {{0x00'06'0A}, 1}});
  MonoTime now{1};
  std::array<CanFrame, kMaxFramesPerDrive> out;
  const auto hear = [&](std::uint32_t id, const char* bytes) {
    now = now + milliseconds(1);
    EXPECT_TRUE(driver.decode({frame_of(id, bytes), now}));
  };
  const auto closed_loop_within = [&](int ticks) {
    for (int tick = 0; tick < ticks; ++tick) {
      hear(0x061, "0000000001000000");
      const std::size_t count = driver.encode(true, kPush, {}, {}, out);
      for (std::size_t i = 0; i < count; ++i)
        if (word(out[i]) == "closed loop") return true;
    }
    return false;
  };
  EXPECT_FALSE(closed_loop_within(100));
  EXPECT_EQ(driver.feedback().drive_state, DriveState::disabled) << "waiting is no fault";
  EXPECT_FALSE(closed_loop_within(200));
  EXPECT_EQ(driver.feedback().error_code, setup_fault_code(SetupFault::settings_unread, kOdriveFirmware));
  hear(0x060, "0204043a00060a00");
  EXPECT_EQ(driver.feedback().error_code, 0U);
  EXPECT_TRUE(closed_loop_within(10));
}

// A drive whose watchdog a question would feed is asked nothing; a disabled one that does not answer, not for ever.
TEST(OdriveDriver, NoPollsButForTheVersionOfADisabledDrive) {
  Bench bench;
  std::uint32_t questions = 0;
  std::array<CanFrame, kMaxFramesPerDrive> out;
  for (int tick = 0; tick < 2000; ++tick) {
    if (tick % 7 == 0) bench.estimates();
    if (tick % 90 == 0) bench.heartbeat(tick % 180 == 0 ? 8 : 1, tick % 540 == 0 ? "00100000" : "00000000");
    const bool is_enabled = tick % 700 > 300;
    const std::size_t count = bench.driver.encode(is_enabled, kPush, {}, {}, out);
    for (std::size_t i = 0; i < count; ++i) {
      EXPECT_EQ(out[i].remote, word(out[i]) == "version?");
      EXPECT_FALSE(out[i].remote && is_enabled);
      EXPECT_NE(word(out[i]), "?");
      if (out[i].remote) ++questions;
    }
  }
  EXPECT_EQ(questions, OdriveDriver::kAsksForVersion);
}

TEST(OdriveDriver, ConvertsBetweenJointAndMotor) {
  Bench bench({.ratio = -2, .offset = 0.5F});
  bench.enable();
  // Motor at a quarter turn, 0.5 turn/s: joint at pi/2 / -2 + 0.5, velocity pi / -2.
  EXPECT_NEAR(bench.driver.feedback().q, M_PI_2 / -2 + 0.5, 1e-5);
  EXPECT_NEAR(bench.driver.feedback().dq, M_PI / -2, 1e-5);
  bench.hear(0x07C, "00000040000080bf");  // asked for 2, estimated -1 Nm
  bench.estimates();
  EXPECT_NEAR(bench.driver.feedback().tau, 2, 1e-6) << "-1 Nm on the motor's side of the gear";
  EXPECT_NEAR(torque_of(bench.encode(true, {.tau = 3.4F})), -1.7, 1e-6);
}

// Goal: the driver has no law of its own, so no reading of its own, however old, can push.
TEST(OdriveDriver, SendsTheFinishedTorqueAndNothingElse) {
  Bench bench;
  bench.enable();
  bench.encode(true);
  EXPECT_EQ(torque_of(bench.encode(true, {.q = 9, .dq = 9, .kp = 100, .kd = 10, .tau = 1.5F})), 1.5F);
  EXPECT_EQ(torque_of(bench.encode(true, {.q = 9, .dq = 9, .kp = 100, .kd = 10})), 0);
  for (const float odd : {NAN, INFINITY, -INFINITY}) EXPECT_EQ(torque_of(bench.encode(true, {.tau = odd})), 0);
}

TEST(OdriveDriver, TemperatureIsTheHotterOneThatIsANumber) {
  Bench bench;
  bench.hear(0x075, "0000204200004842");  // 40, 50
  EXPECT_EQ(bench.driver.feedback().temperature_C, 50);
  bench.hear(0x075, "000020420000c07f");  // motor without a thermistor
  EXPECT_EQ(bench.driver.feedback().temperature_C, 40);
}

TEST(OdriveDriver, IgnoresWhatIsNotItsOwnAndCountsWhatIsMalformed) {
  Bench bench;
  EXPECT_FALSE(bench.hear(0x049, "0000803e0000003f")) << "node 2";
  EXPECT_FALSE(bench.hear(0x06E, "0000803e")) << "a command, by whomever";
  EXPECT_EQ(bench.driver.malformed_frames(), 0U);
  EXPECT_FALSE(bench.hear(0x069, "0000803e000000"));
  EXPECT_TRUE(bench.hear(0x069, "0000c07f00000000")) << "position NaN: no reading, and no stranger";
  EXPECT_TRUE(bench.hear(0x069, "000000000000807f")) << "velocity infinite";
  EXPECT_TRUE(bench.hear(0x069, "ffff7f7f00000000")) << "turns beyond any radian";
  EXPECT_FALSE(bench.hear(0x061, ""));
  EXPECT_EQ(bench.driver.malformed_frames(), 5U);
  EXPECT_FALSE(bench.driver.feedback().received_at.is_set());
  EXPECT_EQ(bench.driver.feedback().replies, 0);
  EXPECT_TRUE(bench.hear(0x074, "0000000000000000")) << "Iq is its own, if of no use";
}

TEST(OdriveDriver, NamesErrorsBitByBit) {
  EXPECT_EQ(odrive_error_name({}, 0x0100'0000), "command watchdog expired");
  EXPECT_EQ(odrive_error_name({}, 0x2100), "bus over-voltage, motor over-temperature");
  EXPECT_EQ(odrive_error_name({}, 0x80), "") << "no such bit";
}

TEST(OdriveDriver, TrafficIsTheTorqueTheEstimatesAndSlowReports) {
  config::RobotConfig robot;
  robot.control.period = milliseconds(2);
  robot.joints.resize(1);
  robot.joints[0].drive.torque_range = 5;
  double frames = 0;
  for (const FrameTraffic& frame : odrive_traffic(robot, 0)) {
    EXPECT_FALSE(frame.fd || frame.extended);
    frames += frame.per_tick;
  }
  EXPECT_NEAR(frames, 2 + 2 * 0.2 + 3 * 0.02, 1e-9);
  EXPECT_TRUE(make_odrive_driver(robot, 0));
  robot.control.period = microseconds(500);
  EXPECT_FALSE(make_odrive_driver(robot, 0)) << "the drive reports every whole millisecond at best";
}

}  // namespace
}  // namespace takt::drivers

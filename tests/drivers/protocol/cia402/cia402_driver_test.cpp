// SPDX-License-Identifier: Apache-2.0
// Goal: the driver sets up, enables, drives and disables as its header promises, in joint units, and never brings a
// drive back that left by itself.
// Method: the drive's frames are written by hand, byte for byte, and the frames that come out are read.
#include "drivers/protocol/cia402/cia402_driver.hpp"

#include <gtest/gtest.h>
#include <rapidcheck.h>

#include <array>
#include <cmath>
#include <limits>
#include <numbers>

#include "tests/drivers/protocol/cia402/cia402_frames.hpp"

namespace takt::drivers {
namespace {

using test::frame;
using test::text;
using test::tpdo;

constexpr std::uint32_t kNode = 5, kRated_mNm = 10'000;
// Statuswords as servo drives send them: voltage and remote bits set.
constexpr std::uint32_t kSwitchOnDisabled = 0x0250, kReady = 0x0231, kSwitchedOn = 0x0233, kOperation = 0x1237,
                        kQuickStop = 0x0217, kFaultReaction = 0x021F, kFault = 0x0218;

Cia402DriveSettings settings(config::Cia402Mode mode = config::Cia402Mode::cst) {
  Cia402DriveSettings made;
  made.scale = {.mode = mode, .counts_per_turn = 4096, .rated_torque = 10};
  made.setup = {.node = kNode, .mode = mode, .period = {1, -3}, .rated_torque_mNm = kRated_mNm};
  made.patience = {.answer_ticks = 10, .tries = 3, .pause_ticks = 20};
  made.max_heartbeat_ticks = 30;
  return made;
}

class Bench {
 public:
  explicit Bench(const Cia402DriveSettings& with = settings()) : driver(with) {}

  std::vector<CanFrame> tick(bool enable, const DriveSetpoint& setpoint = {}) {
    std::array<CanFrame, kMaxFramesPerDrive> out;
    const std::size_t count = driver.encode(enable, setpoint, {}, {}, out);
    EXPECT_LE(count, 4U);
    return {out.begin(), out.begin() + static_cast<std::ptrdiff_t>(count)};
  }
  // The RPDO of one tick, as text; empty: none.
  std::string command(bool enable, const DriveSetpoint& setpoint = {}) {
    for (const CanFrame& one : tick(enable, setpoint))
      if (one.id == 0x200 + kNode) return text(one);
    return {};
  }
  int controlword(bool enable, const DriveSetpoint& setpoint = {}) {
    const std::string sent = command(enable, setpoint);
    return sent.empty() ? -1 : std::stoi(sent.substr(4, 2), nullptr, 16);
  }
  bool hear(const CanFrame& one) {
    now = now + microseconds(1);
    return driver.decode({.frame = one, .received_at = now});
  }
  void heartbeat(std::uint32_t state = 5) { EXPECT_TRUE(hear(frame(0x700 + kNode, {state}))); }
  // Answers like a drive that agrees, up to the start.
  void converse() {
    for (int i = 0; i < 200 && !driver.setup().configured(); ++i)
      for (const CanFrame& one : tick(false))
        if (one.id == 0x600 + kNode) hear(agreeing.answer(one));
    ASSERT_TRUE(driver.setup().configured());
  }
  void set_up(std::uint32_t statusword = kSwitchOnDisabled) {
    converse();
    tick(false);
    heartbeat();
    hear(tpdo(kNode, statusword));
  }
  void enable() {
    set_up();
    for (const std::uint32_t statusword : {kSwitchOnDisabled, kReady, kSwitchedOn, kOperation}) {
      hear(tpdo(kNode, statusword));
      tick(true);
    }
    ASSERT_EQ(driver.feedback().drive_state, DriveState::enabled);
  }
  [[nodiscard]] DriveState state() const { return driver.feedback().drive_state; }
  [[nodiscard]] std::uint32_t error() const { return driver.feedback().error_code; }

  Cia402Driver driver;
  test::AgreeingDrive agreeing{kRated_mNm};
  MonoTime now{100};
};

TEST(Cia402Driver, KnowsNothingUntilTheDriveSaysItIsOperational) {
  Bench bench;
  EXPECT_EQ(bench.state(), DriveState::unknown);
  bench.hear(tpdo(kNode, kOperation, 77));
  EXPECT_FALSE(bench.driver.feedback().received_at.is_set()) << "a map that others wrote";
  bench.converse();
  EXPECT_EQ(bench.state(), DriveState::unknown);
  EXPECT_EQ(bench.command(false), "205#00000a0000") << "commands begin with the start";
  bench.hear(tpdo(kNode, kSwitchOnDisabled, 77));
  EXPECT_TRUE(bench.driver.feedback().received_at.is_set());
  EXPECT_EQ(bench.state(), DriveState::unknown);
  bench.heartbeat();
  EXPECT_EQ(bench.state(), DriveState::disabled);
}

config::Drive servo() {
  config::Drive drive;
  drive.protocol = config::DriveProtocol::cia402;
  return drive;
}

// Goal: a drive whose safe torque off is not released says why it does not enable. Method: its statusword stays at
// switch-on disabled while it is asked.
TEST(Cia402Driver, ADriveThatDoesNotEnableTellsItsStatusword) {
  Cia402DriveSettings patient = settings();
  patient.enable_ticks = 20;
  Bench bench(patient);
  bench.set_up();
  for (int i = 0; i < 25; ++i) {
    bench.hear(tpdo(kNode, kSwitchOnDisabled));
    bench.heartbeat();
    bench.tick(true);
  }
  EXPECT_EQ(bench.state(), DriveState::fault);
  const std::string said = error_name(servo(), bench.error());
  EXPECT_NE(said.find("statusword 0250, switch-on disabled: is safe torque off (STO) released"), std::string::npos)
      << said;
  EXPECT_EQ(bench.controlword(true), 0) << "not asked any more";
  bench.tick(false);
  bench.hear(tpdo(kNode, kSwitchOnDisabled));
  EXPECT_EQ(bench.state(), DriveState::disabled) << "until the next time";
}

// Goal: what a drive tells that is no fault is known to the tools and stops nothing. Method: EMCY 8110 of a drive that
// goes on; then its end (code 0).
TEST(Cia402Driver, AnEmergencyWithoutAFaultIsARemark) {
  Bench bench;
  bench.enable();
  bench.hear(frame(0x80 + kNode, {0x10, 0x81, 0x11, 0, 0, 0, 0, 0}));
  EXPECT_EQ(bench.driver.remark(), 0x8110U);
  EXPECT_EQ(error_name(servo(), bench.driver.remark()), "CAN overrun");
  EXPECT_EQ(bench.state(), DriveState::enabled);
  EXPECT_EQ(bench.error(), 0U);
  bench.hear(frame(0x80 + kNode, {0, 0, 0, 0, 0, 0, 0, 0}));
  EXPECT_EQ(bench.driver.remark(), 0U);
}

// Goal: what a drive tells of its torque never becomes a number that is none. Method: the largest float, behind a gear.
TEST(Cia402Driver, WhatIsTooLargeForTheJointsSideIsTheLargestNumber) {
  JointFeedback feedback;
  take_reading({.ratio = 50, .offset = 0}, 0, 0, 3e38F, MonoTime{1}, feedback);
  EXPECT_EQ(feedback.tau, std::numeric_limits<float>::max());
  take_reading({.ratio = -0.01F, .offset = 0}, 3e38F, 3e38F, 1, MonoTime{2}, feedback);
  EXPECT_EQ(feedback.q, std::numeric_limits<float>::lowest());
  EXPECT_EQ(feedback.dq, std::numeric_limits<float>::lowest());
}

TEST(Cia402Driver, SyncFollowsTheCommandAndIsOneDriversOnly) {
  Bench last;
  EXPECT_EQ(text(last.tick(false).back()), "080#") << "during set-up as well: other drives need it";
  last.set_up();
  const auto frames = last.tick(false);
  ASSERT_EQ(frames.size(), 2U);
  EXPECT_EQ(frames[0].id, 0x205U);
  EXPECT_EQ(text(frames[1]), "080#");
  Cia402DriveSettings quiet = settings();
  quiet.sends_sync = false;
  Bench other(quiet);
  EXPECT_EQ(other.tick(false).size(), 1U);
  other.set_up();
  EXPECT_EQ(other.tick(false).size(), 1U);
}

TEST(Cia402Driver, SetUpWaitsWhileEnableIsWanted) {
  Bench bench;
  for (int i = 0; i < 50; ++i) {
    const auto frames = bench.tick(true);
    ASSERT_EQ(frames.size(), 1U);
    EXPECT_EQ(text(frames[0]), "080#");
  }
  bench.set_up();
  EXPECT_EQ(bench.state(), DriveState::disabled);
}

Cia402DriveSettings patient() {
  Cia402DriveSettings made = settings();
  made.max_heartbeat_ticks = 10'000;  // these tests say nothing about heartbeats
  return made;
}

// Goal: "enabled" is not enough: a drive that says it ignores its target is released until it was disabled.
TEST(Cia402Driver, ADriveThatIgnoresItsTargetIsAFault) {
  constexpr std::uint32_t kIgnores = kOperation & ~0x1000U;
  Bench bench(patient());
  bench.enable();
  for (int i = 0; i < 50; ++i) {
    bench.hear(tpdo(kNode, kIgnores));
    EXPECT_EQ(bench.controlword(true), 0x0F);
  }
  EXPECT_EQ(bench.state(), DriveState::enabled) << "not at once: it may be about to";
  bench.hear(tpdo(kNode, kIgnores));
  EXPECT_EQ(bench.state(), DriveState::fault);
  EXPECT_EQ(bench.error(), Cia402Driver::kNotFollowing);
  EXPECT_EQ(bench.controlword(true), 0x00);
  bench.hear(tpdo(kNode, kOperation));
  EXPECT_EQ(bench.controlword(true), 0x00) << "not brought back";
  bench.tick(false);
  bench.hear(tpdo(kNode, kSwitchOnDisabled));
  EXPECT_EQ(bench.state(), DriveState::disabled);
  config::Drive drive;
  drive.protocol = config::DriveProtocol::cia402;
  EXPECT_NE(error_name(drive, Cia402Driver::kNotFollowing).find("statusword bit 12"), std::string::npos);
}

TEST(Cia402Driver, ALimitInsideTheDriveThatLastsIsAFault) {
  constexpr std::uint32_t kLimited = kOperation | 0x0800U;
  Bench bench(patient());
  bench.enable();
  for (int i = 0; i < 1500; ++i) bench.hear(tpdo(kNode, i % 1000 == 999 ? kOperation : kLimited));
  EXPECT_EQ(bench.state(), DriveState::enabled) << "a push against a limit that ends";
  for (int i = 0; i < 600; ++i) bench.hear(tpdo(kNode, kLimited));
  EXPECT_EQ(bench.state(), DriveState::fault);
  EXPECT_EQ(bench.error(), Cia402Driver::kLimited);
  bench.tick(false);
  EXPECT_EQ(bench.error(), 0U);
}

TEST(Cia402Driver, FollowsTheStatuswordUp) {
  Bench bench;
  bench.set_up();
  const DriveSetpoint push{.tau = -1.25F};
  struct Step {
    std::uint32_t statusword;
    const char* sent;
  };
  for (const Step& step : {Step{kSwitchOnDisabled, "205#06000a0000"}, Step{kReady, "205#07000a0000"},
                           Step{kReady, "205#07000a0000"}, Step{kSwitchedOn, "205#0f000a0000"}}) {
    bench.hear(tpdo(kNode, step.statusword));
    EXPECT_EQ(bench.state(), DriveState::disabled);
    EXPECT_EQ(bench.command(true, push), step.sent) << "no torque on the way";
  }
  bench.hear(tpdo(kNode, kOperation));
  EXPECT_EQ(bench.state(), DriveState::enabled);
  EXPECT_EQ(bench.command(true, push), "205#0f000a83ff");
  EXPECT_EQ(bench.command(false, push), "205#00000a0000") << "disabled: voltage off, no torque";
}

TEST(Cia402Driver, DoesNotBringBackADriveThatLeftByItself) {
  for (const std::uint32_t left :
       {kSwitchOnDisabled, kReady, kSwitchedOn, kQuickStop, kFaultReaction, kFault, 0x0066U}) {
    Bench bench;
    bench.enable();
    bench.hear(tpdo(kNode, left));
    EXPECT_EQ(bench.controlword(true, {.tau = 1}), 0x00) << left;
    for (const std::uint32_t later : {kSwitchOnDisabled, kReady, kSwitchedOn, kOperation}) {
      bench.hear(tpdo(kNode, later));
      EXPECT_EQ(bench.command(true, {.tau = 1}), "205#00000a0000") << left;
    }
    bench.hear(tpdo(kNode, kSwitchOnDisabled));
    bench.tick(false);
    EXPECT_EQ(bench.controlword(true), 0x06) << "after a disable in between it may";
  }
}

TEST(Cia402Driver, ReportsAFaultByItsEmergencyAndResetsItWhileDisabled) {
  Bench bench;
  bench.enable();
  EXPECT_TRUE(bench.hear(frame(0x085, {0x10, 0x23, 0x03, 0, 0, 0, 0, 0})));
  EXPECT_EQ(bench.state(), DriveState::enabled) << "the statusword decides";
  EXPECT_EQ(bench.error(), 0U);
  bench.hear(tpdo(kNode, kFaultReaction));
  EXPECT_EQ(bench.state(), DriveState::fault);
  EXPECT_EQ(bench.error(), 0x2310U);
  bench.hear(tpdo(kNode, kFault));
  EXPECT_EQ(bench.controlword(true), 0x00) << "no reset while enable is wanted";
  int edges = 0;
  for (int i = 0, before = 0; i < 60; ++i) {
    const int now = bench.controlword(false);
    EXPECT_TRUE(now == 0x00 || now == 0x80);
    edges += now == 0x80 && before == 0x00;
    before = now;
    bench.heartbeat();
  }
  EXPECT_EQ(edges, 3) << "again and again: an edge may get lost";
  bench.hear(frame(0x085, {0, 0, 0, 0, 0, 0, 0, 0}));
  bench.hear(tpdo(kNode, kSwitchOnDisabled));
  EXPECT_EQ(bench.state(), DriveState::disabled);
  EXPECT_EQ(bench.error(), 0U);
  EXPECT_EQ(bench.controlword(false), 0x00);
}

TEST(Cia402Driver, AFaultWithoutAnEmergencyIsStillAnError) {
  Bench bench;
  bench.set_up(kFault);
  EXPECT_EQ(bench.state(), DriveState::fault);
  EXPECT_EQ(bench.error(), 0x1000U);
}

TEST(Cia402Driver, ABootRestartsTheSetUp) {
  Bench bench;
  bench.enable();
  bench.heartbeat(0);
  EXPECT_EQ(bench.state(), DriveState::disabled);
  EXPECT_EQ(bench.error(), 0U);
  for (int i = 0; i < 20; ++i) EXPECT_EQ(bench.command(true), "") << "waits for enable to fall";
  const auto frames = bench.tick(false);
  EXPECT_EQ(text(frames[0]), "000#8005");
  bench.set_up();
  EXPECT_EQ(bench.controlword(true), 0x06);
}

TEST(Cia402Driver, ADriveThatLeftOperationalIsSetUpAgain) {
  for (const std::uint32_t nmt : {4U, 127U}) {
    Bench bench;
    bench.set_up();
    bench.heartbeat(nmt);
    EXPECT_EQ(bench.state(), DriveState::disabled);
    EXPECT_EQ(text(bench.tick(false)[0]), "000#8005");
    bench.heartbeat(127);
    EXPECT_EQ(bench.tick(false)[0].id, 0x605U) << "pre-operational is what set-up asked for";
  }
}

TEST(Cia402Driver, AMissingHeartbeatIsAFaultUntilSetUpWentThroughAgain) {
  Bench bench;
  bench.enable();
  for (int i = 0; i < 20; ++i) bench.tick(true);
  bench.heartbeat();
  for (int i = 0; i < 30; ++i) {
    bench.hear(tpdo(kNode, kOperation));
    EXPECT_EQ(bench.controlword(true, {.tau = 1}), 0x0F) << i;
  }
  EXPECT_EQ(bench.state(), DriveState::enabled);
  bench.hear(tpdo(kNode, kOperation));
  EXPECT_EQ(bench.command(true, {.tau = 1}), "205#00000a0000");
  EXPECT_EQ(bench.state(), DriveState::fault);
  EXPECT_EQ(bench.error(), 0x8130U);
  bench.heartbeat();
  bench.tick(true);
  EXPECT_EQ(bench.state(), DriveState::fault) << "latched";
  bench.tick(false);
  EXPECT_EQ(bench.state(), DriveState::fault) << "being set up again";
  bench.set_up();
  EXPECT_EQ(bench.state(), DriveState::disabled);
  EXPECT_EQ(bench.error(), 0U);
}

TEST(Cia402Driver, SetUpFaultsAreFaults) {
  Bench silent;
  for (int i = 0; i < 40; ++i) silent.tick(false);
  EXPECT_EQ(silent.state(), DriveState::fault);
  EXPECT_EQ(kind_of(silent.error()), SetupFault::settings_unread);

  Bench refusing;
  refusing.tick(false);
  const auto question = refusing.tick(false);
  refusing.hear(test::sdo_answer(question[0], 0x80, 0x08000020));
  EXPECT_EQ(refusing.state(), DriveState::fault);
  EXPECT_EQ(kind_of(refusing.error()), SetupFault::setup_refused);
  EXPECT_EQ(refusing.driver.abort_code(), 0x08000020U);
  refusing.heartbeat(0);
  refusing.set_up();
  EXPECT_EQ(refusing.state(), DriveState::disabled) << "healed by a set-up that ends well";
}

// Goal: direction, offset and gear are applied once, both ways.
TEST(Cia402Driver, ConvertsBetweenJointAndMotor) {
  Cia402DriveSettings geared = settings();
  geared.mapping = {.ratio = -2, .offset = 0.5F};
  Bench bench(geared);
  bench.enable();
  // Motor: 1024 counts of 4096 are pi/2; 100 per mille of 10 Nm is 1 Nm.
  bench.hear(tpdo(kNode, kOperation, 1024, 100));
  const auto quarter = static_cast<float>(std::numbers::pi / 2);
  EXPECT_NEAR(bench.driver.feedback().q, quarter / -2 + 0.5F, 1e-6);
  EXPECT_FLOAT_EQ(bench.driver.feedback().tau, -2);
  // 4 Nm at the joint: -2 Nm of 10 at the motor.
  EXPECT_EQ(bench.command(true, {.tau = 4}), "205#0f000a38ff") << "-200";
}

TEST(Cia402Driver, VelocityIsTheSlopeOfPositionBetweenStamps) {
  Bench bench;
  bench.set_up();
  std::uint32_t position = 0xFFFF'FF00;  // the counter runs over on the way
  bench.hear(tpdo(kNode, kSwitchOnDisabled, position));
  const std::uint8_t before = bench.driver.feedback().replies;
  for (int i = 0; i < 200; ++i) {
    bench.tick(false);
    position += 10;
    const MonoTime stamp = bench.now + milliseconds(1);
    if (i % 20 == 0) bench.heartbeat();
    bench.now = stamp;
    if (i % 7 == 3) continue;  // lost on the way
    const ReceivedFrame report{tpdo(kNode, kSwitchOnDisabled, position), stamp};
    bench.driver.decode(report);
    bench.driver.decode(report);  // and heard twice
  }
  // 10 counts per ms.
  EXPECT_NEAR(bench.driver.feedback().dq, 10e3 * 2 * std::numbers::pi / 4096, 0.01);
  EXPECT_EQ(static_cast<std::uint8_t>(bench.driver.feedback().replies - before),
            static_cast<std::uint8_t>(2 * 171 - 256));
}

// Goal: a stall of the host changes no velocity. The drive went on reporting meanwhile, each report with its stamp;
// dividing what they moved by the ticks that we spent would make the joint look tens of times as fast.
// Method: a steady motion; 60 reports are read at once, and then a single one 60 ms after the one before.
TEST(Cia402Driver, AStallOfTheHostChangesNoVelocity) {
  Bench bench;
  bench.set_up();
  std::uint32_t position = 1000;
  const auto report_after = [&](int ms) {
    position += static_cast<std::uint32_t>(10 * ms);
    bench.now = bench.now + milliseconds(ms);
    bench.driver.decode({tpdo(kNode, kSwitchOnDisabled, position), bench.now});
  };
  const double steady = 10e3 * 2 * std::numbers::pi / 4096;
  for (int i = 0; i < 200; ++i) {
    if (i % 20 == 0) bench.heartbeat();
    bench.tick(false);
    report_after(1);
  }
  ASSERT_NEAR(bench.driver.feedback().dq, steady, 0.05);
  bench.tick(false);
  for (int i = 0; i < 60; ++i) {
    report_after(1);
    ASSERT_NEAR(bench.driver.feedback().dq, steady, 0.05) << "a bunch, " << i;
  }
  bench.tick(false);
  report_after(60);
  EXPECT_NEAR(bench.driver.feedback().dq, steady, 0.05) << "one, late";
}

TEST(Cia402Driver, IgnoresWhatIsNotItsOwnAndCountsWhatIsMalformed) {
  Bench bench;
  bench.set_up();
  const JointFeedback before = bench.driver.feedback();
  EXPECT_FALSE(bench.hear(tpdo(6, kOperation, 99)));
  EXPECT_FALSE(bench.hear(frame(0x080, {})));
  EXPECT_FALSE(bench.hear(frame(0x205, {0, 0, 0, 0, 0}))) << "our own";
  EXPECT_EQ(bench.driver.malformed_frames(), 0U);
  EXPECT_FALSE(bench.hear(frame(0x185, {0x37, 0x12})));
  EXPECT_FALSE(bench.hear(frame(0x705, {9})));
  EXPECT_FALSE(bench.hear(frame(0x085, {1, 2, 3})));
  EXPECT_FALSE(bench.hear(frame(0x585, {0xC0, 0, 0, 0, 0, 0, 0, 0})));
  EXPECT_EQ(bench.driver.malformed_frames(), 4U);
  EXPECT_TRUE(bench.hear(frame(0x285, {1, 2}))) << "ours, though nobody asked";
  for (int kind = 0; kind < 4; ++kind) {
    CanFrame odd = tpdo(kNode, kOperation, 99);
    odd.extended = kind == 0;
    odd.fd = kind == 1;
    odd.remote = kind == 2;
    odd.error = kind == 3;
    EXPECT_FALSE(bench.hear(odd)) << kind;
  }
  EXPECT_EQ(bench.driver.feedback().received_at, before.received_at);
  EXPECT_EQ(bench.driver.feedback().replies, before.replies);
  EXPECT_EQ(bench.state(), DriveState::disabled);
}

// Goal: the row: what configuration makes of a drive, and what it refuses.
class Cia402Row : public testing::Test {
 protected:
  Cia402Row() {
    robot.control.period = milliseconds(1);
    robot.feedback.timeout = milliseconds(20);
    robot.joints.resize(1);
    config::Joint& joint = robot.joints[0];
    joint.name = "elbow";
    joint.drive.protocol = config::DriveProtocol::cia402;
    joint.drive.id = kNode;
    joint.drive.counts_per_turn = 4096;
    joint.drive.rated_torque = 10;
    joint.drive.torque_range = 3;
    joint.limits.velocity = 2;
    joint.observer_bandwidth = 200;
  }
  std::string refusal() {
    const auto driver = make_joint_driver(robot, 0);
    return driver ? "" : driver.error();
  }
  config::RobotConfig robot;
};

TEST_F(Cia402Row, RefusesWhatItCannotBuild) {
  EXPECT_EQ(refusal(), "");
  robot.control.period = microseconds(1001);
  EXPECT_NE(refusal().find("60C2"), std::string::npos);
  robot.control.period = milliseconds(1);
  config::Drive& drive = robot.joints[0].drive;
  drive.id = 127;  // this computer's own
  EXPECT_NE(refusal().find("1 to 126"), std::string::npos);
  drive.id = 5;
  drive.counts_per_turn = 0;
  EXPECT_NE(refusal().find("counts_per_turn"), std::string::npos);
  drive.counts_per_turn = 4096;
  drive.rated_torque = 0;
  EXPECT_NE(refusal().find("positive"), std::string::npos);
  drive.rated_torque = 10;
  drive.torque_range = 0.005;
  EXPECT_NE(refusal().find("thousandth"), std::string::npos);
  drive.torque_range = 328;
  EXPECT_NE(refusal().find("6071"), std::string::npos)
      << "what the joint may be asked for, the wire must be able to say";
  drive.mode = config::Cia402Mode::csp;
  EXPECT_EQ(refusal(), "");
}

TEST_F(Cia402Row, SyncIsSentByTheLastOfEachBus) {
  robot.joints.resize(5, robot.joints[0]);
  robot.joints[0].bus = robot.joints[2].bus = 1;
  robot.joints[4].drive.protocol = config::DriveProtocol::mit;  // shares bus 0, and is no cia402
  const auto sends = [this](std::size_t joint) {
    auto driver = make_cia402_driver(robot, joint);
    std::array<CanFrame, kMaxFramesPerDrive> out;
    const std::size_t count = (*driver)->encode(true, {}, {}, {}, out);
    const auto traffic = cia402_traffic(robot, joint);
    EXPECT_EQ(traffic.size(), count == 1 ? 4U : 3U);
    return count == 1 && out[0].id == 0x080;
  };
  EXPECT_FALSE(sends(0));
  EXPECT_FALSE(sends(1));
  EXPECT_TRUE(sends(2));
  EXPECT_TRUE(sends(3));
}

TEST_F(Cia402Row, TrafficIsWhatCrossesTheBus) {
  const auto traffic = cia402_traffic(robot, 0);
  ASSERT_EQ(traffic.size(), 4U);
  EXPECT_EQ(traffic[0].bytes, 5U);
  EXPECT_EQ(traffic[1].bytes, 8U);
  EXPECT_EQ(traffic[2].bytes, 1U);
  EXPECT_DOUBLE_EQ(traffic[2].per_tick, 0.11) << "the drive's heartbeat each 100 ms, and ours each 10 ms";
  EXPECT_EQ(traffic[3].bytes, 0U) << "SYNC";
  robot.joints[0].drive.mode = config::Cia402Mode::csp;
  EXPECT_EQ(cia402_traffic(robot, 0)[0].bytes, 7U);
}

TEST_F(Cia402Row, NamesErrors) {
  const config::Drive& drive = robot.joints[0].drive;
  EXPECT_EQ(error_name(drive, 0x2310), "over-current");
  EXPECT_EQ(error_name(drive, 0x7305), "encoder");
  EXPECT_EQ(error_name(drive, 0x8130), "heartbeat lost");
  EXPECT_EQ(error_name(drive, 0x2399), "output current") << "its class";
  EXPECT_EQ(error_name(drive, 0xFF01), "maker's own error");
  EXPECT_EQ(error_name(drive, 0x0123), "error code 0x123");
  EXPECT_EQ(error_name(drive, static_cast<std::uint32_t>(SetupFault::setup_refused)), "the drive refused its set-up");
}

}  // namespace
}  // namespace takt::drivers

// Goal: the guard reads our frames as the drives do and refuses everything that breaks the contract, each for its own
// reason, with something harmless in its place.
// Method: frames are written by hand, byte for byte, from the protocols' papers (docs/drives.md); no encoder of ours is
// asked. Vectors that the papers print are marked.
#include "drivers/guard/wire_guard.hpp"

#include <gtest/gtest.h>

#include <bit>
#include <cmath>
#include <cstdio>
#include <cstring>
#include <string>

#include "tests/drivers/guard/guard_bench.hpp"

namespace takt::drivers {
namespace {

using takt::test::hex;
using test::Decision;
using test::GuardBench;
using test::kDecided;
using enum WireVerdict;

std::string float_bytes(float value) {
  const auto bits = std::bit_cast<std::uint32_t>(value);
  char text[9];
  std::snprintf(text, sizeof text, "%02x%02x%02x%02x", bits & 0xFFU, bits >> 8U & 0xFFU, bits >> 16U & 0xFFU,
                bits >> 24U);
  return text;
}

std::string word_bytes(std::uint32_t bits) {
  return float_bytes(std::bit_cast<float>(bits));
}

// --- mit ---

// The papers' AK80-9 command: p 1.0, v -2.0, kp 100, kd 1.5, t 3.0.
constexpr std::string_view kAk809 = "8a3c7ad3334cc954";

GuardBench ak80_9() {
  config::RobotConfig robot = test::every_protocol();
  config::Joint& joint = robot.joints[test::joint_named(robot, "left_elbow")];
  joint.drive.direction = 1;
  joint.drive.position_range = 12.5;
  joint.drive.velocity_range = 50;
  joint.drive.kp_range = 500;
  joint.drive.kd_range = 5;
  joint.drive.torque_range = 18;
  joint.limits.torque = 18;
  joint.limits.torque_rate = 18'000;
  return GuardBench("left_elbow", robot);
}

Decision of_ak80_9() {
  return {.q = 1, .dq = -2, .kp = 100, .kd = 1.5F, .tau = 3, .at_q = 0.95F, .at_dq = -2};
}

TEST(WireGuard, ReadsThePapersMitCommand) {
  GuardBench bench = ak80_9();
  EXPECT_EQ(bench.pass(3, kAk809, of_ak80_9()), allowed);
  EXPECT_EQ(hex(bench.left), kAk809) << "what passes is left alone";
}

TEST(WireGuard, AFieldThatIsNotTheDecidedOneDiffers) {
  for (float Decision::*field : {&Decision::q, &Decision::dq, &Decision::kp, &Decision::kd, &Decision::tau}) {
    GuardBench bench = ak80_9();
    Decision decision = of_ak80_9();
    decision.*field += 0.6F;
    EXPECT_EQ(bench.pass(3, kAk809, decision), differs);
    EXPECT_EQ(hex(bench.left).substr(0, 10), "7fff7ff000") << "damping: no stiffness, and the middle of the rest";
  }
}

TEST(WireGuard, EveryMitLimitHasItsVerdict) {
  struct Row {
    const char* when;
    WireVerdict expected;
    void (*change)(Decision&, config::Joint&);
  };
  const Row rows[] = {
      {"all inside", allowed, [](Decision&, config::Joint&) {}},
      {"stiffness", gain, [](Decision&, config::Joint& j) { j.limits.kp = 99; }},
      {"damping", gain, [](Decision&, config::Joint& j) { j.limits.kd = 1.4; }},
      {"position", position, [](Decision&, config::Joint& j) { j.limits.q_max = 0.8, j.limits.position_margin = 0.1; }},
      {"inside the margin", allowed,
       [](Decision&, config::Joint& j) { j.limits.q_max = 0.8, j.limits.position_margin = 0.25; }},
      {"speed", velocity, [](Decision&, config::Joint& j) { j.limits.velocity = 1.9; }},
      {"torque: 100 * 0.05 + 3", torque, [](Decision&, config::Joint& j) { j.limits.torque = 7.5; }},
      {"slew: 8 Nm in 1 ms", slew, [](Decision&, config::Joint& j) { j.limits.torque_rate = 7000; }},
      {"passive", gain, [](Decision&, config::Joint& j) { j.passive = true; }},
      {"disabled", misplaced, [](Decision& d, config::Joint&) { d.moment.enabled = false; }},
      {"old command", expired, [](Decision& d, config::Joint&) { d.moment.valid_until = d.moment.now - Duration{1}; }},
      {"no command in use", allowed, [](Decision& d, config::Joint&) { d.moment.valid_until = {}; }},
      {"silent joint", feedback_lost, [](Decision& d, config::Joint&) { d.feedback_age = milliseconds(21); }},
      {"never heard", feedback_lost, [](Decision& d, config::Joint&) { d.feedback_age = kDecided - MonoTime{}; }},
      {"estimate is no number", not_finite, [](Decision& d, config::Joint&) { d.at_q = NAN; }},
  };
  for (const Row& row : rows) {
    Decision decision = of_ak80_9();
    GuardBench model = ak80_9();
    row.change(decision, model.robot.joints[test::joint_named(model.robot, "left_elbow")]);
    GuardBench bench("left_elbow", model.robot);
    EXPECT_EQ(bench.pass(3, kAk809, decision), row.expected) << row.when;
  }
}

TEST(WireGuard, MitSpecialFrames) {
  GuardBench bench("left_shoulder");  // damiao
  Decision off;
  off.moment.enabled = false;
  EXPECT_EQ(bench.pass(2, "fffffffffffffffd", off), allowed);
  EXPECT_EQ(bench.pass(2, "fffffffffffffffb", off), allowed) << "clear error";
  EXPECT_EQ(bench.pass(2, "fffffffffffffffc", off), misplaced);
  EXPECT_EQ(hex(bench.left), "fffffffffffffffd") << "a joint that is to be disabled is disabled instead";
  EXPECT_EQ(bench.pass(2, "fffffffffffffffc"), allowed);
  EXPECT_EQ(bench.pass(2, "fffffffffffffffe"), unknown_frame) << "moves the zero";
  EXPECT_EQ(bench.pass(0x7FF, "0200330900000000"), allowed) << "reads a register";
  EXPECT_EQ(bench.pass(0x7FF, "0200550900000000"), unknown_frame) << "writes one";
  EXPECT_EQ(bench.pass(0x7FF, "0300330900000000"), unknown_frame) << "of another drive";
  EXPECT_EQ(bench.pass(1, "fffffffffffffffd"), unknown_frame) << "another drive's id";
  EXPECT_EQ(bench.pass(2, "fffffffffffffd"), unknown_frame) << "too short";
}

TEST(WireGuard, AFrameOnAnotherBusIsUnknown) {
  GuardBench bench("left_shoulder");
  CanFrame frame = takt::test::frame_of(2, "fffffffffffffffd");
  EXPECT_EQ(bench.guard.pass(1, 1, {}, {}, frame), unknown_frame);
}

TEST(WireGuard, DampingIsAlwaysAllowedAndNothingElseIsDamping) {
  Decision dead;
  dead.feedback_age = seconds(1);
  dead.moment.valid_until = dead.moment.now - seconds(1);
  GuardBench bench("left_shoulder");  // DM8009: v 45, t 54, kd limit 5
  EXPECT_EQ(bench.pass(2, "7fff7ff0000007ff", dead), allowed) << "zero is half a step below zero";
  EXPECT_EQ(bench.pass(2, "7fff7ff000fff7ff", dead), allowed) << "all the damping there may be";
  EXPECT_EQ(bench.pass(2, "7fff7ff000fff7f0", dead), expired) << "15 steps of torque are 0.4 Nm";
  EXPECT_EQ(bench.pass(2, "7fff8ff000fff7ff", dead), expired) << "damping towards a speed of 5.6 rad/s pushes";
  EXPECT_EQ(bench.pass(2, "7fff7ff001fff7ff", dead), expired) << "one step of stiffness";
  dead.moment.valid_until = {};
  EXPECT_EQ(bench.pass(2, "7fff7ff001fff7ff", dead), feedback_lost);
}

// --- robstride: left_wrist_roll, RS02, drive 4, host 253; p +-4 pi, v 44, kp 500, kd 5, t 17 ---

constexpr std::uint32_t robstride_id(std::uint32_t type, std::uint32_t data) {
  return type << 24U | data << 8U | 4U;
}

TEST(WireGuard, ReadsRobstride) {
  GuardBench bench("left_wrist_roll");
  // torque 0x8787 = 65535 * (1 + 1/17) / 2: 1 Nm; kp 0x0CCC: 25; kd 0x28F5: 0.8; position 0, speed 0
  Decision decision{.kp = 25, .kd = 0.8F, .tau = 1};
  EXPECT_EQ(bench.pass(robstride_id(1, 0x8787), "7fff7fff0ccc28f5", decision), allowed);
  EXPECT_EQ(bench.pass(robstride_id(1, 0x7878), "7fff7fff0ccc28f5", decision), slew) << "-1 Nm: 2 Nm in 1 ms";
  GuardBench fresh("left_wrist_roll");
  EXPECT_EQ(fresh.pass(robstride_id(1, 0x7878), "7fff7fff0ccc28f5", decision), differs) << "-1 Nm from none";
  EXPECT_EQ(fresh.pass(robstride_id(3, 253), "0000000000000000"), allowed);
  EXPECT_EQ(fresh.pass(robstride_id(4, 253), "0100000000000000"), allowed);
  EXPECT_EQ(fresh.pass(robstride_id(17, 253), "0570000000000000"), allowed);
  EXPECT_EQ(fresh.pass(robstride_id(18, 253), "0570000000000000"), allowed) << "run mode: motion";
  EXPECT_EQ(fresh.pass(robstride_id(18, 253), "0570000003000000"), unknown_frame) << "run mode: current";
  EXPECT_EQ(fresh.pass(robstride_id(18, 253), "0b70000000000041"), unknown_frame) << "torque limit";
  EXPECT_EQ(fresh.pass(robstride_id(0, 253), "0000000000000000"), allowed) << "who are you";
  EXPECT_EQ(fresh.pass(robstride_id(6, 253), "0100000000000000"), unknown_frame) << "set zero";
  EXPECT_EQ(fresh.pass(robstride_id(7, 0x05FD), "0000000000000000"), unknown_frame) << "set id";
  Decision off;
  off.moment.enabled = false;
  EXPECT_EQ(fresh.pass(robstride_id(3, 253), "0000000000000000", off), misplaced);
  EXPECT_EQ(fresh.left.id, robstride_id(4, 253));
}

// --- odrive: left_wrist_pitch, node 5 ---

TEST(WireGuard, ReadsOdrive) {
  GuardBench bench("left_wrist_pitch");
  // The papers' -0.75 Nm.
  const Decision decision{.tau = -0.75F};
  EXPECT_EQ(bench.pass(0x0AE, "000040bf", decision), allowed);
  EXPECT_EQ(bench.pass(0x0AE, "0000403f", decision), slew) << "the sign's bit lost";
  GuardBench fresh("left_wrist_pitch");
  EXPECT_EQ(fresh.pass(0x0AE, "0000403f", decision), differs);
  EXPECT_EQ(hex(fresh.left), "00000080") << "a robot at rest is not pushed by damping";
  EXPECT_EQ(fresh.pass(0x0AE, "0000c07f", decision), not_finite);
  EXPECT_EQ(fresh.pass(0x0AE, "0000c841", {.tau = 25}), torque) << "25 Nm";
  EXPECT_EQ(fresh.pass(0x0AE, "0000403f00000000", decision), unknown_frame) << "not as we say it";
  EXPECT_EQ(fresh.pass(0x0A7, "08000000"), allowed);
  EXPECT_EQ(fresh.pass(0x0A7, "01000000"), allowed);
  EXPECT_EQ(fresh.pass(0x0A7, "03000000"), unknown_frame) << "calibration";
  EXPECT_EQ(fresh.pass(0x0AB, "0100000001000000"), allowed);
  EXPECT_EQ(fresh.pass(0x0AB, "0300000001000000"), unknown_frame) << "position control";
  EXPECT_EQ(fresh.pass(0x0AC, "0000c03f06ffb004"), unknown_frame) << "a position";
  EXPECT_EQ(fresh.pass(0x0B8, "00"), allowed);
  EXPECT_EQ(fresh.pass(0x0CE, "00000000"), unknown_frame) << "another node";
  CanFrame question;
  question.id = 0x0A0;
  question.remote = true;
  EXPECT_EQ(fresh.pass(question), allowed) << "which version";
  question.id = 0x0AE;
  EXPECT_EQ(fresh.pass(question), unknown_frame) << "no other question";
  EXPECT_EQ(fresh.pass(0x0A0, ""), unknown_frame) << "no question at all";
}

TEST(WireGuard, AStaleSpeedIsNotDamped) {
  GuardBench bench("left_wrist_pitch");
  const std::string braking = float_bytes(-1);  // 2 Nms/rad at most, 1 rad/s
  Decision moving{.kd = 1, .at_dq = 1};
  EXPECT_EQ(bench.pass(0x0AE, braking, moving), allowed);
  moving.moment.valid_until = moving.moment.now - seconds(1);
  EXPECT_EQ(bench.pass(0x0AE, braking, moving), allowed) << "an old command, but braking all the same";
  moving.feedback_age = milliseconds(25);
  moving.moment.valid_until = {};
  EXPECT_EQ(bench.pass(0x0AE, braking, moving), feedback_lost) << "constant torque, whatever the joint does";
  EXPECT_EQ(hex(bench.left), "00000000");
  EXPECT_EQ(bench.pass(0x0AE, "00000000", moving), allowed);
}

// --- moteus: right_wrist_roll, id 1, 8 Nm, servo kp 80, kd 3 ---

struct MoteusWords {
  std::string mode = "01000a";
  float position = 0, velocity = 0, torque = 0, kp = 0, kd = 0, most = 8, watchdog = 0.1F;
  std::string trajectory = "0228ffff";
};

std::string moteus_bytes(const MoteusWords& words) {
  std::string bytes = words.mode + "0c0620";
  for (const float value : {words.position, words.velocity, words.torque, words.kp, words.kd, words.most})
    bytes += float_bytes(value);
  return bytes + "0d27" + float_bytes(words.watchdog) + words.trajectory + "11001f01120e110a";
}

TEST(WireGuard, ReadsMoteus) {
  const Decision decision{.kp = 40, .tau = 1};
  struct Row {
    const char* when;
    MoteusWords words;
    WireVerdict expected;
  };
  const Row rows[] = {
      {"half the servo's stiffness and 1 Nm", {.torque = 1, .kp = 0.5F}, allowed},
      {"damping that nobody decided", {.torque = 1, .kp = 0.5F, .kd = 0.1F}, differs},
      {"the sign is lost", {.torque = -1, .kp = 0.5F}, differs},
      {"a turn taken for a radian", {.position = 0.05F, .torque = 1, .kp = 0.5F}, slew},
      {"speed", {.velocity = 1, .torque = 1, .kp = 0.5F}, velocity},
      {"stiffness", {.torque = 1, .kp = 1}, gain},
      {"the command's life ends sooner", {.torque = 1, .kp = 0.5F, .watchdog = 0.11F}, expired},
      {"no watchdog", {.torque = 1, .kp = 0.5F, .watchdog = NAN}, expired},
      {"the drive's own watchdog", {.torque = 1, .kp = 0.5F, .watchdog = 0}, expired},
      {"more than the drive may", {.torque = 1, .kp = 0.5F, .most = 8.1F}, torque},
      {"as much as the drive can", {.torque = 1, .kp = 0.5F, .most = NAN}, torque},
      {"position is no number", {.position = NAN, .torque = 1, .kp = 0.5F}, not_finite},
      {"a trajectory of its own", {.torque = 1, .kp = 0.5F, .trajectory = "022801ff"}, unknown_frame},
      {"the fastest one", {.torque = 1, .kp = 0.5F, .trajectory = "02287f7f"}, unknown_frame},
      {"none, by the int8 that is no number", {.torque = 1, .kp = 0.5F, .trajectory = "02288080"}, allowed},
      {"another mode", {.mode = "01000f", .torque = 1, .kp = 0.5F}, unknown_frame},
  };
  for (const Row& row : rows) {
    GuardBench bench("right_wrist_roll");
    EXPECT_EQ(bench.pass(0x8001, moteus_bytes(row.words), decision), row.expected) << row.when;
    const WireVerdict of_replacement = bench.pass(bench.left, decision);
    EXPECT_EQ(of_replacement, allowed) << row.when << ": what leaves is harmless";
  }
}

TEST(WireGuard, MoteusFramesThatDoNotMove) {
  GuardBench bench("right_wrist_roll");
  EXPECT_EQ(bench.pass(0x8001, "11001f01120e110a"), allowed) << "a question";
  EXPECT_EQ(bench.pass(0x8001, "01000011001f01120e110a50"), allowed) << "stopped";
  EXPECT_EQ(bench.pass(0x8001, "01000011001f01120e130a1a80021ba002505050"), allowed) << "who are you: 100, 120";
  EXPECT_EQ(bench.pass(0x8001, "01000009b10200000000"), unknown_frame) << "set output exact: 131";
  EXPECT_EQ(bench.pass(0x8001, "1b8080"), unknown_frame) << "no register";
  EXPECT_EQ(bench.pass(0x8001, "0c062000000000"), unknown_frame) << "cut short";
  EXPECT_EQ(bench.pass(0x8001, "0d3000000000"), unknown_frame) << "a register that we do not write";
  EXPECT_EQ(bench.pass(0x8001, "0d2000000000"), unknown_frame) << "a command without a mode";
  EXPECT_EQ(bench.pass(0x8001, "01000a07206000200150ff140400130d"), unknown_frame)
      << "the papers' int16 command: not how we say it";
  EXPECT_EQ(bench.pass(0x8002, "010000"), unknown_frame) << "another drive";
  CanFrame classic = takt::test::frame_of(0x8001, "010000", false, true);
  EXPECT_EQ(bench.pass(classic), unknown_frame);
}

// --- cia402: right_base_yaw, node 1, 25 Nm rated, 65536 counts ---

TEST(WireGuard, ReadsCst) {
  GuardBench bench("right_base_yaw");
  // The papers' -125 per mille of 25 Nm.
  EXPECT_EQ(bench.pass(0x201, "0f000a83ff", {.tau = -3.125F}), allowed);
  EXPECT_EQ(bench.pass(0x201, "0f000a83ff", {.tau = -3.2F}), differs);
  EXPECT_EQ(bench.pass(0x201, "0f000a7d00", {.tau = -3.125F}), differs) << "the sign is lost";
  EXPECT_EQ(bench.pass(0x201, "0f000883ff"), unknown_frame) << "another mode";
  EXPECT_EQ(bench.pass(0x201, "06000a0000"), allowed);
  EXPECT_EQ(bench.pass(0x201, "00000a83ff"), allowed) << "no voltage, no torque";
  EXPECT_EQ(bench.pass(0x201, "1f000a0000"), unknown_frame);
  EXPECT_EQ(bench.pass(0x202, "00000a0000"), unknown_frame);
  EXPECT_EQ(bench.pass(0x080, ""), allowed);
  Decision off;
  off.moment.enabled = false;
  EXPECT_EQ(bench.pass(0x201, "07000a0000", off), misplaced);
  EXPECT_EQ(hex(bench.left), "00000a0000");
}

TEST(WireGuard, SettingsOfCia402) {
  GuardBench bench("right_base_yaw");
  Decision off;
  off.moment.enabled = false;
  EXPECT_EQ(bench.pass(0x601, "2f6060000a000000", off), allowed) << "the papers' 6060 = 10";
  EXPECT_EQ(bench.pass(0x601, "2f6060000a000000"), misplaced) << "not while it is to be enabled";
  EXPECT_EQ(bench.pass(0x601, "2f60600008000000", off), unknown_frame) << "6060 = 8: not this robot's mode";
  EXPECT_EQ(bench.pass(0x601, "2300160310007160", off), allowed) << "1600:03 = 6071, 16 bits";
  EXPECT_EQ(bench.pass(0x601, "230016032000ff60", off), unknown_frame) << "1600:03 = 60FF, 32 bits";
  EXPECT_EQ(bench.pass(0x601, "2b726000d0070000", off), allowed) << "6072: the drive's 50 Nm, of 25 Nm rated";
  EXPECT_EQ(bench.pass(0x601, "2b726000d1070000", off), unknown_frame) << "6072: more than that";
  EXPECT_EQ(bench.pass(0x601, "2316100132007f00", off), allowed) << "1016:01: node 127, 50 ms";
  EXPECT_EQ(bench.pass(0x601, "2316100100007f00", off), unknown_frame) << "1016:01: for ever";
  EXPECT_EQ(bench.pass(0x601, "23161001e8037f00", off), allowed) << "1016:01: a second";
  EXPECT_EQ(bench.pass(0x601, "23161001e9037f00", off), unknown_frame) << "1016:01: longer";
  EXPECT_EQ(bench.pass(0x601, "2b07600001000000", off), allowed) << "6007: its loss is a fault";
  EXPECT_EQ(bench.pass(0x601, "2b07600000000000", off), unknown_frame) << "6007: its loss is nothing";
  EXPECT_EQ(bench.pass(0x77F, "05"), allowed) << "our heartbeat";
  EXPECT_EQ(bench.pass(0x601, "4076600000000000"), allowed) << "a question";
  EXPECT_EQ(bench.pass(0x601, "6000000000000000"), allowed) << "for the next segment of its answer";
  EXPECT_EQ(bench.pass(0x601, "7000000000000000"), allowed) << "and for the one after";
  EXPECT_EQ(bench.pass(0x601, "800a100000000008"), allowed) << "enough of it";
  EXPECT_EQ(bench.pass(0x601, "2100160004000000", off), unknown_frame) << "a write in segments";
  EXPECT_EQ(bench.pass(0x000, "8001", off), allowed) << "pre-operational";
  EXPECT_EQ(bench.pass(0x000, "8000", off), unknown_frame) << "every node";
  EXPECT_EQ(bench.pass(0x000, "8101", off), unknown_frame) << "reset";
}

config::RobotConfig in_mode(config::Cia402Mode mode) {
  config::RobotConfig robot = test::every_protocol();
  robot.joints[test::joint_named(robot, "right_base_yaw")].drive.mode = mode;
  return robot;
}

// Where the drive closes its own loop the joint's limit is what keeps its torque; elsewhere every frame does.
TEST(WireGuard, ADriveWithALoopOfItsOwnGetsNoMoreThanTheJointsTorque) {
  Decision off;
  off.moment.enabled = false;
  for (const auto mode : {config::Cia402Mode::csp, config::Cia402Mode::csv}) {
    GuardBench own("right_base_yaw", in_mode(mode));
    EXPECT_EQ(own.pass(0x601, "2b72600040060000", off), allowed) << "6072: the joint's 40 Nm, of 25 Nm rated";
    EXPECT_EQ(own.pass(0x601, "2b72600041060000", off), unknown_frame);
  }
}

TEST(WireGuard, ReadsCspAndCsv) {
  GuardBench csp("right_base_yaw", in_mode(config::Cia402Mode::csp));
  const auto counts = [](double rad) {
    return word_bytes(static_cast<std::uint32_t>(std::lround(rad * 65536 / 6.283185307)));
  };
  const Decision there{.q = 1, .kp = 100, .at_q = 0.99F};
  EXPECT_EQ(csp.pass(0x201, "0f0008" + counts(1), there), allowed);
  EXPECT_EQ(csp.pass(0x201, "0f0008" + counts(-1), there), differs);
  EXPECT_EQ(hex(csp.left), "0f0008" + counts(0.99)) << "stays where it is";
  EXPECT_EQ(csp.pass(0x201, "0f0008" + counts(3), {.q = 3, .kp = 100}), position);
  GuardBench csv("right_base_yaw", in_mode(config::Cia402Mode::csv));
  EXPECT_EQ(csv.pass(0x201, "0f0009" + counts(2.9), {.dq = 2.9F}), allowed);
  EXPECT_EQ(csv.pass(0x201, "0f0009" + counts(-2.9), {.dq = 2.9F}), differs);
  EXPECT_EQ(csv.pass(0x201, "0f0009" + counts(-3.1), {.dq = -3.1F}), velocity);
  EXPECT_EQ(hex(csv.left), "0f000900000000");
}

// --- time ---

TEST(WireGuard, ATorqueMayStartFromNoneAfterDamping) {
  GuardBench bench("left_wrist_pitch");  // 1 Nm a tick
  const auto step = [&bench](float tau) { return bench.pass(0x0AE, float_bytes(tau), {.tau = tau}); };
  EXPECT_EQ(step(0.9F), allowed);
  EXPECT_EQ(step(1.8F), allowed);
  EXPECT_EQ(step(0.5F), slew) << "1.3 Nm down";
  EXPECT_EQ(step(0.9F), allowed) << "from nothing: damping went out instead";
  EXPECT_EQ(bench.pass(0x0A7, "01000000"), allowed);
  EXPECT_EQ(step(-0.9F), allowed) << "from nothing: it was off";
  EXPECT_EQ(step(0.9F), slew);
}

TEST(WireGuard, ATorqueGoesOnFromTheBrakingThatWentOutInstead) {
  GuardBench bench("left_wrist_pitch");  // 1 Nm a tick
  const auto step = [&bench](float tau, float speed) {
    return bench.pass(0x0AE, float_bytes(tau), {.tau = tau, .at_dq = speed});
  };
  EXPECT_EQ(step(-3, -2), slew);
  float braking = 0;
  std::memcpy(&braking, bench.left.data, sizeof braking);
  ASSERT_GT(braking, 1.2F);
  EXPECT_EQ(step(braking + 0.9F, 2), allowed);
}

}  // namespace
}  // namespace takt::drivers

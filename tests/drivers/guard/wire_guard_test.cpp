// SPDX-License-Identifier: Apache-2.0
// Goal: the guard reads our frames as the drives do and refuses everything that breaks the contract, each for its own
// reason, with something harmless in its place.
// Method: frames are written by hand, byte for byte, from the protocols' papers (docs/drives.md); no encoder of ours is
// asked. Vectors that the papers print are marked.
#include "drivers/guard/wire_guard.hpp"

#include <gtest/gtest.h>

#include <algorithm>
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

// Goal: the damping that leaves instead is the joint's, at its drive: by the square of its gear. Method: 2 Nms/rad
// through a gear of 2 are 0.5 of 5 at the motor; through one of 100 rad per metre 2000 Ns/m are 0.2.
TEST(WireGuard, TheDampingThatLeavesInsteadIsOverTheGear) {
  for (const auto& [kind, gear, damping, left] :
       {std::tuple{config::JointKind::hinge, 2.0, 2.0, "7fff7ff0001997ff"},
        std::tuple{config::JointKind::slide, 100.0, 2000.0, "7fff7ff0000a37ff"}}) {
    config::RobotConfig robot = ak80_9().robot;
    config::Joint& joint = robot.joints[test::joint_named(robot, "left_elbow")];
    joint.kind = kind;
    joint.drive.gear_ratio = gear;
    joint.damping = damping;
    GuardBench bench("left_elbow", robot);
    EXPECT_NE(bench.pass(3, kAk809, Decision{}), allowed);
    EXPECT_EQ(hex(bench.left), left);
  }
}

// Goal: limits are those of where the joint is, not of what its drive counts from since power-on. Method: the paper's
// frame, which says 1 rad, to a drive that reads a turn less than its joint's place.
TEST(WireGuard, AFrameIsReadByWhatItsDriveIsOff) {
  constexpr float kTurn = 6.2831853F;
  GuardBench bench = ak80_9();
  config::RobotConfig robot = bench.robot;
  robot.joints[test::joint_named(robot, "left_elbow")].limits.q_max = 8;
  GuardBench shifted("left_elbow", robot);
  Decision decision = of_ak80_9();
  decision.q += kTurn;
  decision.at_q += kTurn;
  EXPECT_EQ(shifted.pass(3, kAk809, decision), torque) << "a turn's worth of stiffness";
  decision.moment.shift = kTurn;
  EXPECT_EQ(shifted.pass(3, kAk809, decision), allowed);
  EXPECT_EQ(bench.pass(3, kAk809, decision), position) << "beyond its limits";
  EXPECT_EQ(shifted.pass(3, kAk809, of_ak80_9()), allowed) << "of another tick, without";
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
      {"estimate is NaN", not_finite, [](Decision& d, config::Joint&) { d.at_q = NAN; }},
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
  EXPECT_EQ(bench.pass(2, "ffffffffffff02fd", off), unknown_frame) << "another protocol, to a RobStride";
  EXPECT_EQ(bench.pass(2, "ffffffffffff01fc"), unknown_frame) << "another mode, to a RobStride";
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

// 1 Nm a tick, 20 Nm, damping 0.5 Nms/rad.
GuardBench host_loop() {
  config::RobotConfig robot = test::every_protocol();
  config::Joint& joint = robot.joints[test::joint_named(robot, "left_wrist_pitch")];
  joint.drive.torque_range = joint.limits.torque = 20;
  joint.limits.torque_rate = 1000;
  joint.limits.kd = 2;
  joint.damping = 0.5;
  return GuardBench("left_wrist_pitch", robot);
}

float left_torque(const GuardBench& bench) {
  float torque = 0;
  std::memcpy(&torque, bench.left.data, sizeof torque);
  return torque;
}

// Each of them passed once, since it acts against the estimated speed and is no more than 2 Nms/rad of it.
TEST(WireGuard, NoTorqueIsExcusedForBraking) {
  struct Row {
    const char* when;
    WireVerdict expected;
    float tau;
    void (*change)(Decision&);
  };
  const Row rows[] = {
      {"as decided", allowed, -1, [](Decision&) {}},
      {"an old command", expired, -1, [](Decision& d) { d.moment.valid_until = d.moment.now - Duration{1}; }},
      {"a joint that is to be off", misplaced, -1, [](Decision& d) { d.moment.enabled = false; }},
      {"a silent joint", feedback_lost, -1, [](Decision& d) { d.feedback_age = milliseconds(25); }},
      {"beyond slew", slew, -3, [](Decision&) {}},
      {"beyond the limit", torque, -53.5F, [](Decision& d) { d.at_dq = 30; }},
      {"not what was decided", differs, -1, [](Decision& d) { d.tau = -0.5F; }},
  };
  for (const Row& row : rows) {
    GuardBench bench = host_loop();
    Decision decision{.tau = row.tau, .at_dq = 10};
    row.change(decision);
    EXPECT_EQ(bench.pass(0x0AE, float_bytes(row.tau), decision), row.expected) << row.when;
  }
}

TEST(WireGuard, AJointThatIsToBeOffGetsNothingAtAll) {
  Decision off;
  off.moment.enabled = false;
  GuardBench host = host_loop();
  EXPECT_EQ(host.pass(0x0AE, float_bytes(0), off), allowed);
  GuardBench mit("left_shoulder");
  EXPECT_EQ(mit.pass(2, "7fff7ff0000007ff", off), allowed) << "no torque, no gains";
  EXPECT_EQ(mit.pass(2, "7fff7ff000fff7ff", off), misplaced) << "damping";
  EXPECT_EQ(hex(mit.left), "fffffffffffffffd");
  GuardBench cst("right_base_yaw");
  EXPECT_EQ(cst.pass(0x201, "0f000a0000", off), misplaced) << "operation enabled";
}

TEST(WireGuard, WhatLeavesInsteadBrakesWhatTwoMeasure) {
  struct Row {
    const char* when;
    float before;  // Nm, what went out last; reached tick by tick
    float estimate, own;
    Duration feedback_age;
    float expected;
  };
  const Row rows[] = {
      {"the slower of the two", 0, 1.8F, 1, milliseconds(1), -0.5F},
      {"the slower of the two, backwards", 0, -1, -1.8F, milliseconds(1), 0.5F},
      {"they do not agree", 0, 10, -0.1F, milliseconds(1), 0},
      {"the drive stands", 0, 10, 0, milliseconds(1), 0},
      {"the drive's is NaN", 0, 10, NAN, milliseconds(1), 0},
      {"the estimate is NaN", 0, NAN, 10, milliseconds(1), 0},
      {"no further than slew from none", 0, 10, 10, milliseconds(1), -1},
      {"no further than slew from the last", -2, 10, 10, milliseconds(1), -3},
      {"what pushed is let go", 3, 10, 10, milliseconds(1), 0},
      {"not heard", 0, 10, 10, milliseconds(25), 0},
  };
  for (const Row& row : rows) {
    GuardBench bench = host_loop();
    for (int i = 1; i <= 4 && row.before != 0; ++i) {
      const float tau = row.before * static_cast<float>(i) / 4;
      ASSERT_EQ(bench.pass(0x0AE, float_bytes(tau), {.tau = tau}), allowed);
    }
    const Decision decision{.at_dq = row.estimate, .own_dq = row.own, .feedback_age = row.feedback_age};
    EXPECT_NE(bench.pass(0x0AE, "000000", decision), allowed);
    EXPECT_FLOAT_EQ(left_torque(bench), row.expected) << row.when;
  }
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
      {"position is NaN", {.position = NAN, .torque = 1, .kp = 0.5F}, not_finite},
      {"a trajectory of its own", {.torque = 1, .kp = 0.5F, .trajectory = "022801ff"}, unknown_frame},
      {"the fastest one", {.torque = 1, .kp = 0.5F, .trajectory = "02287f7f"}, unknown_frame},
      {"none, by the int8 that is NaN", {.torque = 1, .kp = 0.5F, .trajectory = "02288080"}, allowed},
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

std::string sdo(std::uint32_t command, std::uint32_t index, std::uint32_t sub, std::uint32_t value) {
  return word_bytes(command | index << 8U | sub << 24U) + word_bytes(value);
}

// Every object of ours with its only value; the same with another value, size, part or place is refused.
TEST(WireGuard, ASettingOfCia402HasOneValue) {
  Decision off;
  off.moment.enabled = false;
  GuardBench bench("right_base_yaw");
  struct Row {
    std::uint32_t command, index, sub, value;
  };
  const Row rows[] = {
      {0x23, 0x1400, 1, 0x8000'0201}, {0x23, 0x1400, 1, 0x0000'0201}, {0x2F, 0x1400, 2, 1},
      {0x2B, 0x1400, 5, 50},          {0x2F, 0x1600, 0, 0},           {0x2F, 0x1600, 0, 3},
      {0x23, 0x1600, 1, 0x6040'0010}, {0x23, 0x1600, 2, 0x6060'0008}, {0x23, 0x1600, 3, 0x6071'0010},
      {0x23, 0x1800, 1, 0xC000'0181}, {0x23, 0x1800, 1, 0x4000'0181}, {0x2F, 0x1800, 2, 1},
      {0x2F, 0x1A00, 0, 0},           {0x2F, 0x1A00, 0, 3},           {0x23, 0x1A00, 1, 0x6041'0010},
      {0x23, 0x1A00, 2, 0x6064'0020}, {0x23, 0x1A00, 3, 0x6077'0010}, {0x23, 0x1801, 1, 0xC000'0281},
      {0x23, 0x1802, 1, 0xC000'0381}, {0x23, 0x1803, 1, 0xC000'0481}, {0x23, 0x1016, 1, 127U << 16U | 50},
      {0x2B, 0x1017, 0, 100},         {0x2B, 0x6007, 0, 1},           {0x2F, 0x6060, 0, 10},
      {0x2F, 0x60C2, 1, 1},           {0x2F, 0x60C2, 2, 0xFD},        {0x2B, 0x6072, 0, 2000},
  };
  for (const Row& row : rows) {
    const auto told = [&](std::uint32_t command, std::uint32_t index, std::uint32_t sub, std::uint32_t value) {
      return bench.pass(0x601, sdo(command, index, sub, value), off);
    };
    const std::string which = sdo(row.command, row.index, row.sub, row.value);
    EXPECT_EQ(told(row.command, row.index, row.sub, row.value), allowed) << which;
    EXPECT_EQ(bench.pass(0x601, which), misplaced) << which << ": not while it is to be enabled";
    for (const std::uint32_t bit : {1U, 2U, 0x80U, 0x100U, 0x4000'0000U, 0x8000'0000U}) {
      const std::uint32_t value = row.value ^ bit;
      const bool is_another_row = std::ranges::any_of(rows, [&](const Row& other) {
        return other.index == row.index && other.sub == row.sub && other.value == value;
      });
      const bool is_less_torque = row.index == 0x6072 && value > 0 && value < row.value;
      if (!is_another_row && !is_less_torque) {
        EXPECT_EQ(told(row.command, row.index, row.sub, value), unknown_frame) << which << ", bit " << bit;
      }
    }
    EXPECT_EQ(told(row.command ^ 0x0C, row.index, row.sub, row.value), unknown_frame) << which << ": another size";
    EXPECT_EQ(told(row.command, row.index, row.sub + 6, row.value), unknown_frame) << which << ": another part";
    EXPECT_EQ(told(row.command, row.index ^ 0x40, row.sub, row.value), unknown_frame) << which << ": another object";
  }
  EXPECT_EQ(bench.pass(0x601, sdo(0x23, 0x1400, 1, 0x202), off), unknown_frame) << "it would listen to another node";
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
    config::RobotConfig geared = in_mode(mode);
    geared.joints[test::joint_named(geared, "right_base_yaw")].drive.gear_ratio = 2;
    GuardBench half("right_base_yaw", geared);
    EXPECT_EQ(half.pass(0x601, "2b72600020030000", off), allowed) << "20 Nm before a gear of 2";
    EXPECT_EQ(half.pass(0x601, "2b72600021030000", off), unknown_frame);
  }
}

// 6065 and 6066: no wider and no longer than the robot file says, and nothing where it does not stop the robot for it.
TEST(WireGuard, APositionDrivesWindowIsTheRobotFiles) {
  Decision off;
  off.moment.enabled = false;
  config::RobotConfig robot = in_mode(config::Cia402Mode::csp);
  const std::string window = sdo(0x23, 0x6065, 0, 100), timeout = sdo(0x2B, 0x6066, 0, 1000);
  GuardBench warns("right_base_yaw", robot);
  EXPECT_EQ(warns.pass(0x601, window, off), unknown_frame);
  EXPECT_EQ(warns.pass(0x601, timeout, off), unknown_frame);
  robot.feedback.following = config::Following::stop;
  GuardBench stops("right_base_yaw", robot);
  EXPECT_EQ(stops.pass(0x601, window, off), allowed);
  EXPECT_EQ(stops.pass(0x601, window), misplaced) << "not while it is to be enabled";
  EXPECT_EQ(stops.pass(0x601, sdo(0x23, 0x6065, 0, 0), off), unknown_frame) << "it would fault at once";
  EXPECT_EQ(stops.pass(0x601, sdo(0x23, 0x6065, 0, 0xFFFF'FFFF), off), unknown_frame) << "it would never";
  EXPECT_EQ(stops.pass(0x601, timeout, off), allowed) << "twice the executive's own";
  EXPECT_EQ(stops.pass(0x601, sdo(0x2B, 0x6066, 0, 1001), off), unknown_frame);
  robot.joints[test::joint_named(robot, "right_base_yaw")].kp = 0;
  GuardBench limp("right_base_yaw", robot);
  EXPECT_EQ(limp.pass(0x601, sdo(0x23, 0x6065, 0, 1), off), unknown_frame) << "without stiffness there is no window";
  EXPECT_EQ(limp.pass(0x601, timeout, off), unknown_frame) << "nor a time to be beyond it";
  robot = in_mode(config::Cia402Mode::cst);
  robot.feedback.following = config::Following::stop;
  GuardBench torque("right_base_yaw", robot);
  EXPECT_EQ(torque.pass(0x601, window, off), unknown_frame) << "its loop is not the drive's";
}

TEST(WireGuard, ReadsCspAndCsv) {
  GuardBench csp("right_base_yaw", in_mode(config::Cia402Mode::csp));
  const auto counts = [](double rad) {
    return word_bytes(static_cast<std::uint32_t>(std::lround(rad * 65536 / 6.283185307)));
  };
  const Decision there{.q = 1, .kp = 100, .at_q = 0.998F};
  EXPECT_EQ(csp.pass(0x201, "0f0008" + counts(0.999), there), differs);
  EXPECT_EQ(hex(csp.left), "0f0008" + counts(0.998)) << "stays where it is";
  EXPECT_EQ(csp.pass(0x201, "0f0008" + counts(1), there), allowed);
  EXPECT_EQ(csp.pass(0x201, "0f0008" + counts(1.002), there), differs);
  EXPECT_EQ(hex(csp.left), "0f0008" + counts(1)) << "stays where it was told to be";
  EXPECT_EQ(csp.pass(0x201, "0f0008" + counts(3), {.q = 3, .kp = 100}), position);
  GuardBench csv("right_base_yaw", in_mode(config::Cia402Mode::csv));
  EXPECT_EQ(csv.pass(0x201, "0f0009" + counts(2.9), {.dq = 2.9F}), allowed);
  EXPECT_EQ(csv.pass(0x201, "0f0009" + counts(-2.9), {.dq = 2.9F}), differs);
  EXPECT_EQ(csv.pass(0x201, "0f0009" + counts(-3.1), {.dq = -3.1F}), velocity);
  EXPECT_EQ(hex(csv.left), "0f000900000000");
}

// 3 rad/s: 3 mrad a tick.
TEST(WireGuard, APositionGoesNoFurtherThanTheVelocityLimitInATick) {
  const auto counts = [](double rad) {
    return word_bytes(static_cast<std::uint32_t>(std::lround(rad * 65536 / 6.283185307)));
  };
  struct Row {
    const char* when;
    float from, to, at;  // told before, told now, and where the joint is
    WireVerdict expected;
  };
  const Row rows[] = {
      {"in a tick", 1, 1.003F, 1, allowed},
      {"too far", 1, 1.004F, 1, velocity},
      {"too far back", 1, 0.996F, 1, velocity},
      {"a throw", 1, -1.4F, 1, velocity},
      {"to where the joint is", 1, 0.95F, 0.95F, allowed},
      {"towards where it is", 1, 0.97F, 0.95F, allowed},
      {"beyond where it is", 1, 0.94F, 0.95F, velocity},
  };
  for (const Row& row : rows) {
    GuardBench bench("right_base_yaw", in_mode(config::Cia402Mode::csp));
    const auto told = [&](float q, float at) {
      return bench.pass(0x201, "0f0008" + counts(q), {.q = q, .kp = 100, .at_q = at});
    };
    ASSERT_EQ(told(row.from, row.from + 1e-3F), allowed);
    EXPECT_EQ(told(row.to, row.at), row.expected) << row.when;
  }
}

TEST(WireGuard, AfterNoPositionOfOursItBeginsWhereTheJointIs) {
  const auto counts = [](double rad) {
    return word_bytes(static_cast<std::uint32_t>(std::lround(rad * 65536 / 6.283185307)));
  };
  GuardBench bench("right_base_yaw", in_mode(config::Cia402Mode::csp));
  const auto told = [&](float q, float at) {
    return bench.pass(0x201, "0f0008" + counts(q), {.q = q, .kp = 100, .at_q = at});
  };
  EXPECT_EQ(told(0, 1.2F), velocity) << "from none";
  EXPECT_EQ(told(1.201F, 1.2F), allowed);
  EXPECT_EQ(bench.pass(0x201,
                       "0000080000"
                       "0000"),
            allowed)
      << "off";
  EXPECT_EQ(told(1.201F, 0.6F), velocity) << "it sank meanwhile";
  Decision never{.q = 0, .kp = 100, .at_q = 0, .feedback_age = kDecided - MonoTime{}};
  GuardBench fresh("right_base_yaw", in_mode(config::Cia402Mode::csp));
  EXPECT_EQ(fresh.pass(0x201, "0f0008" + counts(0), never), feedback_lost);
  EXPECT_EQ(hex(fresh.left), "00000800000000") << "where it is is not known: no power";
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
  const float braking = left_torque(bench);
  ASSERT_GT(braking, 0.8F);
  EXPECT_EQ(step(braking + 0.9F, 2), allowed);
}

// A drive that damps by its own measurement is told no torque: the next one starts from what its damping makes.
TEST(WireGuard, ATorqueGoesOnFromTheDrivesOwnDamping) {
  GuardBench model = ak80_9();
  config::Joint& joint = model.robot.joints[test::joint_named(model.robot, "left_elbow")];
  joint.limits.torque_rate = 1000;  // 1 Nm a tick
  joint.damping = 4;                // 8 Nm at -2 rad/s
  GuardBench bench("left_elbow", model.robot);
  EXPECT_EQ(bench.pass(3, kAk809, of_ak80_9()), slew) << "8 Nm from none";
  EXPECT_EQ(bench.pass(3, kAk809, of_ak80_9()), allowed) << "8 Nm from the damping's 8 Nm";
  Decision unknown = of_ak80_9();
  unknown.at_dq = NAN;
  EXPECT_NE(bench.pass(3, kAk809, unknown), allowed);
  EXPECT_EQ(bench.pass(3, kAk809, of_ak80_9()), slew) << "at a speed that is NaN the damping makes none";
}

}  // namespace
}  // namespace takt::drivers

// SPDX-License-Identifier: Apache-2.0
// Goal: what a robot file says of divided rates, CAN FD, temperatures and stops is read, refused where it cannot hold,
// and its price told. Method: the small robot with one place changed; sentences compared whole.
#include <gtest/gtest.h>

#include <algorithm>
#include <array>
#include <string>

#include "config/cautions.hpp"
#include "config/load.hpp"
#include "config/stop_causes.hpp"
#include "config/turns.hpp"
#include "tests/config/small_robot.hpp"
#include "tests/support/replaced.hpp"

namespace takt::config::test {
namespace {

constexpr std::string_view kHip = "model: AK10-9, id: 1";
constexpr std::string_view kBus = "interface: can0, when_missing: loopback";

std::string complaint(const std::string& text) {
  const auto robot = parse(text, "r");
  return robot ? "" : robot.error();
}
bool complains(const std::string& text, std::string_view of) {
  const std::string said = complaint(text);
  EXPECT_NE(said.find(of), std::string::npos) << said;
  return said.find(of) != std::string::npos;
}

using takt::test::replaced;

// --- turns ---

RobotConfig robot_with(std::initializer_list<std::uint32_t> every) {
  RobotConfig robot;
  robot.control.period = milliseconds(1);
  robot.buses.resize(1);
  for (const std::uint32_t one : every) robot.joints.emplace_back().drive.every = one;
  return robot;
}

// Rates without a common divisor meet, whatever the phases: no three of them here.
TEST(Turns, SpreadTheDrivesOfABusEvenly) {
  for (const auto& every : {std::initializer_list<std::uint32_t>{2, 2, 2, 2, 2, 2},
                            {3, 3, 3, 3},
                            {2, 4, 4, 8, 8},
                            {1, 1, 2, 2},
                            {2, 3, 6, 6}}) {
    const RobotConfig robot = robot_with(every);
    const std::vector<Turns> turns = turns_of(robot);
    double average = 0;
    for (const std::uint32_t one : every) average += 1.0 / one;
    std::size_t most = 0;
    for (std::uint64_t tick = 0; tick < kTurnPattern; ++tick)
      most = std::max<std::size_t>(most, static_cast<std::size_t>(std::ranges::count_if(
                                             turns, [&](const Turns& one) { return one.has(tick); })));
    EXPECT_LE(static_cast<double>(most), std::max(average + 1, 1.0));
    for (std::size_t j = 0; j < turns.size(); ++j) EXPECT_LT(turns[j].phase, turns[j].every);
  }
}

TEST(Turns, EveryJointHasItsTurnAndOnlyThen) {
  const std::vector<Turns> turns = turns_of(robot_with({1, 5}));
  int first = 0, second = 0;
  for (std::uint64_t tick = 0; tick < 1000; ++tick) {
    first += turns[0].has(tick) ? 1 : 0;
    second += turns[1].has(tick) ? 1 : 0;
  }
  EXPECT_EQ(first, 1000);
  EXPECT_EQ(second, 200);
}

TEST(Turns, AreRefusedWhereADriveWouldGiveUpBetweenThem) {
  EXPECT_EQ(complaint(with(kHip, "model: AK10-9, id: 1, every: 4")), "");
  EXPECT_TRUE(complains(with(kHip, "model: AK10-9, id: 1, every: 9"), "9 is out of range; write 1 to 8"));
  EXPECT_TRUE(complains(with(kHip, "model: AK10-9, id: 1, every: 6"),
                        "joints[0].drive.every: turn 6 ms * observer_bandwidth 200 rad/s exceeds 1"));
  const std::string slow = replaced(with(kHip, "model: AK10-9, id: 1, every: 4"), "feedback: { timeout: 20 ms }",
                                    "feedback: { timeout: 7 ms }");
  EXPECT_TRUE(complains(slow, "a reply every 4 ms leaves no room for one lost within feedback.timeout 7 ms"));
}

TEST(Turns, TheirPriceIsTold) {
  const auto robot = parse(with(kHip, "model: AK10-9, id: 1, every: 3"), "r");
  ASSERT_TRUE(robot) << robot.error();
  const auto lines = cautions_about(*robot);
  ASSERT_EQ(lines.size(), 1U);
  EXPECT_EQ(
      lines[0],
      "bus left: 1 of 2 drives are written to every few ticks (drive.every): their setpoints act up to 2 ms longer "
      "and what they measured is up to 2 ms older, out of max_age 120 ms; a stop is written at once");
}

// --- buses ---

TEST(Buses, SixteenAreAndSeventeenAreTooMany) {
  for (const int count : {16, 17}) {
    std::string buses = "  - { name: left, interface: can0, when_missing: loopback }\n";
    for (int i = 1; i < count; ++i)
      buses += "  - { name: b" + std::to_string(i) + ", interface: can" + std::to_string(i) + " }\n";
    const std::string text = with("  - { name: left, interface: can0, when_missing: loopback }\n", buses);
    EXPECT_EQ(complaint(text).empty(), count == 16) << complaint(text);
  }
}

// A RobStride in MIT protocol takes the bits above its number for a mode: what another drive is sent, or answers with,
// must not look like an order to it.
TEST(Buses, NothingOnThemIsAnOrderToARobstrideInMitProtocol) {
  const auto robot_with = [](std::string_view reply_id, std::string_view others_id, std::string_view others_reply) {
    const std::string text = replaced(
        std::string(kSmallRobot),
        "{ protocol: mit, variant: tmotor, model: AK10-9, id: 1, reply_id: 0, position_after_power_up: absolute }",
        "{ protocol: mit, variant: robstride, id: 1, reply_id: " + std::string(reply_id) +
            ", position_range: 12.57 rad, velocity_range: 33 rad/s, torque_range: 14 Nm, kp_range: 500 Nm/rad, "
            "kd_range: 5 Nms/rad }");
    return replaced(text, "id: 0x02, reply_id: 0,",
                    "id: " + std::string(others_id) + ", reply_id: " + std::string(others_reply) + ",");
  };
  EXPECT_EQ(complaint(robot_with("0xFD", "0x02", "0")), "");
  EXPECT_EQ(complaint(robot_with("0xFD", "0x102", "0")), "");
  EXPECT_TRUE(complains(robot_with("0xFD", "0x101", "0"), "CAN id 0x101 is already hip's on bus left"));
  EXPECT_TRUE(complains(robot_with("0xFD", "0x02", "0x201"), "CAN id 0x201 is hip's id on bus left"));
  EXPECT_TRUE(complains(robot_with("0x101", "0x02", "0"), "0x101 is the drive's own id"));
}

// --- CAN FD ---

std::string damiao_on(std::string_view bus, std::string_view drive) {
  const std::string text = with(kBus, bus);
  return replaced(text,
                  "{ protocol: mit, variant: tmotor, model: AK10-9, id: 1, reply_id: 0, position_after_power_up: "
                  "absolute }",
                  drive);
}

TEST(FdBitrate, IsTheBussAndOneThatTheMakerHas) {
  constexpr std::string_view kDrive =
      "{ protocol: mit, variant: damiao, model: DM8009, id: 1, reply_id: 0x11, fd_bitrate: 5 Mbit/s }";
  EXPECT_EQ(complaint(damiao_on("interface: can0, fd: true, when_missing: loopback", kDrive)), "");
  EXPECT_TRUE(
      complains(damiao_on(kBus, kDrive), "joints[0].drive.fd_bitrate: the drive speaks CAN FD; write `fd: true`"));
  EXPECT_TRUE(complains(damiao_on("interface: can0, fd: true, data_bitrate: 2 Mbit/s", kDrive),
                        "bus left has a data_bitrate of 2000000 bit/s, and all on a bus have the same"));
  EXPECT_TRUE(complains(damiao_on("interface: can0, fd: true, bitrate: 500 kbit/s", kDrive),
                        "Damiao drives are known to speak CAN FD at 1 Mbit/s alone"));
  EXPECT_TRUE(
      complains(damiao_on("interface: can0, fd: true, data_bitrate: 8 Mbit/s",
                          "{ protocol: mit, variant: damiao, model: DM8009, id: 1, reply_id: 0x11, fd_bitrate: 8 "
                          "Mbit/s }"),
                "8000000 bit/s is no rate that Damiao drives are known to have"));
  EXPECT_TRUE(complains(with(kHip, "model: AK10-9, id: 1, fd_bitrate: 5 Mbit/s"),
                        "`fd_bitrate` in `joints[0].drive` needs `mit (damiao)` beside it: "))
      << "a T-Motor drive has none";
}

// --- temperatures ---

std::string limited(std::string_view limits) {
  return with("      velocity_hard: 4 rad/s\n",
              "      velocity_hard: 4 rad/s\n      temperature: " + std::string(limits) + "\n");
}

TEST(Temperatures, AreReadAndMakeSense) {
  const auto robot = parse(limited("{ warning: 80 degC, stop: 90 degC }"), "r");
  ASSERT_TRUE(robot) << robot.error();
  ASSERT_TRUE(robot->joints[0].limits.temperature);
  EXPECT_EQ(robot->joints[0].limits.temperature->stop, 90);
  EXPECT_FALSE(robot->joints[1].limits.temperature);
  const auto lines = cautions_about(*robot);
  ASSERT_EQ(lines.size(), 1U);
  EXPECT_EQ(lines[0],
            "hip: a T-Motor drive tells its temperature in replies of 8 bytes alone; one with 6 is not armed under "
            "limits.temperature");
  EXPECT_TRUE(complains(limited("{ warning: 90 degC, stop: 80 degC }"), "warning 90 degC is not below stop 80 degC"));
  EXPECT_TRUE(complains(limited("{ casing_stop: 80 degC }"), "this drive tells one temperature"));
  EXPECT_TRUE(complains(limited("{ warning: 80 rad }"), "80 rad is an angle, not a temperature; write it in degC"));
}

// --- stops ---

std::string stopping(std::string_view stops) {
  return with("degraded: {", "stops: " + std::string(stops) + "\ndegraded: {");
}

TEST(Stops, AreNamedByTheirCause) {
  const auto robot = parse(stopping("{ operator_stop: { how: hold, for: 3 s }, tilt: { how: damping } }"), "r");
  ASSERT_TRUE(robot) << robot.error();
  ASSERT_EQ(robot->stops.size(), 2U);
  EXPECT_EQ(robot->stops[0].how, StopHow::hold);
  EXPECT_EQ(robot->stops[0].longest, seconds(3));
  EXPECT_TRUE(complains(stopping("{ drive_fault: { how: hold, for: 1 s } }"),
                        "stops.drive_fault: is no cause of a damped stop"));
  EXPECT_TRUE(complains(stopping("{ tilt: { how: posture, fallback: tuck, for: 1 s } }"),
                        "stops.tilt.how: `posture` is gone since version 0.2: write hold"))
      << "a stop leads the robot nowhere; degraded.fallback does";
  EXPECT_TRUE(complains(stopping("{ tilt: { how: hold } }"), "key `for` is missing")) << "a time bound is no default";
}

TEST(Stops, ByPolicyNeedAFallbackPolicyThatTheirCauseLeavesAble) {
  EXPECT_TRUE(complains(stopping("{ operator_stop: { how: policy, for: 3 s } }"),
                        "stops.operator_stop.how: policy, and the robot has no fallback policy"));
  const auto stopped_by = [](const std::string& cause) {
    return replaced(stopping("{ " + cause + ": { how: policy, for: 3 s } }"),
                    "kind: pose, speed: 0.5 rad/s, pose: [0 rad, 10 deg]", "kind: policy, for: 20 s");
  };
  const auto robot = parse(stopped_by("operator_stop"), "r");
  ASSERT_TRUE(robot) << robot.error();
  EXPECT_EQ(robot->stops[0].how, StopHow::policy);
  EXPECT_EQ(robot->stops[0].longest, seconds(3));
  for (const char* cause : {"fallback_spent", "imu_lost", "tilt", "recording_lost", "foreign_node", "shutdown"})
    EXPECT_TRUE(complains(stopped_by(cause), ".how: policy is for operator_stop, bad_commands, overrun alone"));
}

TEST(Stops, WhereNoneIsByTheFallbackPolicyARobotThatBalancesIsSaidToFall) {
  const auto balancer = load("config/balancer.yaml");
  ASSERT_TRUE(balancer) << balancer.error();
  EXPECT_TRUE(cautions_about(*balancer).empty());
  RobotConfig without = *balancer;
  without.stops.clear();
  const auto lines = cautions_about(without);
  ASSERT_EQ(lines.size(), 1U);
  EXPECT_TRUE(lines[0].starts_with("stops: none is by the fallback policy, and the base is free"));
}

// Goal: what a stop does without a model is said of every robot without one. Method: the robots that come with Takt.
TEST(Stops, WithoutAModelWhatTheyDoIsTold) {
  const auto cart = load("config/cart_pole.yaml"), arm = load("config/arm6.yaml"),
             balancer = load("config/balancer.yaml");
  ASSERT_TRUE(cart && arm && balancer);
  EXPECT_TRUE(holds_at_once(*cart));
  ASSERT_EQ(cautions_about(*cart).size(), 1U);
  EXPECT_EQ(cautions_about(*cart)[0], stops_without_model(*cart));
  EXPECT_TRUE(
      stops_without_model(*cart).starts_with("no `model`: a stop carries no gravity; each joint that is heard brakes"));
  EXPECT_FALSE(holds_at_once(*arm));
  EXPECT_TRUE(stops_without_model(*arm).empty());
  EXPECT_FALSE(holds_at_once(*balancer)) << "stiff joints do not keep it on its feet";
  RobotConfig walker = *balancer;
  walker.degraded.behaviour = Degraded::hold;
  walker.stops.clear();
  EXPECT_TRUE(stops_without_model(walker).starts_with("no `model`, and the base is free"));
}

// Only a robot that can fall is to stay on its feet by something; whether it does, an attestation says, wherever the
// robot file lies.
TEST(Stops, WhatARobotThatCanFallIsToStandByIsNamed) {
  const std::string free_base = replaced(
      stopping("{ operator_stop: { how: hold, for: 3 s, shown_by: seen/stop.json }, tilt: { how: damping }, "
               "overrun: { how: hold, for: 0 s } }"),
      "  - { name: target, values: 3, timeout: 100 ms }\n",
      "  - { name: target, values: 3, timeout: 100 ms }\n  - { name: base, values: 10, timeout: 20 ms }\nimu: { "
      "sensor: base, tilt: 1 rad }\n");
  const auto robot = parse(free_base, "/robots/r.yaml");
  ASSERT_TRUE(robot) << robot.error();
  const auto offers = offered_as_safe(*robot);
  ASSERT_EQ(offers.size(), 3U) << "damping offers nothing";
  EXPECT_EQ(offers[0].of, "fallbacks.tuck");
  EXPECT_EQ(offers[0].shown_by, "none");
  EXPECT_EQ(offers[1].of, "stops.operator_stop");
  EXPECT_EQ(offers[1].what, "hold");
  EXPECT_EQ(offers[1].shown_by, "/robots/seen/stop.json");
  EXPECT_EQ(offers[2].what, "hold");
  const auto fixed = parse(stopping("{ operator_stop: { how: hold, for: 3 s } }"), "r");
  ASSERT_TRUE(fixed);
  EXPECT_TRUE(offered_as_safe(*fixed).empty()) << "an arm on its table does not fall";
}

}  // namespace
}  // namespace takt::config::test

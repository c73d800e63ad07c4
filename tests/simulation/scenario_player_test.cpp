// SPDX-License-Identifier: Apache-2.0
// Goal: every fault of a scenario does to a drive, and to the host in front of it, what its name promises, from its
// begin to its end.
// Method: two drives on flywheels and their host drivers in virtual time, one millisecond per tick, frames handed over
// by function call; what the host saw is read from its feedback.
#include "simulation/scenario_player.hpp"

#include <gtest/gtest.h>

#include <array>
#include <cmath>
#include <numbers>
#include <string>
#include <utility>
#include <vector>

#include "drivers/protocol/protocol_table.hpp"
#include "simulation/devices_file.hpp"
#include "simulation/robot_plant.hpp"
#include "tests/simulation/plant_robots.hpp"

namespace takt::simulation {
namespace {

constexpr std::string_view kDevices =
    "schema: takt.devices/1\n"
    "buses:\n"
    "  - { name: can0, interface: can0 }\n"
    "devices:\n"
    "  - { name: hip, bus: can0, drive: { protocol: mit, variant: damiao, model: DM8009, id: 1, reply_id: 0x11 }, "
    "inertia: 0.05 kgm2 }\n"
    "  - { name: knee, bus: can0, drive: { protocol: mit, variant: damiao, model: DM8009, id: 2, reply_id: 0x12 }, "
    "inertia: 0.05 kgm2 }\n"
    "simulation: { drive_watchdog: 20 ms }\n";

constexpr std::size_t kHip = 0, kKnee = 1;

class Bench {
 public:
  explicit Bench(const std::string& events)
      : robot_(parse_devices(kDevices, "d").value()),
        plant(Plant::on_free_inertias(robot_).value()),
        trouble(robot_, 0),
        player_(parse_scenario("schema: takt.scenario/1\nevents:\n" + events, "s", robot_).value(), robot_,
                [this](const std::string& line) { log.push_back(line); }) {
    for (config::Joint& joint : robot_.joints) {  // which a devices file does not tell
      joint.limits.q_min = -3;
      joint.limits.q_max = 3;
    }
    for (std::size_t joint = 0; joint < 2; ++joint)
      hosts.push_back(std::move(*drivers::make_joint_driver(robot_, joint)));
  }
  // The host enables from the first tick on and asks for zero torque, or what `torque` says.
  void run(int ms) {
    for (int i = 0; i < ms; ++i) tick();
  }
  [[nodiscard]] int replies(std::size_t joint) const { return hosts[joint]->feedback().replies; }
  // Replies within the next tick.
  int replies_in_a_tick(std::size_t joint) {
    const int before = replies(joint);
    tick();
    return (replies(joint) - before) & 0xFF;
  }
  [[nodiscard]] const JointFeedback& told(std::size_t joint) const { return hosts[joint]->feedback(); }
  [[nodiscard]] DriveState seen(std::size_t joint) const { return hosts[joint]->feedback().drive_state; }

 private:
  void tick() {
    player_.advance(plant);
    trouble.set(player_.on_bus(0));
    Frames answers;
    for (const auto& host : hosts) {
      std::array<drivers::CanFrame, drivers::kMaxFramesPerDrive> out;
      const std::size_t count = host->encode(enable, {.tau = torque}, {}, {}, out);
      for (std::size_t i = 0; i < count; ++i)
        if (!trouble.loses()) plant.receive(0, out[i], answers);
    }
    Frames strangers;
    trouble.speak(strangers);
    for (const drivers::CanFrame& frame : strangers) plant.receive(0, frame, answers);
    strange_frames += strangers.size();
    plant.collect(0, answers);
    for (const drivers::CanFrame& answer : answers) {
      trouble.overhear(answer, plant.now());
      if (trouble.loses()) continue;
      for (const auto& host : hosts) host->decode({answer, plant.now()});
    }
    plant.step();
  }
  config::RobotConfig robot_;

 public:
  Plant plant;
  BusTrouble trouble;
  std::vector<std::unique_ptr<drivers::JointDriver>> hosts;
  std::vector<std::string> log;
  bool enable = true;
  float torque = 0;
  std::size_t strange_frames = 0;

 private:
  ScenarioPlayer player_;
};

TEST(ScenarioPlayer, ConstantTorqueTurnsAFlywheelAsNewtonSays) {
  Bench bench("  - { at: 900 s, joint: hip, fault: silent }\n");
  bench.run(60);  // settings read back, enabled
  const double before = bench.plant.state().dq[kHip];
  bench.torque = 0.5F;
  bench.run(500);
  // The torque field's quantum: 2 * 54 Nm / 4095.
  EXPECT_NEAR(bench.plant.state().dq[kHip] - before, 0.5 / 0.05 * 0.5, 0.014 / 0.05 * 0.51);
}

TEST(ScenarioPlayer, SilentObeysAndIsNotHeardThenIsHeardAgain) {
  Bench bench("  - { at: 100 ms, joint: hip, fault: silent, for: 50 ms }\n");
  bench.run(100);
  EXPECT_EQ(bench.replies_in_a_tick(kHip), 0);
  const int before = bench.replies(kHip);
  bench.torque = 1;
  bench.run(49);
  EXPECT_EQ(bench.replies(kHip), before);
  EXPECT_EQ(bench.plant.drive(kHip).state(), DeviceState::enabled) << "its watchdog is fed";
  EXPECT_GT(bench.plant.state().dq[kHip], 0.5) << "it obeys";
  EXPECT_EQ(bench.replies_in_a_tick(kHip), 1);
  EXPECT_EQ(bench.replies_in_a_tick(kKnee), 1);
  EXPECT_EQ(bench.log, (std::vector<std::string>{"at 0.100 s: hip: silent for 50 ms",
                                                 "at 0.150 s: hip: end of silent for 50 ms"}));
}

// What it says of its position, by where it stood when the fault began and where it is.
TEST(ScenarioPlayer, ADriveThatLiesObeysAndSaysWhatIsNotTrue) {
  struct Lie {
    const char* fault;
    double (*said)(double stood, double is);
    bool tells_velocity = true;  // that is true
  };
  const Lie lies[] = {
      {"fault: freeze", [](double stood, double) { return stood; }, false},
      {"fault: frozen_position", [](double stood, double) { return stood; }},
      {"fault: reversed", [](double stood, double is) { return 2 * stood - is; }},
      {"fault: wrap", [](double, double is) { return is + 2 * std::numbers::pi; }},
      {"jump: -0.3 rad", [](double, double is) { return is - 0.3; }},
      {"scale: 2", [](double stood, double is) { return 2 * is - stood; }},
  };
  for (const Lie& lie : lies) {
    Bench bench("  - { at: 100 ms, joint: hip, " + std::string(lie.fault) + ", for: 200 ms }\n");
    bench.run(100);
    const double stood = bench.plant.state().q[kHip];
    bench.torque = 0.2F;
    bench.run(150);
    const double is = bench.plant.state().q[kHip], speed = bench.plant.state().dq[kHip];
    EXPECT_GT(is - stood, 0.02) << lie.fault << ": it obeys";
    EXPECT_NEAR(bench.told(kHip).q, lie.said(stood, is), 0.01) << lie.fault;
    EXPECT_EQ(std::abs(bench.told(kHip).dq - speed) < 0.1, lie.tells_velocity) << lie.fault;
    bench.run(100);
    EXPECT_NEAR(bench.told(kHip).q, bench.plant.state().q[kHip], 0.01) << lie.fault << ": it is over";
  }
}

TEST(ScenarioPlayer, DeafTripsTheDrivesOwnWatchdog) {
  Bench bench("  - { at: 100 ms, joint: hip, fault: deaf, for: 80 ms }\n");
  bench.run(100);
  EXPECT_EQ(bench.plant.drive(kHip).state(), DeviceState::enabled);
  bench.run(79);  // the host wrote a time-out of 50 ms
  EXPECT_EQ(bench.plant.drive(kHip).state(), DeviceState::lost);
  EXPECT_EQ(bench.plant.drive(kKnee).state(), DeviceState::enabled);
  bench.run(2);
  EXPECT_EQ(bench.seen(kHip), DriveState::fault) << "it says so when it hears again";
}

TEST(ScenarioPlayer, RepeatAndDelayShowInTheCountOfReplies) {
  Bench bench(
      "  - { at: 100 ms, joint: hip, fault: repeat, for: 10 ms }\n"
      "  - { at: 200 ms, joint: hip, delay: 3 ms, for: 10 ms }\n");
  bench.run(100);
  EXPECT_EQ(bench.replies_in_a_tick(kHip), 2);
  EXPECT_EQ(bench.replies_in_a_tick(kKnee), 1);
  bench.run(97);
  EXPECT_EQ(bench.replies_in_a_tick(kHip), 1) << "199 ms";
  EXPECT_EQ(bench.replies_in_a_tick(kHip), 0);
  EXPECT_EQ(bench.replies_in_a_tick(kHip), 0);
  EXPECT_EQ(bench.replies_in_a_tick(kHip), 0);
  EXPECT_EQ(bench.replies_in_a_tick(kHip), 1) << "said at 200 ms";
  const int before = bench.replies(kHip);
  bench.run(100);
  EXPECT_EQ((bench.replies(kHip) - before) & 0xFF, 103) << "late, none lost";
}

TEST(ScenarioPlayer, DropLosesRepliesOfThatDriveOnly) {
  Bench bench("  - { at: 0 ms, joint: hip, drop: 0.5 }\n");
  bench.run(200);
  EXPECT_NEAR(bench.replies(kHip), 100, 30);
  EXPECT_EQ(bench.replies(kKnee), 200);
}

TEST(ScenarioPlayer, AnErrorIsReportedUntilTheHostClearsIt) {
  Bench bench("  - { at: 100 ms, joint: knee, error: over_temperature }\n");
  bench.run(103);
  EXPECT_EQ(bench.seen(kKnee), DriveState::fault);
  EXPECT_EQ(bench.seen(kHip), DriveState::enabled);
  bench.enable = false;
  bench.run(5);
  EXPECT_EQ(bench.seen(kKnee), DriveState::disabled);
  bench.run(200);
  EXPECT_EQ(bench.seen(kKnee), DriveState::disabled) << "it strikes once";
}

TEST(ScenarioPlayer, APowerCycleTakesItsLengthAndTheBoot) {
  Bench bench("  - { at: 100 ms, joint: hip, fault: power_cycle, for: 50 ms }\n");
  bench.run(149);
  EXPECT_EQ(bench.plant.drive(kHip).state(), DeviceState::booting);
  bench.run(static_cast<int>(kBootTime.milliseconds()));
  EXPECT_EQ(bench.plant.drive(kHip).state(), DeviceState::booting) << "the boot began when the supply came back";
  bench.run(5);
  EXPECT_NE(bench.plant.drive(kHip).state(), DeviceState::booting);
}

TEST(ScenarioPlayer, AfterEnabledWaitsForTheDrive) {
  Bench bench("  - { after: enabled, at: 100 ms, joint: hip, fault: silent }\n");
  bench.enable = false;
  bench.run(300);
  EXPECT_EQ(bench.replies_in_a_tick(kHip), 1);
  bench.enable = true;
  bench.run(2);
  ASSERT_EQ(bench.plant.drive(kHip).state(), DeviceState::enabled);
  bench.run(98);
  EXPECT_EQ(bench.replies_in_a_tick(kHip), 1);
  bench.run(2);
  EXPECT_EQ(bench.replies_in_a_tick(kHip), 0);
}

TEST(ScenarioPlayer, OnABusItWaitsForEveryDriveOfIt) {
  Bench bench("  - { after: enabled, at: 0 ms, bus: can0, drop: 1 }\n");
  bench.enable = false;
  bench.run(50);  // settings read back
  bench.plant.drive(kKnee).inject(DeviceFault::overload);
  bench.enable = true;
  bench.run(50);
  EXPECT_EQ(bench.plant.drive(kHip).state(), DeviceState::enabled);
  EXPECT_EQ(bench.replies_in_a_tick(kHip), 1);
  bench.enable = false;
  bench.run(5);
  bench.enable = true;
  bench.run(60);  // set up again
  EXPECT_EQ(bench.replies_in_a_tick(kHip), 0);
}

TEST(ScenarioPlayer, ABusDropLosesCommandsAndAnswersOfAll) {
  Bench bench("  - { at: 0 ms, bus: can0, drop: 0.5 }\n");
  bench.run(200);
  EXPECT_NEAR(bench.replies(kHip), 50, 25) << "both ways";
  EXPECT_NEAR(bench.replies(kKnee), 50, 25);
}

TEST(ScenarioPlayer, ARivalTakesTheCommandAwayAndDoublesTheReplies) {
  Bench bench("  - { at: 100 ms, joint: hip, fault: foreign_commands, for: 20 ms }\n");
  bench.run(100);
  bench.torque = 1;
  bench.run(10);
  EXPECT_EQ(bench.replies_in_a_tick(kHip), 2);
  EXPECT_EQ(bench.replies_in_a_tick(kKnee), 1);
  EXPECT_GE(bench.strange_frames, 12U) << "it asks for settings too";
  const double speed = bench.plant.state().dq[kHip];
  EXPECT_LT(speed, 0.25 * bench.plant.state().dq[kKnee]) << "the last command of a millisecond counts: the rival's";
  bench.run(20);
  const std::size_t in_all = bench.strange_frames;
  bench.run(20);
  EXPECT_EQ(bench.strange_frames, in_all) << "it is gone";
  EXPECT_EQ(bench.plant.drive(kHip).state(), DeviceState::disabled) << "a host takes the power away before it sets up";
}

TEST(ScenarioPlayer, ABabblerFillsTheBusWithAnIdThatIsNobodys) {
  Bench bench("  - { at: 10 ms, bus: can0, fault: babble, for: 10 ms }\n");
  bench.run(15);
  Frames said;
  bench.trouble.speak(said);
  ASSERT_EQ(said.size(), 21U) << "1 Mbit/s * 1 ms / 47 bits";
  EXPECT_EQ(said[0].id, 0U);
  EXPECT_EQ(bench.replies_in_a_tick(kHip), 1) << "drives do not care";
  bench.run(20);
  EXPECT_EQ(bench.strange_frames, 210U);
}

TEST(ScenarioPlayer, ABabblerAvoidsTheIdsOfDrives) {
  config::RobotConfig robot = parse_devices(kDevices, "d").value();
  robot.joints[kHip].drive.reply_id = 0;
  BusTrouble trouble(robot, 0);
  trouble.set({.babble = true});
  Frames said;
  trouble.speak(said);
  ASSERT_FALSE(said.empty());
  EXPECT_EQ(said[0].id, 3U) << "0 is a reply, 1 and 2 are commands";
}

TEST(ScenarioPlayer, OverlappingFaultsAddUpAndEndOneByOne) {
  Bench bench(
      "  - { at: 10 ms, bus: can0, fault: error_passive, for: 30 ms }\n"
      "  - { at: 20 ms, bus: can0, fault: bus_off, for: 10 ms }\n"
      "  - { at: 50 ms, bus: can0, fault: down }\n"
      "  - { at: 10 ms, joint: hip, fault: silent, for: 20 ms }\n"
      "  - { at: 20 ms, joint: hip, fault: silent, for: 20 ms }\n");
  std::vector<BusState> states;
  for (int ms = 0; ms < 60; ms += 10) {
    bench.run(5);
    states.push_back(bench.trouble.faults().state);
    bench.run(5);
  }
  EXPECT_EQ(states, (std::vector<BusState>{BusState::up, BusState::error_passive, BusState::bus_off,
                                           BusState::error_passive, BusState::up, BusState::down}));
  Bench again(
      "  - { at: 10 ms, joint: hip, fault: silent, for: 20 ms }\n"
      "  - { at: 20 ms, joint: hip, fault: silent, for: 20 ms }\n");
  again.run(35);
  EXPECT_EQ(again.replies_in_a_tick(kHip), 0) << "the first is over, the second is not";
  again.run(5);
  EXPECT_EQ(again.replies_in_a_tick(kHip), 1);
}

TEST(ScenarioPlayer, SensorAndBodySufferFromTheirEvents) {
  const config::RobotConfig robot = test::demo_arm();
  RobotPlant plant = RobotPlant::make(robot).value();
  const std::string events =
      "schema: takt.scenario/1\nevents:\n"
      "  - { at: 10 ms, sensor: target, drop: 0.5, for: 20 ms }\n"
      "  - { at: 20 ms, sensor: target, fault: freeze, for: 20 ms }\n"
      "  - { at: 20 ms, sensor: target, burst: 30 ms, for: 20 ms }\n"
      "  - { at: 20 ms, sensor: target, lies: 0.3, for: 20 ms }\n"
      "  - { at: 10 ms, push: 30 N, along: [0, 0, 2], for: 10 ms }\n"
      "  - { at: 15 ms, payload: 2 kg, for: 10 ms }\n"
      "  - { at: 15 ms, friction: 4 }\n"
      "  - { at: 30 ms, friction: 0.5 }\n"
      "  - { after: enabled, at: 0 ms, sensor: target, drop: 1 }\n";
  ScenarioPlayer player(parse_scenario(events, "s", robot).value(), robot, [](const std::string&) {});
  const auto run = [&](int ms) {
    for (int i = 0; i < ms; ++i) {
      player.advance(plant);
      plant.step();
    }
  };
  run(6);
  EXPECT_EQ(player.on_sensor(0).drop, 0);
  EXPECT_EQ(player.on_body().force, 0);
  run(10);  // 15 ms
  EXPECT_EQ(player.on_sensor(0).drop, 0.5);
  EXPECT_EQ(player.on_body().force, 30);
  EXPECT_EQ(player.on_body().towards, (config::Vector3{0, 0, 1}));
  EXPECT_EQ(player.on_body().payload, 2);
  EXPECT_EQ(player.on_body().friction, 4);
  run(10);  // 25 ms
  EXPECT_EQ(player.on_body().force, 0);
  EXPECT_TRUE(player.on_sensor(0).frozen);
  EXPECT_EQ(player.on_sensor(0).burst, milliseconds(30));
  EXPECT_EQ(player.on_sensor(0).lies, 0.3);
  run(20);  // 45 ms
  EXPECT_FALSE(player.on_sensor(0).frozen);
  EXPECT_EQ(player.on_sensor(0).burst.ns, 0);
  EXPECT_EQ(player.on_sensor(0).lies, 0);
  EXPECT_EQ(player.on_body().payload, 0);
  EXPECT_EQ(player.on_body().friction, 2) << "factors multiply";
  EXPECT_EQ(player.on_sensor(0).drop, 0) << "no drive was ever enabled";
}

TEST(ScenarioPlayer, SameSeedSameRun) {
  const auto run = [] {
    Bench bench("  - { at: 10 ms, bus: can0, drop: 0.2 }\n  - { at: 20 ms, joint: hip, drop: 0.2 }\n");
    bench.torque = 0.3F;
    bench.run(300);
    return std::pair(bench.plant.state().q[kHip], std::pair(bench.replies(kHip), bench.replies(kKnee)));
  };
  EXPECT_EQ(run(), run());
}

}  // namespace
}  // namespace takt::simulation

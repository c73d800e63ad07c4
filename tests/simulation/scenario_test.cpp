// SPDX-License-Identifier: Apache-2.0
// Goal: a scenario or devices file is read as written, or refused with a line that says what to correct.
// Method: one table row per mistake with the exact complaint; every example file of config/ is loaded.
#include "simulation/scenario.hpp"

#include <gtest/gtest.h>

#include <filesystem>
#include <ostream>

#include "simulation/devices_file.hpp"
#include "simulation/plant.hpp"
#include "tests/simulation/plant_robots.hpp"
#include "tests/support/files.hpp"

namespace takt::simulation {
namespace {

std::string with_event(std::string_view event) {
  return "schema: takt.scenario/1\nevents:\n  - " + std::string(event) + "\n";
}

TEST(Scenario, EveryKeyIsRead) {
  const auto scenario = parse_scenario(
      "schema: takt.scenario/1\n"
      "events:\n"
      "  - { at: 2 s, joint: elbow, fault: silent, for: 500 ms }\n"
      "  - { after: enabled, at: 0 ms, joint: wrist_roll, error: overload }\n"
      "  - { at: 1 s, joint: elbow, delay: 3 ms }\n"
      "  - { at: 1 s, bus: can1, drop: 0.25 }\n"
      "  - { at: 1 s, bus: can1, fault: down }\n"
      "  - { at: 1 s, sensor: target, burst: 120 ms, for: 1 s }\n"
      "  - { at: 1 s, push: 30 N, along: [0, 3, 4], for: 100 ms }\n"
      "  - { at: 1 s, payload: 1.5 kg }\n"
      "  - { at: 1 s, friction: 4 }\n"
      "  - { at: 1 s, payload: 1 kg, body: forearm }\n"
      "  - { at: 1 s, sensor: target, lies: 0.5 }\n"
      "  - { at: 1 s, joint: elbow, fault: freeze }\n"
      "  - { at: 1 s, joint: elbow, fault: frozen_position }\n"
      "  - { at: 1 s, joint: elbow, fault: reversed }\n"
      "  - { at: 1 s, joint: elbow, fault: wrap }\n"
      "  - { at: 1 s, joint: elbow, jump: -0.3 rad, for: 2 ms }\n"
      "  - { at: 1 s, joint: elbow, scale: 2 }\n",
      "s", test::demo_arm());
  ASSERT_TRUE(scenario.has_value()) << scenario.error();
  ASSERT_EQ(scenario->events.size(), 17U);
  EXPECT_EQ(scenario->events[11].kind, FaultKind::freeze);
  EXPECT_EQ(scenario->events[11].strikes, Target::joint);
  EXPECT_EQ(scenario->events[12].kind, FaultKind::frozen_position);
  EXPECT_EQ(scenario->events[13].kind, FaultKind::reversed);
  EXPECT_EQ(scenario->events[14].kind, FaultKind::wrap);
  EXPECT_EQ(scenario->events[15].kind, FaultKind::jump);
  EXPECT_EQ(scenario->events[15].dose, -0.3);
  EXPECT_EQ(scenario->events[16].kind, FaultKind::scale);
  EXPECT_EQ(scenario->events[16].dose, 2);
  EXPECT_EQ(scenario->events[10].kind, FaultKind::lies);
  EXPECT_EQ(scenario->events[10].dose, 0.5);
  EXPECT_EQ(scenario->events[9].body, "forearm");
  const FaultEvent& silent = scenario->events[0];
  EXPECT_EQ(silent.at, seconds(2));
  EXPECT_FALSE(silent.after_enabled);
  EXPECT_EQ(silent.lasts, milliseconds(500));
  EXPECT_EQ(silent.strikes, Target::joint);
  EXPECT_EQ(silent.target, 2U);
  EXPECT_EQ(silent.kind, FaultKind::silent);
  const FaultEvent& overload = scenario->events[1];
  EXPECT_TRUE(overload.after_enabled);
  EXPECT_FALSE(overload.lasts.has_value());
  EXPECT_EQ(overload.kind, FaultKind::error);
  EXPECT_EQ(overload.error, DeviceFault::overload);
  EXPECT_EQ(scenario->events[2].kind, FaultKind::delay);
  EXPECT_EQ(scenario->events[2].dose, 3e6);
  EXPECT_EQ(scenario->events[3].strikes, Target::bus);
  EXPECT_EQ(scenario->events[3].target, 1U);
  EXPECT_EQ(scenario->events[3].dose, 0.25);
  EXPECT_EQ(scenario->events[4].kind, FaultKind::down);
  const FaultEvent& burst = scenario->events[5];
  EXPECT_EQ(burst.strikes, Target::sensor);
  EXPECT_EQ(burst.kind, FaultKind::burst);
  EXPECT_EQ(burst.dose, 120e6);
  const FaultEvent& push = scenario->events[6];
  EXPECT_EQ(push.strikes, Target::body);
  EXPECT_EQ(push.kind, FaultKind::push);
  EXPECT_EQ(push.dose, 30);
  EXPECT_EQ(push.along, (config::Vector3{0, 0.6, 0.8})) << "a direction";
  EXPECT_EQ(scenario->events[7].kind, FaultKind::payload);
  EXPECT_EQ(scenario->events[7].dose, 1.5);
  EXPECT_EQ(scenario->events[8].kind, FaultKind::friction);
  EXPECT_EQ(scenario->events[8].dose, 4);
}

TEST(Scenario, TextSaysWhatHappens) {
  const auto text = [](std::string_view event) {
    return text_of(parse_scenario(with_event(event), "s", test::demo_arm()).value().events[0]);
  };
  EXPECT_EQ(text("{ at: 0 ms, joint: elbow, error: over_current }"), "over_current");
  EXPECT_EQ(text("{ at: 0 ms, joint: elbow, delay: 3 ms, for: 1 s }"), "delay of 3 ms for 1 s");
  EXPECT_EQ(text("{ at: 0 ms, bus: can0, drop: 0.3 }"), "drop of 30 %");
  EXPECT_EQ(text("{ at: 0 ms, bus: can0, fault: bus_off, for: 10 ms }"), "bus_off for 10 ms");
  EXPECT_EQ(text("{ at: 0 ms, sensor: target, burst: 120 ms }"), "burst of 120 ms");
  EXPECT_EQ(text("{ at: 0 ms, sensor: target, lies: 0.5, for: 1 s }"), "lies of 50 % for 1 s");
  EXPECT_EQ(text("{ at: 0 ms, push: 30 N, along: [1, 0, 0], for: 100 ms }"), "push of 30 N for 100 ms");
  EXPECT_EQ(text("{ at: 0 ms, payload: 1.5 kg }"), "payload of 1.5 kg");
  EXPECT_EQ(text("{ at: 0 ms, friction: 4 }"), "friction times 4");
  EXPECT_EQ(text("{ at: 0 ms, joint: elbow, jump: 0.3 rad, for: 2 ms }"), "jump of 0.3 rad for 2 ms");
  EXPECT_EQ(text("{ at: 0 ms, joint: elbow, scale: 2 }"), "scale times 2");
}

struct Refusal {
  std::string_view when, event, complaint;
  friend void PrintTo(const Refusal& refusal, std::ostream* out) { *out << refusal.when; }
};
class RefusedEvent : public testing::TestWithParam<Refusal> {};

TEST_P(RefusedEvent, SaysWhereAndWhy) {
  const auto scenario = parse_scenario(with_event(GetParam().event), "s", test::demo_arm());
  ASSERT_FALSE(scenario.has_value());
  EXPECT_EQ(scenario.error(), GetParam().complaint);
}

INSTANTIATE_TEST_SUITE_P(
    Table, RefusedEvent,
    testing::Values(
        Refusal{"no begin", "{ joint: elbow, fault: silent }",
                "s:3:5: key `at` is missing in `events[0]`; add it: when it begins"},
        Refusal{"no unit", "{ at: 2, joint: elbow, fault: silent }",
                "s:3:11: events[0].at: 2 has no unit; write `2 ms` or `2 s`"},
        Refusal{"a length of nothing", "{ at: 2 s, joint: elbow, fault: silent, for: 0 ms }",
                "s:3:50: events[0].for: 0 ms is out of range; write at least 1 us and at most 1000000 s"},
        Refusal{"an unknown key", "{ at: 2 s, joint: elbow, fault: silent, fore: 1 s }",
                "s:3:45: unknown key `fore` in `events[0]`; did you mean `for`?"},
        Refusal{"an unknown joint", "{ at: 2 s, joint: elbov, fault: silent }",
                "s:3:23: events[0].joint: joint `elbov` is not known; did you mean `elbow`?"},
        Refusal{"an unknown bus", "{ at: 2 s, bus: can7, fault: down }",
                "s:3:21: events[0].bus: bus `can7` is not known; write one of: can0, can1"},
        Refusal{"an unknown fault", "{ at: 2 s, joint: elbow, fault: silence }",
                "s:3:37: events[0].fault: fault `silence` is not known; did you mean `silent`?"},
        Refusal{"an unknown error", "{ at: 2 s, joint: elbow, error: over_heat }",
                "s:3:37: events[0].error: error `over_heat` is not known; write one of: over_temperature, "
                "over_current, over_voltage, under_voltage, encoder, overload"},
        Refusal{"an unknown instant", "{ at: 2 s, after: armed, joint: elbow, fault: silent }",
                "s:3:23: events[0].after: instant `armed` is not known; write one of: start, enabled"},
        Refusal{"no target", "{ at: 2 s, fault: silent }",
                "s:3:5: events[0]: strikes nothing; write `joint: NAME`, `bus: NAME` or `sensor: NAME`"},
        Refusal{"two targets", "{ at: 2 s, joint: elbow, bus: can0, drop: 0.1 }",
                "s:3:35: events[0].bus: the event names a joint already; keep one of the two"},
        Refusal{"no fault", "{ at: 2 s, joint: elbow }",
                "s:3:5: events[0]: has no fault; write one of: fault, error, delay, drop, jump, scale, burst, lies, "
                "push, payload, friction"},
        Refusal{"two faults", "{ at: 2 s, joint: elbow, fault: repeat, drop: 0.1 }",
                "s:3:5: events[0]: has 2 faults at once; write an event for each"},
        Refusal{"a drive's fault on a bus", "{ at: 2 s, bus: can0, fault: deaf }",
                "s:3:34: events[0].fault: `deaf` strikes a drive, not a bus; write `joint: NAME`"},
        Refusal{"a drive's error on a bus", "{ at: 2 s, bus: can0, error: overload }",
                "s:3:34: events[0].error: `error` strikes a drive, not a bus; write `joint: NAME`"},
        Refusal{"a bus's fault on a drive", "{ at: 2 s, joint: elbow, fault: bus_off }",
                "s:3:37: events[0].fault: `bus_off` strikes a bus, not a drive; write `bus: NAME`"},
        Refusal{"an error with an end", "{ at: 2 s, joint: elbow, error: overload, for: 1 s }",
                "s:3:52: events[0].for: a drive keeps its error until the host clears it; leave `for` out"},
        Refusal{"a bus that comes back", "{ at: 2 s, bus: can0, fault: down, for: 1 s }",
                "s:3:45: events[0].for: a bus that is down stays down; leave `for` out"},
        Refusal{"an error the protocol cannot say", "{ at: 2 s, joint: elbow, error: encoder }",
                "s:3:37: events[0].error: elbow's drive (mit, damiao) has no code for encoder; choose another error"},
        Refusal{"a loss beyond all", "{ at: 2 s, joint: elbow, drop: 1.5 }",
                "s:3:36: events[0].drop: 1.5 is out of range; write above 0 and at most 1"},
        Refusal{"a loss of nothing", "{ at: 2 s, joint: elbow, drop: 0 }",
                "s:3:36: events[0].drop: 0 is out of range; write above 0 and at most 1"},
        Refusal{"a sensor's fault on a drive", "{ at: 2 s, joint: elbow, lies: 0.5 }",
                "s:3:36: events[0].lies: `lies` strikes a sensor, not a drive; write `sensor: NAME`"},
        Refusal{"a bus's fault on a sensor", "{ at: 2 s, sensor: target, fault: down }",
                "s:3:39: events[0].fault: `down` strikes a bus, not a sensor; write `bus: NAME`"},
        Refusal{"an unknown sensor", "{ at: 2 s, sensor: targe, drop: 0.5 }",
                "s:3:24: events[0].sensor: sensor `targe` is not known; did you mean `target`?"},
        Refusal{"a body that is not pushed", "{ at: 2 s, friction: 2, body: forearm }",
                "s:3:35: events[0].body: only a push and a payload strike a body; leave it out"},
        Refusal{"a push at a joint", "{ at: 2 s, joint: elbow, push: 30 N, along: [1, 0, 0] }",
                "s:3:36: events[0].push: `push` strikes the robot's body, not a drive; leave `joint` out"},
        Refusal{"a push to nowhere", "{ at: 2 s, push: 30 N }",
                "s:3:5: events[0]: pushes nowhere; write `along: [x, y, z]`"},
        Refusal{"a direction of nothing", "{ at: 2 s, payload: 1 kg, along: [1, 0, 0] }",
                "s:3:38: events[0].along: only a push has a direction; leave it out"},
        Refusal{"too long a delay", "{ at: 2 s, joint: elbow, delay: 2 s }",
                "s:3:37: events[0].delay: 2 s is out of range; write at least 1 us and at most 1 s"}),
    [](const testing::TestParamInfo<Refusal>& row) {
      std::string name(row.param.when);
      for (char& c : name)
        if (!std::isalnum(static_cast<unsigned char>(c))) c = '_';
      return name;
    });

TEST(Scenario, FilesThatAreNoScenario) {
  const config::RobotConfig robot = test::demo_arm();
  EXPECT_EQ(parse_scenario("", "s", robot).error(), "s: holds no scenario; begin with `schema: takt.scenario/1`");
  EXPECT_EQ(parse_scenario("schema: takt.robot/1\nevents: []\n", "s", robot).error(),
            "s:1:9: is a robot file (takt.robot/1), not a scenario; check it: takt config check s");
  EXPECT_EQ(load_scenario("no/such.yaml", robot).error(),
            "no/such.yaml: cannot be read: No such file or directory; check the path");
}

TEST(Scenario, EveryExampleFitsAndTheirFolderIsNamed) {
  EXPECT_NE(test::text_of("docs/plant-scenarios.md").find("(../config/scenarios)"), std::string::npos);
  std::size_t count = 0;
  for (const auto& entry : std::filesystem::directory_iterator("config/scenarios")) {
    const auto scenario = load_scenario(entry.path().string(), test::demo_arm());
    EXPECT_TRUE(scenario.has_value()) << scenario.error();
    ++count;
  }
  EXPECT_EQ(count, 11U) << "one per class of faults";
}

constexpr std::string_view kDevices =
    "schema: takt.devices/1\n"
    "buses:\n"
    "  - { name: can0, interface: can0 }\n"
    "devices:\n"
    "  - name: hip\n"
    "    bus: can0\n"
    "    drive: { protocol: mit, variant: damiao, model: DM8009, id: 1, reply_id: 0x11, gear_ratio: 2 }\n"
    "    inertia: 0.05 kgm2\n"
    "    position: 0.5 rad\n"
    "  - { name: knee, bus: can0, drive: { protocol: mit, variant: tmotor, model: AK10-9, id: 2, reply_id: 0x12, "
    "position_after_power_up: absolute }, "
    "inertia: 0.01 kgm2 }\n";

std::string devices_with(std::string_view from, std::string_view to) {
  std::string text(kDevices);
  text.replace(text.find(from), from.size(), to);
  return text;
}

TEST(Devices, BecomeARobotOfDrivesOnly) {
  const auto robot = parse_devices(kDevices, "d");
  ASSERT_TRUE(robot.has_value()) << robot.error();
  ASSERT_EQ(robot->joints.size(), 2U);
  EXPECT_EQ(robot->joints[0].name, "hip");
  EXPECT_EQ(robot->joints[0].inertia, 0.05);
  EXPECT_EQ(robot->joints[0].home, 0.5);
  EXPECT_EQ(robot->joints[0].limits.torque, 2 * robot->joints[0].drive.torque_range) << "what its brake holds";
  EXPECT_EQ(robot->joints[1].home, 0);
  EXPECT_EQ(robot->simulation->step, milliseconds(1));
  EXPECT_EQ(robot->simulation->drive_watchdog, milliseconds(100));
  auto plant = Plant::on_free_inertias(*robot);
  ASSERT_TRUE(plant.has_value()) << plant.error();
  EXPECT_EQ(plant->state().q[0], 0.5);
}

TEST(Devices, AreRefusedByTheNamesTheirFileUses) {
  const auto complaint = [](const std::string& text) { return parse_devices(text, "d").error(); };
  EXPECT_EQ(complaint(devices_with("id: 2,", "id: 1,")),
            "d:10:90: devices[1].drive.id: CAN id 0x1 is already hip's on bus can0; give each drive its own");
  EXPECT_EQ(complaint(devices_with("inertia: 0.05 kgm2", "inertia: 0 kgm2")),
            "d:8:14: devices[0].inertia: 0 kgm2 is out of range; write above 0 kgm2 and at most 10000 kgm2");
  EXPECT_EQ(complaint(devices_with("    position: 0.5 rad\n", "    stiffness: 5\n")),
            "d:9:5: unknown key `stiffness` in `devices[0]`; known here: name, bus, drive, inertia, position");
  EXPECT_EQ(complaint(devices_with("takt.devices/1", "takt.robot/1")),
            "d:1:9: is a robot file (takt.robot/1), not a devices file; check it: takt config check d");
  EXPECT_EQ(complaint(""), "d: holds no devices; begin with `schema: takt.devices/1`");
}

TEST(Devices, HaveNoBodyToPush) {
  const auto robot = parse_devices(kDevices, "d");
  EXPECT_EQ(parse_scenario(with_event("{ at: 2 s, payload: 1 kg }"), "s", robot.value()).error(),
            "s:3:5: events[0]: `payload` strikes the robot's body, and devices on flywheels have none");
}

TEST(Devices, TheExampleFits) {
  const auto robot = load_devices("config/devices.yaml");
  EXPECT_TRUE(robot.has_value()) << robot.error();
}

}  // namespace
}  // namespace takt::simulation

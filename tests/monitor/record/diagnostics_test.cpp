// SPDX-License-Identifier: Apache-2.0
// Goal: what is wrong with the robot shows in ROS 2's diagnostics at the part it is wrong with, and nowhere else.
// Method: one healthy record, spoilt in one place at a time.
#include "monitor/record/diagnostics.hpp"

#include <gtest/gtest.h>

#include <algorithm>
#include <functional>

#include "tests/monitor/record/virtual_robot.hpp"

namespace takt::monitor {
namespace {

struct Ailment {
  const char* when;
  std::function<void(TickRecord&)> spoil;
  std::string part;
  Level level;
  std::string message;
  friend void PrintTo(const Ailment& ailment, std::ostream* out) { *out << ailment.when; }
};

TickRecord healthy_record() {
  VirtualRobot robot;
  robot.run(500);
  TickRecord record = robot.latest();
  record.header.bus_count = static_cast<std::uint8_t>(demo_robot().buses.size());
  return record;
}

std::vector<Diagnostic> parts_of(const TickRecord& record) {
  return diagnose(record, RobotStatus{.tick = record.header}, demo_robot());
}

class EveryAilment : public testing::TestWithParam<Ailment> {};

TEST_P(EveryAilment, ShowsAtItsPartOnly) {
  TickRecord record = healthy_record();
  GetParam().spoil(record);
  const auto parts = parts_of(record);
  for (const Diagnostic& part : parts) {
    if (part.name == GetParam().part) {
      EXPECT_EQ(part.level, GetParam().level);
      EXPECT_EQ(part.message, GetParam().message);
    } else {
      EXPECT_EQ(part.level, Level::ok) << part.name << ": " << part.message;
    }
  }
  EXPECT_TRUE(std::ranges::any_of(parts, [](const Diagnostic& part) { return part.name == GetParam().part; }));
}

INSTANTIATE_TEST_SUITE_P(
    Diagnostics, EveryAilment,
    testing::Values(
        Ailment{"a drive's fault",
                [](TickRecord& record) {
                  record.joints[2].feedback.drive_state = DriveState::fault;
                  record.joints[2].feedback.error_code = 0xB;
                },
                "arm6: joint elbow", Level::error, "output stage over-temperature"},
        Ailment{"a fault without a code",
                [](TickRecord& record) { record.joints[0].feedback.drive_state = DriveState::fault; },
                "arm6: joint base_yaw", Level::error, "the drive reports a fault"},
        Ailment{
            "a silent drive",
            [](TickRecord& record) { record.joints[1].feedback.received_at = record.header.now - milliseconds(250); },
            "arm6: joint shoulder", Level::stale, "silent for 250.0 ms"},
        Ailment{"a joint that is held",
                [](TickRecord& record) {
                  record.joints[2].behind = 1;
                  record.joints[2].q_reference = record.joints[2].q_estimate + 0.25F;
                },
                "arm6: joint elbow", Level::warn,
                "0.250 rad from its reference, more than 90 % of limits.torque (30.0 Nm) allows, for 500 ms: held, "
                "blocked, or too weak"},
        Ailment{"a drive never heard", [](TickRecord& record) { record.joints[5].feedback.received_at = {}; },
                "arm6: joint wrist_yaw", Level::stale, "never answered"},
        Ailment{"a bus off", [](TickRecord& record) { record.header.buses[1].state = BusState::bus_off; },
                "arm6: bus can1", Level::error, "bus_off"},
        Ailment{"a noisy bus", [](TickRecord& record) { record.header.buses[0].state = BusState::error_passive; },
                "arm6: bus can0", Level::warn, "error_passive"},
        Ailment{"a degraded robot", [](TickRecord& record) { record.header.mode = Mode::degraded; }, "arm6: executive",
                Level::warn, "degraded"},
        Ailment{"a latched fault", [](TickRecord& record) { record.header.mode = Mode::fault_latched; },
                "arm6: executive", Level::error, "fault_latched"}));

TEST(Diagnostics, AHealthyRobotHasAPartForEverything) {
  const auto parts = parts_of(healthy_record());
  ASSERT_EQ(parts.size(), 1 + demo_robot().joints.size() + demo_robot().buses.size());
  for (const Diagnostic& part : parts) EXPECT_EQ(part.level, Level::ok) << part.name << ": " << part.message;
}

TEST(Diagnostics, TheCauseOfTheLastChangeIsNamedWithItsPlace) {
  const TickRecord record = healthy_record();
  const RobotStatus status{
      .tick = record.header, .cause = Cause::drive_fault, .detail = "joint elbow: over-temperature"};
  const Diagnostic executive = diagnose(record, status, demo_robot()).front();
  EXPECT_EQ(executive.message, "tracking: drive_fault: joint elbow: over-temperature");
}

}  // namespace
}  // namespace takt::monitor

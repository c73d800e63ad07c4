// SPDX-License-Identifier: Apache-2.0
// Goal: whatever a scenario lets go wrong with a drive or a bus, the executive names the cause, latches, and leaves
// evidence that replays bit for bit.
// Method: real processes on the loopback bus, tracking with the demo policy; the fault strikes shortly after the drives
// were enabled, in the plant's own time; the run folder is judged afterwards.
#include <gtest/gtest.h>
#include <signal.h>

#include <fstream>
#include <ostream>
#include <string>

#include "tests/process/running_robot.hpp"
#include "tests/support/files.hpp"

namespace takt::test {
namespace {

using Causes = std::uint64_t;
constexpr Causes only(Cause cause) {
  return Causes{1} << static_cast<unsigned>(cause);
}
constexpr Causes kFaults = only(Cause::feedback_lost) | only(Cause::drive_fault) | only(Cause::drive_disabled) |
                           only(Cause::bus_off) | only(Cause::bus_down);

struct Case {
  const char* when;
  const char* event;
  const char* transition;  // in transitions.jsonl
  Causes afterwards;       // of kFaults, what still holds when the fault itself is over
  friend void PrintTo(const Case& row, std::ostream* out) { *out << row.when; }
};

class ScenarioRun : public testing::TestWithParam<Case> {
 protected:
  static std::string file_with(const Case& row) {
    const std::string path = testing::TempDir() + "takt-" + row.when + ".yaml";
    std::ofstream(path) << "schema: takt.scenario/1\nevents:\n  - { after: enabled, at: 200 ms, " << row.event
                        << " }\n";
    return path;
  }
};

TEST_P(ScenarioRun, EndsInALatchedFaultThatNamesItsCause) {
  const Case& row = GetParam();
  RunningRobot robot(file_with(row));
  const Child policy = robot.start_policy_host();
  ASSERT_EQ(robot.arm(), "") << robot.logs();
  ASSERT_TRUE(robot.wait_for_mode(Mode::fault_latched)) << robot.logs();
  const auto settled = robot.wait_until(
      [&row](const StatusSnapshot& status) { return (status.tick.causes_active & kFaults) == row.afterwards; });
  ASSERT_TRUE(settled.has_value()) << robot.logs();
  EXPECT_EQ(settled->status.tick.causes_active & kFaults, row.afterwards) << robot.logs();
  EXPECT_EQ(settled->status.tick.mode, Mode::fault_latched) << "nothing but the operator clears it";

  ASSERT_TRUE(robot.finish()) << robot.logs();
  const std::string transitions = text_of(robot.run_directory() + "/transitions.jsonl");
  EXPECT_NE(transitions.find(row.transition), std::string::npos) << transitions << robot.logs();
  Child replay({"takt", "replay", robot.run_directory()}, robot.directory() + "/replay.log");
  EXPECT_EQ(replay.wait(std::chrono::seconds(60)), 0) << text_of(robot.directory() + "/replay.log");
}

constexpr const char* kFeedbackLost = R"("to":"fault_latched","cause":"feedback_lost")";

INSTANTIATE_TEST_SUITE_P(
    EveryFault, ScenarioRun,
    testing::Values(Case{"silent", "joint: elbow, fault: silent, for: 600 ms", kFeedbackLost, 0},
                    Case{"over_temperature", "joint: elbow, error: over_temperature",
                         R"("to":"fault_latched","cause":"drive_fault")", 0},
                    // It boots, and is not enabled again behind the operator's back: its power was taken away.
                    Case{"power_cycle", "joint: elbow, fault: power_cycle, for: 600 ms", kFeedbackLost, 0},
                    // A drive that hears nothing has nothing to answer; heard again, it is told to de-energise, which
                    // clears its error.
                    Case{"deaf", "joint: elbow, fault: deaf, for: 900 ms", kFeedbackLost, 0},
                    Case{"bus_off", "bus: can0, fault: bus_off, for: 50 ms",
                         R"("to":"fault_latched","cause":"bus_off")", 0},
                    Case{"bus_down", "bus: can1, fault: down", R"("to":"fault_latched","cause":"bus_down")",
                         only(Cause::bus_down) | only(Cause::feedback_lost)}),
    [](const testing::TestParamInfo<Case>& row) { return std::string(row.param.when); });

TEST(ForeignCommands, AreCountedOnTheirBusAndOnNoOther) {
  const std::string path = testing::TempDir() + "takt-rival.yaml";
  std::ofstream(path) << "schema: takt.scenario/1\nevents:\n"
                         "  - { after: enabled, at: 100 ms, joint: wrist_yaw, fault: foreign_commands, for: 20 ms }\n";
  RunningRobot robot(path);
  const Child policy = robot.start_policy_host();
  ASSERT_EQ(robot.arm(), "") << robot.logs();
  const auto status = robot.wait_until([](const StatusSnapshot& s) { return s.tick.buses[1].foreign_frames >= 20; });
  ASSERT_TRUE(status.has_value());
  EXPECT_GE(status->status.tick.buses[1].foreign_frames, 20U) << robot.logs();
  EXPECT_EQ(status->status.tick.buses[0].foreign_frames, 0U);
  ASSERT_TRUE(robot.finish()) << robot.logs();
}

TEST(RefusedScenario, PlantSaysWhereAndStartsNothing) {
  const std::string path = testing::TempDir() + "takt-refused.yaml";
  std::ofstream(path) << "schema: takt.scenario/1\nevents:\n  - { at: 2 s, joint: elbov, fault: silent }\n";
  const std::string log = testing::TempDir() + "takt-refused.log";
  std::ofstream(log, std::ios::trunc).close();
  Child plant({"takt-plant", "--robot", "config/arm6.yaml", "--runtime-dir", testing::TempDir(), "--scenario", path},
              log);
  EXPECT_EQ(plant.wait(std::chrono::seconds(20)), 65);
  EXPECT_EQ(text_of(log), path + ":3:23: events[0].joint: joint `elbov` is not known; did you mean `elbow`?\n");
}

}  // namespace
}  // namespace takt::test

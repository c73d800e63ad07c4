// Goal: a robot of twelve joints on four buses with drives of all five protocols runs the demo policy, and whichever of
// its drives fails, the cause is named with its joint and in its protocol's words.
// Method: real processes on the loopback buses; per case one drive's fault strikes 300 ms after it was first enabled.
#include <gtest/gtest.h>

#include <fstream>
#include <iterator>
#include <nlohmann/json.hpp>
#include <ostream>
#include <string>

#include "tests/process/running_robot.hpp"

namespace takt::test {
namespace {

constexpr char kRobot[] = "config/dual_arm12.yaml";

struct Case {
  const char* joint;
  const char* fault;
  const char* said;  // by the drive
  friend void PrintTo(const Case& row, std::ostream* out) { *out << row.joint; }
};

// The line of transitions.jsonl that led to this mode.
nlohmann::json transition_to(const std::string& mode, const std::string& run_directory) {
  std::ifstream file(run_directory + "/transitions.jsonl");
  for (std::string line; std::getline(file, line);) {
    auto json = nlohmann::json::parse(line);
    if (json.at("to") == mode) return json;
  }
  return {};
}

class MixedDrives : public testing::TestWithParam<Case> {
 protected:
  static std::string scenario_of(const Case& row) {
    const std::string path = testing::TempDir() + "takt-mixed-" + row.joint + ".yaml";
    std::ofstream(path) << "schema: takt.scenario/1\nevents:\n  - { after: enabled, at: 300 ms, joint: " << row.joint
                        << ", error: " << row.fault << " }\n";
    return path;
  }
};

TEST_P(MixedDrives, AFailingDriveIsNamedInItsOwnWords) {
  const Case& row = GetParam();
  RunningRobot robot(scenario_of(row), kRobot);
  const Child policy = robot.start_policy_host();
  ASSERT_EQ(robot.arm(), "") << robot.logs();
  ASSERT_TRUE(robot.wait_for_mode(Mode::fault_latched)) << robot.logs();
  ASSERT_TRUE(robot.finish()) << robot.logs();
  const auto transition = transition_to("fault_latched", robot.run_directory());
  ASSERT_FALSE(transition.is_null()) << robot.logs();
  EXPECT_EQ(transition.at("cause"), "drive_fault");
  EXPECT_EQ(transition.at("detail"), "joint " + std::string(row.joint) + ": " + row.said);
  EXPECT_FALSE(transition_to("tracking", robot.run_directory()).is_null()) << "it never tracked: nothing was tested";
}

INSTANTIATE_TEST_SUITE_P(EveryJoint, MixedDrives,
                         testing::Values(Case{"left_base_yaw", "over_current", "over-current"},
                                         Case{"left_shoulder", "overload", "overload"},
                                         Case{"left_elbow", "over_temperature", "over-temperature"},
                                         Case{"left_wrist_roll", "over_temperature", "over-temperature"},
                                         Case{"left_wrist_pitch", "under_voltage", "DC bus under-voltage"},
                                         Case{"left_wrist_yaw", "over_voltage", "DC bus over-voltage"},
                                         Case{"right_base_yaw", "over_current", "over-current"},
                                         Case{"right_shoulder", "under_voltage", "under-voltage"},
                                         Case{"right_elbow", "over_temperature", "inverter over-temperature"},
                                         Case{"right_wrist_roll", "encoder", "encoder fault"},
                                         Case{"right_wrist_pitch", "over_voltage", "over-voltage"},
                                         Case{"right_wrist_yaw", "over_temperature", "over-temperature"}),
                         [](const testing::TestParamInfo<Case>& row) { return std::string(row.param.joint); });

TEST(MixedDrivesRun, ReplaysBitForBit) {
  RunningRobot robot({}, kRobot);
  const Child policy = robot.start_policy_host();
  ASSERT_EQ(robot.arm(), "") << robot.logs();
  ASSERT_TRUE(robot.wait_for_mode(Mode::tracking)) << robot.logs();
  const auto status = robot.status();
  ASSERT_TRUE(status.has_value());
  const std::uint64_t until = status->status.ticks + 2000;
  const auto later = robot.wait_until([until](const StatusSnapshot& s) { return s.ticks >= until; });
  ASSERT_TRUE(later.has_value());
  EXPECT_EQ(later->status.tick.mode, Mode::tracking) << robot.logs();
  ASSERT_TRUE(robot.finish()) << robot.logs();
  Child replay({"takt", "replay", robot.run_directory()}, robot.directory() + "/replay.log");
  EXPECT_EQ(replay.wait(std::chrono::seconds(60)), 0) << robot.logs();
}

}  // namespace
}  // namespace takt::test

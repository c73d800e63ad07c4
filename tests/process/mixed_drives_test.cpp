// SPDX-License-Identifier: Apache-2.0
// Goal: a robot of twelve joints on four buses with drives of all five protocols runs the demo policy, and whichever of
// its drives fails, the cause is named with its joint and in its protocol's words, by the run and by its report.
// Method: real processes on the loopback buses; per case one drive's fault strikes 800 ms after it was first enabled.
#include <gtest/gtest.h>

#include <fstream>
#include <iterator>
#include <map>
#include <nlohmann/json.hpp>
#include <ostream>
#include <string>

#include "tests/process/running_robot.hpp"

namespace takt::test {
namespace {

constexpr char kRobot[] = "config/dual_arm12.yaml";

struct Case {
  const char* joint;
  const char* event;  // of the scenario
  const char* cause;
  const char* said;  // how the detail begins, after the joint's name
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

// Every drive was as the robot file says, and told who it is as far as its protocol can.
void expect_a_card_per_drive(const nlohmann::json& cards) {
  const std::map<std::string, nlohmann::json> firmware{
      {"mit", "5013"}, {"odrive", "0.6.10"}, {"moteus", "0.3.8"}, {"cia402", "00010002"}, {"robstride", nullptr}};
  ASSERT_EQ(cards.at("drives").size(), 12U);
  int waived = 0;
  for (const auto& drive : cards.at("drives")) {
    const std::string protocol = drive.at("protocol");
    for (const auto& fact : drive.at("facts")) {
      EXPECT_NE(fact.at("verdict"), "differs") << drive;
      waived += fact.at("verdict") == "waived" ? 1 : 0;
      const bool says_nothing = protocol == "mit" && !drive.at("watchdog_waiver").is_null();  // T-Motor
      if (fact.at("fact") != "firmware") continue;
      const bool is_text = fact.at("source") == "object 100A:00";  // beside CiA 402's revision number
      const nlohmann::json told = is_text ? nlohmann::json("takt-plant 1.4.2") : firmware.at(protocol);
      EXPECT_EQ(fact.at("value"), says_nothing ? nlohmann::json() : told) << drive;
    }
  }
  EXPECT_EQ(waived, 4);
}

class MixedDrives : public testing::TestWithParam<Case> {
 protected:
  static std::string scenario_of(const Case& row) {
    const std::string path = testing::TempDir() + "takt-mixed-" + row.joint + ".yaml";
    std::ofstream(path) << "schema: takt.scenario/1\nevents:\n  - { after: enabled, at: 800 ms, joint: " << row.joint
                        << ", " << row.event << " }\n";
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
  EXPECT_EQ(transition.at("cause"), row.cause);
  const auto detail = transition.at("detail").get<std::string>();
  EXPECT_TRUE(detail.starts_with("joint " + std::string(row.joint) + ": " + row.said)) << detail;
  const auto from = transition.at("from").get<std::string>();
  EXPECT_TRUE(from == "tracking" || from == "degraded") << from << ": it did not move: nothing was tested";
  const std::string log = robot.directory() + "/report.log";
  Child report({"takt", "report", robot.run_directory()}, log);
  ASSERT_EQ(report.wait(std::chrono::seconds(60)), 0) << robot.logs();
  std::string line;
  std::ifstream told(log);
  for (int number = 0; number < 2; ++number) std::getline(told, line);
  EXPECT_TRUE(line.starts_with("STOPPED")) << line;
  EXPECT_NE(line.find("joint " + std::string(row.joint) + ": " + row.said), std::string::npos) << line;
}

INSTANTIATE_TEST_SUITE_P(
    EveryJoint, MixedDrives,
    testing::Values(Case{"left_base_yaw", "error: over_current", "drive_fault", "over-current"},
                    Case{"left_shoulder", "error: overload", "drive_fault", "overload"},
                    // Six bytes of reply have no room for an error: such a drive can only fall silent.
                    Case{"left_elbow", "fault: silent, for: 800 ms", "feedback_lost", "silent for"},
                    Case{"left_wrist_roll", "error: over_temperature", "drive_fault", "over-temperature"},
                    Case{"left_wrist_pitch", "error: under_voltage", "drive_fault", "bus under-voltage"},
                    Case{"left_wrist_yaw", "error: over_voltage", "drive_fault", "bus over-voltage"},
                    Case{"right_base_yaw", "error: over_current", "drive_fault", "over-current"},
                    Case{"right_shoulder", "error: under_voltage", "drive_fault", "under-voltage of the supply"},
                    Case{"right_elbow", "error: over_temperature", "drive_fault", "motor over-temperature"},
                    Case{"right_wrist_roll", "error: encoder", "drive_fault", "encoder fault"},
                    Case{"right_wrist_pitch", "error: over_voltage", "drive_fault", "over-voltage"},
                    Case{"right_wrist_yaw", "error: over_temperature", "drive_fault", "over-temperature"}),
    [](const testing::TestParamInfo<Case>& row) { return std::string(row.param.joint); });

TEST(MixedDrivesRun, ReplaysBitForBit) {
  RunningRobot robot({}, kRobot);
  const Child policy = robot.start_policy_host();
  ASSERT_EQ(robot.arm(), "") << robot.logs();
  ASSERT_TRUE(robot.wait_for_mode(Mode::tracking)) << robot.logs();
  robot.let_run(2000);
  ASSERT_TRUE(robot.wait_for_mode(Mode::tracking)) << robot.logs();
  ASSERT_TRUE(robot.finish()) << robot.logs();
  // One T-Motor drive and three ODrives do not tell their time-outs: the run says with which excuse it was armed.
  const auto manifest = nlohmann::json::parse(std::ifstream(robot.run_directory() + "/manifest.json"));
  EXPECT_EQ(manifest.at("watchdog_waivers").size(), 4U);
  expect_a_card_per_drive(manifest.at("drives"));
  EXPECT_EQ(nlohmann::json::parse(std::ifstream(robot.run_directory() + "/drives.json")), manifest.at("drives"));
  Child replay({"takt", "replay", robot.run_directory()}, robot.directory() + "/replay.log");
  EXPECT_EQ(replay.wait(std::chrono::seconds(60)), 0) << robot.logs();
}

}  // namespace
}  // namespace takt::test

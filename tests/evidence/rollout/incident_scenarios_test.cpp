// SPDX-License-Identifier: Apache-2.0
// Goal: for every scenario that comes with Takt, the incident names the joint or bus that the scenario strikes, and
// what it did to it. Method: the demo arm, and the robot with drives of all five protocols, each of its joints in turn,
// in virtual time: the real decision, the real drivers, the simulated drives, a policy that holds the arm at home;
// buses and camera suffer what the scenario says of them.
#include <gtest/gtest.h>

#include <filesystem>
#include <fstream>
#include <regex>
#include <set>

#include "tests/evidence/rollout/scenario_run.hpp"
#include "tests/support/files.hpp"

namespace takt::lab {
namespace {

using test::arm6;
using test::dual_arm12;
using test::ScenarioRun;

struct Told {
  const char* scenario;
  const char* where;
  const char* words;  // in the sentence
};
constexpr Told kTold[] = {
    {"bad_line", "joint elbow", "more replies than commands"},
    {"bus_down", "bus can1", "down or gone"},
    {"bus_errors", "bus can0", "error-passive"},
    {"crowded_bus", "bus can0", "more frames than our drives say"},
    {"deaf_drive", "joint elbow", "silent for"},
    {"drive_error", "joint elbow", "over-temperature"},
    {"poor_sight", "", "no usable command came"},
    {"power_cycle", "joint elbow", "silent for"},
    {"rival", "bus can0", "frames foreign"},
    {"silent_drive", "joint elbow", "silent for"},
};

TEST(IncidentScenarios, EverySentenceNamesThePlaceAndTheFault) {
  for (const Told& told : kTold) {
    SCOPED_TRACE(told.scenario);
    const auto incident = ScenarioRun(arm6(), "config/scenarios/" + std::string(told.scenario) + ".yaml").run();
    ASSERT_TRUE(incident);
    EXPECT_EQ(incident->where, told.where);
    EXPECT_NE(incident->sentence.find(told.words), std::string::npos);
    EXPECT_FALSE(incident->asked);
  }
}

// A scenario that comes with Takt, struck at another joint, and at that joint's bus.
std::string struck_at(const char* scenario, const config::Joint& joint) {
  const std::string text = takt::test::text_of("config/scenarios/" + std::string(scenario) + ".yaml");
  const std::string path = testing::TempDir() + scenario + "-" + joint.name + ".yaml";
  std::ofstream(path) << std::regex_replace(
      std::regex_replace(text, std::regex("joint: elbow"), "joint: " + joint.name), std::regex("bus: can[01]"),
      "bus: " + dual_arm12().buses[joint.bus].name);
  return path;
}

std::string words_of(const Told& told, const config::Joint& joint) {
  // An ODrive goes on telling where it is, so it is heard to say that it misses its commands.
  const bool tells_anyway = joint.drive.protocol == config::DriveProtocol::odrive;
  return std::string_view(told.scenario) == "deaf_drive" && tells_anyway ? "command watchdog expired" : told.words;
}

// Six bytes of reply have no room for an error.
bool can_tell(const Told& told, const config::Joint& joint) {
  return std::string_view(told.scenario) != "drive_error" || joint.drive.variant != "tmotor";
}

class MixedDriveScenarios : public testing::TestWithParam<std::size_t> {};

TEST_P(MixedDriveScenarios, EverySentenceNamesThePlaceAndTheFault) {
  const config::Joint& joint = dual_arm12().joints[GetParam()];
  for (const Told& told : kTold) {
    SCOPED_TRACE(told.scenario);
    const auto incident = ScenarioRun(dual_arm12(), struck_at(told.scenario, joint)).run();
    ASSERT_EQ(incident.has_value(), can_tell(told, joint));
    if (!incident) continue;
    const std::string_view kind = std::string_view(told.where).substr(0, std::string_view(told.where).find(' '));
    EXPECT_EQ(incident->where, kind == "joint" ? "joint " + joint.name
                               : kind == "bus" ? "bus " + dual_arm12().buses[joint.bus].name
                                               : "");
    EXPECT_NE(incident->sentence.find(words_of(told, joint)), std::string::npos) << incident->sentence;
    EXPECT_FALSE(incident->asked);
  }
}

INSTANTIATE_TEST_SUITE_P(EveryJoint, MixedDriveScenarios, testing::Range<std::size_t>(0, 12),
                         [](const auto& joint) { return dual_arm12().joints[joint.param].name; });

// rough_handling strikes the body, which this arm bears: a robot that goes on has no incident.
TEST(IncidentScenarios, EveryScenarioThatComesWithTaktIsJudged) {
  std::set<std::string> judged{"rough_handling"};
  for (const Told& told : kTold) judged.insert(told.scenario);
  for (const auto& file : std::filesystem::directory_iterator("config/scenarios"))
    EXPECT_TRUE(judged.contains(file.path().stem().string())) << file.path() << " has no row in kTold";
}

}  // namespace
}  // namespace takt::lab

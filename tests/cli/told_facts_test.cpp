// SPDX-License-Identifier: Apache-2.0
// Goal: a fact has one name, one unit and one value, whatever tells it. Method: a virtual robot whose policy falls
// silent; what `takt status --json`, `takt top --json` and ROS 2's diagnostics make of its newest tick is compared with
// the tick, and the names with those of the run's ticks and of /takt/status.
#include <fmt/format.h>
#include <gtest/gtest.h>

#include <algorithm>
#include <fstream>
#include <map>
#include <nlohmann/json.hpp>
#include <set>

#include "cli/run/status_text.hpp"
#include "cli/top/live_view.hpp"
#include "cli/top/picture_json.hpp"
#include "monitor/record/diagnostics.hpp"
#include "monitor/record/tick_schema.hpp"
#include "tests/monitor/record/virtual_robot.hpp"

namespace takt::monitor {
namespace {

using Json = nlohmann::json;

// By hand, so that a fact which every surface forgot is missed.
std::map<std::string, Json> facts_of(const TickRecordHeader& tick) {
  const SeatRecord& policy = tick.seats[Seat::policy];
  const bool has_command = policy.freshness != Freshness::missing;
  Json causes = Json::array();
  for (std::size_t cause = 1; cause < kCauseCount; ++cause)
    if ((tick.causes_active >> cause & 1U) != 0) causes.push_back(name(static_cast<Cause>(cause)));
  return {{"tick", tick.tick},
          {"mode", name(tick.mode)},
          {"player", name(tick.player)},
          {"freshness", name(policy.freshness)},
          {"age_ns", has_command ? Json(tick.age.total().ns) : Json()},
          {"command_policy", tick.command_policy == 0 ? Json() : Json(fmt::format("{:016x}", tick.command_policy))},
          {"window_misses", tick.window_misses},
          {"window_ticks", tick.window_ticks},
          {"skipped_periods", tick.skipped_periods},
          {"refused_commands", tick.refused_commands},
          {"integration_errors", tick.integration_errors},
          {"drives_enabled", tick.drives_enabled != 0},
          {"causes_active", causes},
          {"recorded_through", tick.recorded_through}};
}

// The name as ROS 2's diagnostics and the run's ticks have it: without the unit.
std::string bare(std::string name) {
  if (name.ends_with("_ns")) name.resize(name.size() - 3);
  return name;
}

StatusSnapshot status_of(const TickRecord& record) {
  StatusSnapshot status;
  status.tick = record.header;
  status.ticks = record.header.tick;
  return status;
}

Json told_by_top(const TickRecord& record) {
  top::LiveView view(demo_robot());
  view.begin();
  view.tick(record);
  return to_json(view.picture(record.header.now));
}

struct Instant {
  const char* what;
  std::uint64_t ticks, frozen_ticks;
  friend void PrintTo(const Instant& instant, std::ostream* out) { *out << instant.what; }
};

class ToldFacts : public testing::TestWithParam<Instant> {
 protected:
  ToldFacts() {
    // What a tick may have counted before anything looked on.
    robot.spoil_input = [](pipeline::TickInput& input) { input.skipped_periods = 3; };
    robot.run(GetParam().ticks);
    robot.policy_is_frozen = true;
    robot.run(GetParam().frozen_ticks);
  }
  VirtualRobot robot;
};

TEST_P(ToldFacts, StatusAndTopHaveEachUnderItsNameWithItsValue) {
  const Json status = cli::status_json(status_of(robot.latest()), {}), top = told_by_top(robot.latest());
  for (const auto& [name, value] : facts_of(robot.latest().header)) {
    EXPECT_EQ(status.value(name, Json("untold")), value) << "status: " << name;
    EXPECT_EQ(top.value(name, Json("untold")), value) << "top: " << name;
  }
}

TEST_P(ToldFacts, DiagnosticsHaveEachInWords) {
  const TickRecordHeader& tick = robot.latest().header;
  const auto parts = diagnose(robot.latest(), RobotStatus{.tick = tick}, demo_robot());
  const std::map<std::string, std::string> told(parts[0].values.begin(), parts[0].values.end());
  for (const auto& [name, value] : facts_of(tick)) {
    std::string words = bare(name);
    std::ranges::replace(words, '_', ' ');
    ASSERT_TRUE(told.contains(words)) << words;
    if (value.is_number_unsigned()) {
      EXPECT_EQ(told.at(words), fmt::format("{}", value.get<std::uint64_t>())) << words;
    }
  }
  EXPECT_EQ(told.at("mode"), name(tick.mode));
  const bool has_command = tick.seats[Seat::policy].freshness != Freshness::missing;
  EXPECT_EQ(told.at("age"), has_command ? fmt::format("{:.3f} ms", tick.age.total().milliseconds()) : "none");
}

INSTANTIATE_TEST_SUITE_P(Surfaces, ToldFacts,
                         testing::Values(Instant{"before_the_policy", 1, 0}, Instant{"tracking", 2'000, 0},
                                         Instant{"degraded", 2'000, 300}, Instant{"stopped", 2'000, 3'000}),
                         [](const auto& instant) { return std::string(instant.param.what); });

// /takt/status has a message type of its own, which its subscribers have compiled: what it tells, it names alike.
TEST(FactNames, AreThoseOfTheRunsTicksAndOfRos) {
  std::set<std::string, std::less<>> of_ticks, of_ros;
  for (const TickField& field : header_fields()) of_ticks.emplace(field.name);
  std::ifstream message("dds/takt_msgs/msg/Status.msg");
  for (std::string line; std::getline(message, line);)
    if (const std::size_t space = line.find(' '); !line.starts_with('#') && space != std::string::npos)
      of_ros.insert(line.substr(space + 1, line.find_first_of(" #", space + 1) - space - 1));
  std::set<std::string> untold_to_ros;
  for (const auto& [name, value] : facts_of({})) {
    EXPECT_TRUE(of_ticks.contains(bare(name))) << name;
    if (!of_ros.contains(name)) untold_to_ros.insert(name);
  }
  EXPECT_EQ(untold_to_ros, (std::set<std::string>{"command_policy", "player", "recorded_through"}));
}

// Each seat: zero is the age of a command that was just made.
TEST(NoCommand, HasNoAge) {
  StatusSnapshot status;
  status.policy_pids[Seat::fallback] = 7;
  status.tick.candidate.policy_hash = 1;
  const Json json = cli::status_json(status, {});
  EXPECT_TRUE(json.at("age_ns").is_null());
  EXPECT_TRUE(json.at("fallback_age_ns").is_null());
  EXPECT_TRUE(json.at("candidate").at("age_ns").is_null());
  const std::string text = cli::status_text(status, {});
  EXPECT_EQ(text.find("age 0.0 ms"), std::string::npos) << text;
}

// Two counts that begin at two times have two places.
TEST(Counts, SinceTheStartAndSinceTheViewAttachedAreToldApart) {
  VirtualRobot robot;
  std::uint64_t skipped = 5;
  robot.spoil_input = [&skipped](pipeline::TickInput& input) { input.skipped_periods = skipped; };
  robot.run(1'000);
  top::LiveView view(demo_robot());
  view.begin();
  view.tick(robot.latest());
  skipped = 7;
  robot.run(1);
  view.tick(robot.latest());
  const Json top = to_json(view.picture(robot.latest().header.now));
  EXPECT_EQ(top.at("skipped_periods"), cli::status_json(status_of(robot.latest()), {}).at("skipped_periods"));
  EXPECT_EQ(top.at("skipped_periods"), 7);
  EXPECT_EQ(top.at("since_attached").at("skipped_periods"), 2);
  EXPECT_FALSE(top.contains("overruns")) << "since the start: takt status";
  EXPECT_FALSE(top.contains("arrivals")) << "since the start: takt status";
  const auto parts = diagnose(robot.latest(), RobotStatus{.tick = robot.latest().header}, demo_robot());
  EXPECT_TRUE(std::ranges::none_of(parts[0].values, [](const auto& value) { return value.first == "overruns"; }))
      << "the monitor knows those that it saw";
}

// As `takt status` has it, and as `takt bus watch` names a joint's numbers.
TEST(Top, HasNoNameOfAnotherQuantity) {
  VirtualRobot robot;
  robot.run(2'000);
  top::LiveView view(demo_robot());
  view.begin();
  view.tick(robot.latest());
  top::Picture picture = view.picture(robot.latest().header.now);
  picture.joints[1].kind = config::JointKind::slide;
  picture.incident = "policy: no usable command came";
  const Json json = to_json(picture), joints = json.at("joints");
  const JointRecord& hinge = robot.latest().joints[0];
  EXPECT_EQ(joints[0].at("q_estimate_rad"), hinge.q_estimate);
  EXPECT_EQ(joints[0].at("q_reference_rad"), hinge.q_reference);
  EXPECT_EQ(joints[0].at("tau_total_Nm"), hinge.tau_total);
  EXPECT_TRUE(joints[1].contains("q_estimate_m"));
  EXPECT_TRUE(joints[1].contains("tau_total_N"));
  EXPECT_FALSE(joints[0].contains("torque")) << "Prometheus' torque is what the drive reports";
  EXPECT_EQ(json.at("incident").at("sentence"), picture.incident);
  EXPECT_EQ(json.at("incident").at("stands"), true);
}

}  // namespace
}  // namespace takt::monitor

// SPDX-License-Identifier: Apache-2.0
// Goal: every value of the table, legal and dangerous, has its line with the key, and the robots that come with Takt
// have none. Method: one value changed in a shipped robot; the lines before and after.
#include "config/cautions.hpp"

#include <gtest/gtest.h>

#include <algorithm>
#include <filesystem>
#include <functional>
#include <string>
#include <vector>

#include "config/load.hpp"

namespace takt::config {
namespace {

struct Danger {
  const char* key;  // what its line names
  std::function<void(RobotConfig&)> make;
  const char* robot = "config/arm6.yaml";
  friend void PrintTo(const Danger& danger, std::ostream* out) { *out << danger.key; }
};

Link& heavy(RobotConfig& robot) {
  return robot.model->links.back();
}

const Danger kDangers[] = {
    {"gains.kd 0", [](RobotConfig& r) { r.joints[0].kd = 0; }},
    {"degrees, or mm of a slide",
     [](RobotConfig& r) {
       r.joints[0].kind = JointKind::slide;
       r.policy->action.scale = {100};
     }},
    {"gains.kd damps", [](RobotConfig& r) { r.joints[0].kd = 1e-3; }},
    {"inertia below", [](RobotConfig& r) { r.joints[0].inertia = 1e-9; }},
    {"gains.damping", [](RobotConfig& r) { r.joints[0].damping = 1e-3; }},
    {"observer_bandwidth", [](RobotConfig& r) { r.joints[0].observer_bandwidth = 2; }},
    {"limits.torque cannot give", [](RobotConfig& r) { r.joints[0].inertia *= 100; }},
    {"limits.velocity_hard",
     [](RobotConfig& r) { r.joints[0].limits.velocity_hard = r.joints[0].drive.velocity_range; }},
    {"limits.torque_rate", [](RobotConfig& r) { r.joints[0].limits.torque_rate = 1e9; }},
    {"limits.position_margin", [](RobotConfig& r) { r.joints[0].limits.position_margin = 0; }},
    {"limits.position_margin is wider than limits.position: was it meant in degrees",
     [](RobotConfig& r) { r.joints[0].limits.position_margin = 8.6; }},
    {"limits.position_margin is wider than limits.position: was it meant in mm",
     [](RobotConfig& r) {
       r.joints[0].kind = JointKind::slide;
       r.joints[0].limits.position_margin = 8.6;
     }},
    {"within a turn, and limits.position is wider", [](RobotConfig& r) { r.joints[0].limits.q_max = 3.5; }},
    {"drive.watchdog_waiver", [](RobotConfig& r) { r.joints[0].drive.watchdog_waiver = "whatever"; }},
    {"model.gravity",
     [](RobotConfig& r) {
       r.model->gravity = {0, 0, 0};
     }},
    {"model.gravity",
     [](RobotConfig& r) {
       r.model->gravity = {0, 0, -981};
     }},
    {"model.gravity points along +z",
     [](RobotConfig& r) {
       r.model->gravity = {0, 0, 9.81};
     }},
    {"are their masses in kg", [](RobotConfig& r) { heavy(r).mass = 1200; }},
    {"gravity asks for", [](RobotConfig& r) { heavy(r).mass = 60; }},
    {"model.links weigh nothing",
     [](RobotConfig& r) {
       for (Link& link : r.model->links) link.mass = 0;
     }},
    {"no `model`", [](RobotConfig& r) { r.model.reset(); }},
    {"freshness.epsilon", [](RobotConfig& r) { r.freshness.epsilon = 0.99; }},
    {"freshness.max_age", [](RobotConfig& r) { r.freshness.max_age = seconds(3); }},
    {"freshness.stop_after", [](RobotConfig& r) { r.freshness.stop_after = seconds(30); }},
    {"freshness.clamped_share", [](RobotConfig& r) { r.freshness.clamped_share = 1; }},
    {"freshness.bad_command_limit", [](RobotConfig& r) { r.freshness.bad_command_limit = 1'000'000; }},
    {"freshness.recover_after", [](RobotConfig& r) { r.freshness.recover_after = seconds(50); }},
    {"degraded.resume_over", [](RobotConfig& r) { r.degraded.resume_over = milliseconds(3); }},
    {"control.late_share", [](RobotConfig& r) { r.control.late_share = 1; }},
    {"feedback.timeout", [](RobotConfig& r) { r.feedback.timeout = seconds(1); }},
    {"feedback.jump", [](RobotConfig& r) { r.feedback.jump = 0; }},
    {"feedback.contradiction", [](RobotConfig& r) { r.feedback.contradiction = 0; }},
    {"feedback.frozen_after", [](RobotConfig& r) { r.feedback.frozen_after = {}; }},
    {"bus_faults: foreign_frames", [](RobotConfig& r) { r.bus_faults.foreign_frames = 1; }},
    {"record.recorder", [](RobotConfig& r) { r.record.recorder = Recorder::optional; }},
    {"dds.allow_requests",
     [](RobotConfig& r) {
       r.dds.emplace();
       r.dds->interface = "eth0";
       r.dds->allow_requests = true;
     }},
    {"prometheus.address",
     [](RobotConfig& r) {
       r.prometheus = Prometheus{"0.0.0.0", 9464};
     }},
    {"policy.action.scale", [](RobotConfig& r) { r.policy->action.scale = {57.3}; }},
    {"imu.tilt", [](RobotConfig& r) { r.imu->tilt = 3; }, "config/balancer.yaml"},
};

class EveryDanger : public testing::TestWithParam<Danger> {};

TEST_P(EveryDanger, HasALineOfItsOwn) {
  const auto robot = load(GetParam().robot);
  ASSERT_TRUE(robot) << robot.error();
  RobotConfig changed = *robot;
  GetParam().make(changed);
  const std::vector<std::string> before = cautions_about(*robot), after = cautions_about(changed);
  const auto names_it = [](const std::string& line) { return line.find(GetParam().key) != std::string::npos; };
  EXPECT_EQ(std::ranges::count_if(before, names_it), 0);
  EXPECT_EQ(std::ranges::count_if(after, names_it), 1) << testing::PrintToString(after);
}

INSTANTIATE_TEST_SUITE_P(Cautions, EveryDanger, testing::ValuesIn(kDangers));

TEST(Cautions, NoneOfFullSpeedOnPurpose) {
  const auto robot = load("config/arm6.yaml");
  ASSERT_TRUE(robot) << robot.error();
  RobotConfig changed = *robot;
  changed.degraded.resume_over = {};
  EXPECT_EQ(cautions_about(changed), cautions_about(*robot));
}

// But what stops do without a model, which the pole on its cart cannot have.
TEST(Cautions, NoneOnRobotsThatComeWithTakt) {
  int robots = 0;
  for (const auto& entry : std::filesystem::directory_iterator("config")) {
    if (entry.path().extension() != ".yaml" || entry.path().filename() == "devices.yaml") continue;
    const auto robot = load(entry.path().string());
    if (!robot) continue;  // not a robot file
    ++robots;
    std::vector<std::string> lines;
    add_cautions_of_values(*robot, lines);
    EXPECT_TRUE(lines.empty()) << entry.path() << ": " << testing::PrintToString(lines);
  }
  EXPECT_GE(robots, 8);
}

}  // namespace
}  // namespace takt::config

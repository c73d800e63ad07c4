// SPDX-License-Identifier: Apache-2.0
// Goal: Prometheus accepts what is exposed. Method: the text of a virtual robot's run goes through `promtool check
// metrics`, Prometheus's own judge, and through a small reader that demands HELP and TYPE before every sample. Every
// family that the shipped rules and the dashboard name must be in it, and so must every series of the rules' own test:
// an alert that fires on what is never exported is none.
#include "monitor/telemetry/prometheus_text.hpp"

#include <gtest/gtest.h>

#include <algorithm>
#include <cstdio>
#include <cstdlib>
#include <fstream>
#include <memory>
#include <regex>
#include <set>
#include <sstream>
#include <vector>

#include "tests/monitor/record/virtual_robot.hpp"
#include "tests/support/files.hpp"

namespace takt::monitor {
namespace {

std::string text_of_a_run(const std::string& run_id = "run-1") {
  LiveMetrics metrics(demo_robot());
  metrics.begin(run_id);
  VirtualRobot robot;
  for (int tick = 0; tick < 400; ++tick) {
    robot.run(1);
    TickRecord record = robot.latest();
    record.header.seats[Seat::fallback].session = 1;  // as of a robot with everything
    metrics.tick(record);
  }
  metrics.loss({"tick", "overwritten", 3, 1, 5});
  metrics.hours_left = 240;
  return prometheus_text(metrics, demo_robot());
}

TEST(PrometheusText, NamesNoRunBeforeThereIsOne) {
  EXPECT_EQ(text_of_a_run("").find("takt_run_info"), std::string::npos);
  EXPECT_NE(text_of_a_run("run-1").find("run_id=\"run-1\""), std::string::npos);
}

TEST(PrometheusText, EverySampleHasHelpAndType) {
  std::istringstream lines(text_of_a_run());
  std::set<std::string> helped, typed;
  std::size_t samples = 0;
  for (std::string line; std::getline(lines, line);) {
    std::istringstream words(line);
    std::string hash, kind, family;
    if (line.starts_with('#')) {
      words >> hash >> kind >> family;
      EXPECT_TRUE((kind == "HELP" ? helped : typed).insert(family).second) << "twice: " << line;
      continue;
    }
    ++samples;
    std::string name = line.substr(0, line.find('{'));
    for (const char* suffix : {"_bucket", "_sum", "_count"})
      if (name.ends_with(suffix) && typed.contains(name.substr(0, name.size() - std::string(suffix).size())))
        name.resize(name.size() - std::string(suffix).size());
    EXPECT_TRUE(helped.contains(name) && typed.contains(name)) << line;
  }
  EXPECT_GT(samples, 200U);
}

TEST(PrometheusText, LabelsAreEscaped) {
  EXPECT_NE(text_of_a_run("a\"b\\c\nd").find(R"(run_id="a\"b\\c\nd")"), std::string::npos);
}

TEST(PrometheusText, HasWhatRulesAndDashboardAskFor) {
  const std::string text = text_of_a_run();
  const std::regex family("takt_[a-z0-9_]+");
  for (const char* file : {"config/prometheus/takt.rules.yaml", "config/grafana/takt.json"}) {
    const std::string asking = test::text_of(file);
    std::set<std::string> names;
    for (std::sregex_iterator at(asking.begin(), asking.end(), family), end; at != end; ++at) names.insert(at->str());
    EXPECT_GT(names.size(), 5U) << file;
    for (const std::string& name : names)
      EXPECT_TRUE(text.find("\n" + name + "{") != std::string::npos ||
                  text.find("\n" + name + "_bucket{") != std::string::npos)
          << file << " asks for " << name;
  }
}

TEST(PrometheusText, HasEverySeriesOfTheRulesTestFromTheStart) {
  LiveMetrics metrics(demo_robot());
  metrics.begin("run-1");
  VirtualRobot robot;
  robot.run(1);
  metrics.tick(robot.latest());
  std::istringstream lines(prometheus_text(metrics, demo_robot()));
  std::vector<std::string> exported;
  for (std::string line; std::getline(lines, line);) exported.push_back(line);

  const std::string told = test::text_of("tests/monitor/telemetry/takt_rules_test.yaml");
  const std::regex series(R"(series: '([a-z_]+)\{([^}]*)\}')"), label(R"([a-z]+="[^"]*")");
  std::size_t found = 0;
  for (std::sregex_iterator at(told.begin(), told.end(), series), end; at != end; ++at, ++found) {
    const std::string name = at->str(1), labels = at->str(2);
    // Prometheus' own, what is there while it holds (incident_surfaces_test), and what is not every robot's.
    if (name == "up" || name == "takt_incident" || name == "takt_fallback_usable") continue;
    EXPECT_TRUE(std::ranges::any_of(exported,
                                    [&](const std::string& line) {
                                      if (!line.starts_with(name + "{")) return false;
                                      return std::all_of(
                                          std::sregex_iterator(labels.begin(), labels.end(), label),
                                          std::sregex_iterator(), [&](const std::smatch& each) {
                                            const bool names_the_robots_own =
                                                each.str().starts_with("robot=") || each.str().starts_with("bus=");
                                            return names_the_robots_own || line.find(each.str()) != std::string::npos;
                                          });
                                    }))
        << "not exported: " << at->str();
  }
  EXPECT_GT(found, 10U);
}

// Goal: who watches the robot from afar sees a change of policy and what the chunk monitors caught. Method: counted
// once each, read from the text; a robot that watches for nothing has no such family.
TEST(PrometheusText, ChangesOfPolicyAndCatchesAreCounted) {
  config::RobotConfig watching = demo_robot();
  LiveMetrics metrics(watching);
  metrics.begin("run-1");
  VirtualRobot robot;
  robot.run(1);
  TickRecord record = robot.latest();
  metrics.tick(record);
  const std::string before = prometheus_text(metrics, watching);
  EXPECT_EQ(before.find("takt_candidate_in_charge{"), std::string::npos) << "no candidate ever came";
  EXPECT_EQ(before.find("takt_policy_catches_total{"), std::string::npos);

  record.header.candidate.policy_hash = 0xCA11;
  record.header.candidate.in_charge = 1;
  record.header.candidate.change = PolicyChange::swapped;
  metrics.tick(record);
  metrics.caught(config::ChunkScore::reversals);
  watching.policy->monitors.emplace().thresholds = {{.score = config::ChunkScore::reversals, .above = 0.5}};
  const std::string text = prometheus_text(metrics, watching);
  const auto value = [&](const std::string& series) {
    const std::size_t at = text.find("\n" + series);
    return at == std::string::npos ? ' ' : text[text.find('\n', at + 1) - 1];
  };
  EXPECT_EQ(value("takt_candidate_in_charge{"), '1');
  EXPECT_EQ(value("takt_policy_changes_total{robot=\"" + watching.robot + "\",change=\"swapped\"}"), '1');
  EXPECT_EQ(value("takt_policy_changes_total{robot=\"" + watching.robot + "\",change=\"back\"}"), '0');
  EXPECT_EQ(value("takt_policy_catches_total{robot=\"" + watching.robot + "\",score=\"reversals\"}"), '1');
}

TEST(PrometheusText, OnlyARobotWithAFallbackPolicyTellsWhetherItIsThere) {
  LiveMetrics metrics(demo_robot());
  metrics.begin("run-1");
  VirtualRobot robot;
  robot.run(1);
  TickRecord record = robot.latest();
  const auto told = [&] {
    metrics.tick(record);
    const std::string text = prometheus_text(metrics, demo_robot());
    const std::size_t at = text.find("\ntakt_fallback_usable{");
    return at == std::string::npos ? ' ' : text[text.find('\n', at + 1) - 1];
  };
  EXPECT_EQ(told(), ' ');
  record.header.seats[Seat::fallback].session = 1;
  EXPECT_EQ(told(), '0');
  record.header.seats[Seat::fallback].freshness = Freshness::aging;
  EXPECT_EQ(told(), '1');
}

// Goal: no metre stands under the name of a radian. Method: one joint of the robot slides.
TEST(PrometheusText, AJointThatSlidesIsInMetresAndNewtons) {
  LiveMetrics metrics(demo_robot());
  metrics.begin("run-1");
  VirtualRobot robot;
  robot.run(1);
  metrics.tick(robot.latest());
  EXPECT_EQ(prometheus_text(metrics, demo_robot()).find("position_meters"), std::string::npos);
  config::RobotConfig sliding = demo_robot();
  sliding.joints[5].kind = config::JointKind::slide;
  const std::string text = prometheus_text(metrics, sliding);
  const auto has = [&](const std::string& family, std::size_t joint) {
    return text.find(family + "{robot=\"" + sliding.robot + "\",joint=\"" + sliding.joints[joint].name + "\"}") !=
           std::string::npos;
  };
  for (const char* family :
       {"takt_joint_position_meters", "takt_joint_velocity_meters_per_second", "takt_joint_force_newtons"}) {
    EXPECT_TRUE(has(family, 5)) << family;
    EXPECT_FALSE(has(family, 4)) << family;
  }
  for (const char* family : {"takt_joint_position_radians", "takt_joint_torque_newton_meters"}) {
    EXPECT_FALSE(has(family, 5)) << family;
    EXPECT_TRUE(has(family, 4)) << family;
  }
  EXPECT_TRUE(has("takt_joint_temperature_celsius", 5));
}

TEST(PrometheusText, ARecordingThatStoppedIsNotUp) {
  LiveMetrics metrics(demo_robot());
  const auto says = [&](const std::string& family, const std::string& labels, const std::string& value) {
    const std::string line = "\n" + family + "{robot=\"" + demo_robot().robot + "\"" + labels + "} " + value + "\n";
    return prometheus_text(metrics, demo_robot()).find(line) != std::string::npos;
  };
  EXPECT_TRUE(says("takt_up", "", "0"));
  metrics.begin("run-1");
  VirtualRobot robot;
  robot.run(1);
  metrics.tick(robot.latest());
  EXPECT_TRUE(says("takt_up", "", "1"));
  metrics.recording_stopped(500);
  EXPECT_TRUE(says("takt_up", "", "0"));
  const std::string mode(name(robot.latest().header.mode));
  EXPECT_TRUE(says("takt_mode", ",mode=\"" + mode + "\"", "1")) << "the robot itself goes on";
  EXPECT_TRUE(says("takt_record_losses_total", ",ring=\"tick\",reason=\"recording_stopped\"", "500"));
}

TEST(PrometheusText, TellsForHowLongThereIsRoom) {
  LiveMetrics metrics(demo_robot());
  const auto told = [&] {
    const std::string text = prometheus_text(metrics, demo_robot()),
                      family = "\ntakt_record_hours_left{robot=\"arm6\"} ";
    const std::size_t at = text.find(family);
    return at == std::string::npos ? "" : text.substr(at + family.size(), text.find('\n', at + 1) - at - family.size());
  };
  EXPECT_EQ(told(), "") << "not known yet";
  metrics.hours_left = 12.5;
  EXPECT_EQ(told(), "12.5");
  metrics.hours_left = std::numeric_limits<double>::infinity();
  EXPECT_EQ(told(), "+Inf");
}

TEST(PrometheusText, PassesPrometheusOwnCheck) {
  if (std::system("command -v promtool >/dev/null") != 0)
    GTEST_SKIP() << "promtool is not installed (package prometheus): FORMAT NOT JUDGED";
  const std::string file = testing::TempDir() + "takt_metrics.txt";
  std::ofstream(file) << text_of_a_run();
  const std::unique_ptr<FILE, int (*)(FILE*)> pipe(popen(("promtool check metrics <" + file + " 2>&1").c_str(), "r"),
                                                   pclose);
  std::string said;
  for (int c = 0; (c = fgetc(pipe.get())) != EOF;) said += static_cast<char>(c);
  // People plan a disk in hours, and nothing else is reckoned with it.
  EXPECT_EQ(said, "takt_record_hours_left use base unit \"seconds\" instead of \"hours\"\n");
}

}  // namespace
}  // namespace takt::monitor

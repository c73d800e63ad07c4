// SPDX-License-Identifier: Apache-2.0
// Goal: what `takt margin` shows is what was found, disagreement included, within 80 columns. Method: made-up margins.
#include "lab/study/margin_report.hpp"

#include <gtest/gtest.h>

#include <algorithm>
#include <limits>
#include <sstream>

namespace takt::study {
namespace {

LoopMargins margins(double gain) {
  return {.gain = gain, .phase_rad = 1.0, .delay_s = 0.02, .crossover = 50, .gain_at = 1000};
}

JointMargins joint(double computed, double injected, double disagreement) {
  return {.joint = "a_joint_with_a_rather_long_name",
          .no_loop = {},
          .not_computed = {},
          .computed = margins(computed),
          .injected = margins(injected),
          .computed_response = {{1, {10, -1}}, {100, {0.1, -0.2}}},
          .injected_response = {{2, {9, -1}}, {90, {0.1, -0.2}}},
          .trouble = {},
          .disagreement = disagreement,
          .advice = {}};
}

MarginReport report(const config::RobotConfig& robot, std::vector<JointMargins> joints) {
  AgeTolerance found;
  found.ages = {{0, 60, 60, 0.951, 1, 36, 55, 0, true}, {80, 41, 36, 0.75, 0.95, 116, 135, 0, false}};
  found.misses = {{100, 60, 60, 0.951, 1, 40, 99, 0.034, true}, {1600, 60, 57, 0.875, 0.986, 140, 1699, 0.134, false}};
  found.silences = {{250, 60, 60, 0.951, 1, 40, 299, 0, true}};
  found.tolerated_silence_ms = 250;
  found.stop_after_ms = 200;
  found.tolerated_age_ms = 96.04;
  found.nominal_p99_ms = 55;
  found.max_age_ms = 75;
  found.tolerated_share = 0.034;
  found.epsilon = 0.027;
  return {robot, std::move(joints), found};
}

TEST(MarginReport, SaysWhatAgreesAndWhatDoesNot) {
  const config::RobotConfig robot;
  const MarginReport good = report(robot, {joint(10, 10.5, 0.05)});
  EXPECT_TRUE(good.agrees());
  EXPECT_TRUE(to_json(good)["agrees"]);
  const MarginReport bad = report(robot, {joint(10, 10.5, 0.05), joint(10, 12, 0.2)});
  EXPECT_FALSE(bad.agrees());
  EXPECT_NE(margin_text(bad).find("differ by more than 10 %"), std::string::npos);
  EXPECT_FALSE(to_json(bad)["joints"][1]["agrees"]);
  JointMargins lone = joint(10, 10, std::numeric_limits<double>::infinity());
  EXPECT_FALSE(lone.agrees()) << "a margin that only one of the two shows";
  lone.disagreement.reset();
  EXPECT_TRUE(lone.agrees()) << "nothing to compare with";
  lone.trouble = "a limit intervened";
  EXPECT_FALSE(lone.agrees());
}

TEST(MarginReport, KeepsToEightyColumns) {
  const config::RobotConfig robot;
  std::istringstream lines(margin_text(report(robot, {joint(98.9, 98.8, 0.01), joint(10, 12, 123)})));
  for (std::string line; std::getline(lines, line);) EXPECT_LE(line.size(), 80U) << line;
}

// Goal: a robot whose joints have no rest to be measured at says so, and the task is shown all the same. Method: a
// report without joints.
TEST(MarginReport, SaysWhyThereIsNoInnerLoop) {
  const config::RobotConfig robot;
  MarginReport of_none = report(robot, {});
  of_none.not_measured = "its pole falls";
  const std::string text = margin_text(of_none);
  EXPECT_EQ(text.find("inner loop of , not measured:\nits pole falls\n\ncommand age, no gate\n"), 0U) << text;
  EXPECT_EQ(to_json(of_none)["not_measured"], "its pole falls");
  EXPECT_NE(text.find("silence tolerated 250 ms"), std::string::npos);
  EXPECT_NE(text.find("stop_after 200 ms"), std::string::npos);
}

// Goal: a joint without a loop of its own has one line, and spoils nothing. Method: one beside a measured joint.
TEST(MarginReport, AJointWithoutALoopHasOneLine) {
  const config::RobotConfig robot;
  JointMargins encoder;
  encoder.joint = "pole";
  encoder.no_loop = "passive: no drive moves it";
  const MarginReport both = report(robot, {joint(10, 10.5, 0.05), encoder});
  EXPECT_TRUE(both.agrees());
  EXPECT_FALSE(both.rings());
  EXPECT_NE(margin_text(both).find("\npole                no loop: passive: no drive moves it\n"), std::string::npos)
      << margin_text(both);
  EXPECT_TRUE(to_json(both)["joints"][1]["injected"].is_null());
  EXPECT_EQ(bode_svg(both.joints).find("pole"), std::string::npos);
}

// Goal: the smaller of a joint's two phase margins says whether it rings, and the sentence names joint, margin and what
// corrects it. Method: 30 degrees from both sides, each of the two the smaller one.
TEST(MarginReport, BelowThirtyDegreesAJointRings) {
  const config::RobotConfig robot;
  const double limit = kLeastPhase_rad;
  const auto with = [](std::optional<double> computed, std::optional<double> injected) {
    JointMargins made = joint(10, 10, 0);
    made.computed.phase_rad = computed;
    made.injected.phase_rad = injected;
    made.advice = "raise gains.kd from 2 to 2.6 Nms/rad";
    return made;
  };
  EXPECT_FALSE(with(limit, limit + 0.01).rings());
  EXPECT_TRUE(with(limit - 0.01, limit + 0.01).rings());
  EXPECT_TRUE(with(limit + 0.01, limit - 0.01).rings());
  EXPECT_TRUE(with({}, limit - 0.01).rings()) << "a loop inside a drive is measured only";
  EXPECT_FALSE(with({}, {}).rings()) << "a loop that never reaches gain 1 has no phase margin to lack";
  const MarginReport ringing = report(robot, {joint(10, 10.5, 0.05), with(0.5, 0.6)});
  EXPECT_TRUE(ringing.rings());
  EXPECT_NE(margin_text(ringing).find("\n  rings: its phase margin is below 30 degrees\n"), std::string::npos);
  EXPECT_TRUE(to_json(ringing)["joints"][1]["rings"]);
  EXPECT_EQ(
      ringing_sentence(ringing.joints[1]),
      "joint a_joint_with_a_rather_long_name rings: phase margin 28.6 degrees, below 30; raise gains.kd from 2 to "
      "2.6 Nms/rad");
}

TEST(MarginReport, JsonHoldsTheProposal) {
  const config::RobotConfig robot;
  const auto json = to_json(report(robot, {joint(10, 10.5, 0.05)}));
  EXPECT_EQ(json["schema"], "takt.margin/1");
  EXPECT_EQ(json["task"]["proposed_max_age_ms"], 75);
  EXPECT_EQ(json["task"]["proposed_epsilon"], 0.027);
  EXPECT_EQ(json["task"]["proposed_stop_after_ms"], 200);
  EXPECT_TRUE(json["task"]["proposed_recover_after_ms"].is_null()) << "nothing was tried";
  MarginReport tried = report(robot, {joint(10, 10.5, 0.05)});
  tried.tolerance->recoveries = {{milliseconds(50), seconds(10), 12, 11, 3.5, 1.25}};
  tried.tolerance->recovery = tried.tolerance->recoveries.front();
  const auto with_recovery = to_json(tried)["task"];
  EXPECT_EQ(with_recovery["proposed_recover_after_ms"], 50);
  EXPECT_EQ(with_recovery["proposed_flap_memory_ms"], 10'000);
  EXPECT_EQ(with_recovery["recovery"][0]["entered_degraded"], 1.25);
  EXPECT_NE(margin_text(tried).find("proposed: recover_after 50 ms, flap_memory 10 s"), std::string::npos);
  EXPECT_NEAR(json["joints"][0]["computed"]["phase_deg"], 57.2958, 1e-3);
  EXPECT_EQ(json["joints"][0]["injected"]["delay_ms"], 20);
}

TEST(MarginReport, PlotHasALineAndMarksPerJoint) {
  const std::string svg = bode_svg(std::vector{joint(10, 10.5, 0.05), joint(10, 10.5, 0.05)});
  std::size_t lines = 0;
  for (std::size_t at = svg.find("<polyline"); at != std::string::npos; at = svg.find("<polyline", at + 1)) ++lines;
  EXPECT_EQ(lines, 4U);
}

}  // namespace
}  // namespace takt::study

// SPDX-License-Identifier: Apache-2.0
// Goal: a joint that slides is in metres and newtons, and nothing else about a robot file changes. Method: the small
// robot's knee as a slide; each of its keys in the other kind's unit is refused with one sentence that says how the
// joint becomes one of that kind.
#include "config/joint_units.hpp"

#include <fmt/format.h>
#include <gtest/gtest.h>

#include <algorithm>
#include <array>
#include <string>
#include <vector>

#include "config/cautions.hpp"
#include "config/load.hpp"
#include "tests/config/small_robot.hpp"
#include "tests/support/replaced.hpp"

namespace takt::config {
namespace {

// Between "  - name: knee" and the model.
constexpr std::string_view kSlide = R"(  - name: knee
    kind: slide
    bus: left
    drive: { protocol: mit, variant: tmotor, id: 0x02, reply_id: 0, gear_ratio: 100 rad/m, offset: 1 mm, position_range: 12.5 rad, velocity_range: 50 rad/s, torque_range: 2 Nm, kp_range: 5 Nm/rad, kd_range: 0.5 Nms/rad, position_after_power_up: absolute }
    limits: { position: [0 m, 40 mm], position_margin: 2 mm, velocity: 100 mm/s, velocity_hard: 0.4 m/s, acceleration: 5 m/s2, torque: 60 N, torque_rate: 3000 N/s, kp: 4000 N/m, kd: 400 Ns/m }
    gains: { kp: 2000 N/m, kd: 90 Ns/m, damping: 90 Ns/m }
    inertia: 0.4 kg
    inertia_max: 0.5 kg
    home: 20 mm
)";

using takt::test::replaced;

std::string with_slide(std::string_view from = "", std::string_view to = "") {
  std::string text(test::kSmallRobot);
  const std::size_t knee = text.find("  - name: knee"), model = text.find("model:\n");
  text.replace(knee, model - knee, from.empty() ? std::string(kSlide) : replaced(std::string(kSlide), from, to));
  return replaced(text, "pose: [0 rad, 10 deg]", "pose: [0 rad, 10 mm]");
}

std::string refusal_of(const std::string& text) {
  const auto robot = parse(text, "r");
  return robot ? "" : robot.error();
}

TEST(Slide, IsInMetresAndNewtons) {
  const auto robot = parse(with_slide(), "r");
  ASSERT_TRUE(robot) << robot.error();
  const Joint& slide = robot->joints[1];
  EXPECT_EQ(slide.kind, JointKind::slide);
  EXPECT_EQ(robot->joints[0].kind, JointKind::hinge);
  EXPECT_EQ(slide.limits.q_max, 0.04);
  EXPECT_EQ(slide.limits.velocity, 0.1);
  EXPECT_EQ(slide.limits.torque, 60);
  EXPECT_EQ(slide.limits.target_margin, 0.005) << "its default is no angle";
  EXPECT_EQ(slide.kp, 2000);
  EXPECT_EQ(slide.inertia, 0.4);
  EXPECT_EQ(slide.home, 0.02);
  EXPECT_EQ(slide.drive.gear_ratio, 100);
  EXPECT_EQ(slide.drive.offset, 0.001);
  EXPECT_EQ(per_rad(slide), 0.01);
  EXPECT_EQ(robot->fallbacks[0].pose[1], 0.01);
  EXPECT_EQ(robot->fallbacks[0].slide_speed, 0.05);
  EXPECT_EQ(kJointStiffness.unit(slide.kind), "N/m");
}

TEST(Slide, ReadsBackFromItsCanonicalTextToTheSameHash) {
  const auto robot = parse(with_slide(), "r");
  ASSERT_TRUE(robot) << robot.error();
  const auto again = parse(robot->resolved, "r");
  ASSERT_TRUE(again) << again.error() << robot->resolved;
  EXPECT_EQ(again->sha256, robot->sha256);
  EXPECT_EQ(parse(with_every_default(*robot), "r").value().sha256, robot->sha256);
  EXPECT_NE(robot->resolved.find("kind: slide"), std::string::npos) << robot->resolved;
}

// Goal: what a slide may do is within what its drive can express, through its gear. Method: each limit a little beyond;
// the drive's ranges are its motor's.
TEST(Slide, ItsLimitsAreWithinItsDrivesRanges) {
  for (const auto& [from, to, sentence] :
       {std::array{"torque: 60 N,", "torque: 201 N,", "limits.torque: torque / gear_ratio = 2.01 Nm exceeds"},
        std::array{"[0 m, 40 mm]", "[0 m, 124.5 mm]",
                   "limits.position: (|position| + margin - offset) * gear_ratio = 12.55 rad"},
        std::array{"velocity_hard: 0.4 m/s", "velocity_hard: 0.51 m/s",
                   "limits.velocity_hard: velocity_hard * gear_ratio = 51 rad/s"},
        std::array{"kp: 4000 N/m", "kp: 50100 N/m", "limits.kp: kp / gear_ratio^2 = 5.01 Nm/rad"},
        std::array{"kd: 400 Ns/m", "kd: 5010 Ns/m", "limits.kd: kd / gear_ratio^2 = 0.501 Nms/rad"}}) {
    const std::string said = refusal_of(with_slide(from, to));
    EXPECT_NE(said.find(std::string("joints[1].") + sentence), std::string::npos) << to << ": " << said;
  }
}

// Goal: a runaway that the drive cannot tell is warned of by the slide's own speed. Method: 50 rad/s are 0.5 m/s.
TEST(Slide, ASpeedThatItsDriveCannotTellIsWarnedOf) {
  for (const auto& [hard, is_said] : {std::pair{"0.4 m/s", false}, std::pair{"0.5 m/s", true}}) {
    const auto robot = parse(with_slide("velocity_hard: 0.4 m/s", std::string("velocity_hard: ") + hard), "r");
    ASSERT_TRUE(robot) << robot.error();
    const auto lines = cautions_about(*robot);
    EXPECT_EQ(std::ranges::any_of(lines,
                                  [](const std::string& line) {
                                    return line.find("knee") != std::string::npos &&
                                           line.find("as fast as its drive can tell") != std::string::npos;
                                  }),
              is_said)
        << hard;
  }
}

// Goal: how near an assumption must be is of a slide's motor. Method: tolerances that its range and its speed bear, and
// ones that they do not.
TEST(Slide, ASpeculationIsOfItsMotor) {
  const auto with = [](const std::string& text, const std::string& tolerances) {
    return replaced(text, "  action: {", "  speculation: { " + tolerances + " }\n  action: {");
  };
  EXPECT_EQ(refusal_of(with(with_slide(), "position: 0.05 rad, velocity: 0.5 rad/s")), "");
  const std::string narrow = replaced(with_slide("[0 m, 40 mm]", "[0 m, 19 mm]"), "home: 20 mm", "home: 10 mm");
  EXPECT_NE(refusal_of(with(narrow, "position: 0.99 rad, velocity: 0.5 rad/s")).find("half of joint knee's range"),
            std::string::npos)
      << refusal_of(with(narrow, "position: 0.99 rad, velocity: 0.5 rad/s"));
  EXPECT_NE(refusal_of(with(narrow, "position: 0.05 rad, velocity: 11 rad/s"))
                .find("is no less than joint knee's limit of 0.1 m/s"),
            std::string::npos);
}

// What a hinge's file says and means is as it was: the kind is a default, and leaves no trace.
TEST(Slide, AHingeKeepsItsText) {
  const auto robot = parse(test::kSmallRobot, "r");
  ASSERT_TRUE(robot) << robot.error();
  const auto said = parse(test::with("  - name: knee\n", "  - name: knee\n    kind: hinge\n"), "r");
  ASSERT_TRUE(said) << said.error();
  EXPECT_EQ(said->sha256, robot->sha256);
  EXPECT_EQ(robot->resolved.find("kind: hinge"), std::string::npos);
  EXPECT_EQ(robot->resolved.find("slide"), std::string::npos) << robot->resolved;
}

// Goal: a list of offsets has each in the unit of its output's joint. Method: outputs by joint_order (the slide first)
// and by action.joints, which stands behind it; read back to the same hash; the units the other way round are refused.
TEST(Slide, AnOffsetIsInItsJointsUnit) {
  const std::string by_order = replaced(with_slide(), "offset: home }", "offset: [10 mm, 0.1 rad] }");
  const std::string by_joints =
      replaced(with_slide(), "offset: home }", "offset: [0.1 rad, 10 mm], joints: [hip, knee] }");
  for (const auto& [text, values] :
       {std::pair{by_order, std::vector{0.01, 0.1}}, std::pair{by_joints, std::vector{0.1, 0.01}}}) {
    const auto robot = parse(text, "r");
    ASSERT_TRUE(robot) << robot.error();
    EXPECT_EQ(robot->policy->action.offset_values, values);
    const auto again = parse(robot->resolved, "r");
    ASSERT_TRUE(again) << again.error() << robot->resolved;
    EXPECT_EQ(again->sha256, robot->sha256);
    EXPECT_EQ(parse(with_every_default(*robot), "r").value().sha256, robot->sha256);
  }
  const std::string said = refusal_of(replaced(by_order, "[10 mm, 0.1 rad]", "[0.1 rad, 10 mm]"));
  EXPECT_NE(said.find("policy.action.offset: 0.1 rad is an angle, not a length; write it in m or mm"),
            std::string::npos)
      << said;
  EXPECT_NE(said.find("policy.action.offset: 10 mm is a length, not an angle; write it in rad or deg"),
            std::string::npos)
      << said;
}

// Goal: a gain of state feedback is in the unit of the row's joint per the list's. Method: a hinge's and a slide's row;
// read back to the same hash; each gain in a neighbour's unit is refused.
TEST(Slide, GainsOfStateFeedbackAreBetweenKinds) {
  const std::string text =
      replaced(with_slide(), "  tuck: { kind: pose, speed: 0.5 rad/s, pose: [0 rad, 10 mm] }",
               "  tuck:\n    kind: state_feedback\n    pose: [0 rad, 10 mm]\n    gains:\n"
               "      - { joint: hip, position: [20 Nm/rad, 300 Nm/m], velocity: [2 Nms/rad, 30 Nms/m] }\n"
               "      - { joint: knee, position: [40 N/rad, 500 N/m], velocity: [4 Ns/rad, 50 Ns/m] }");
  const auto robot = parse(text, "r");
  ASSERT_TRUE(robot) << robot.error();
  const auto& rows = robot->fallbacks[0].gains;
  ASSERT_EQ(rows.size(), 2U);
  EXPECT_EQ(rows[0].position, (std::vector{20.0, 300.0}));
  EXPECT_EQ(rows[1].velocity, (std::vector{4.0, 50.0}));
  EXPECT_EQ(parse(robot->resolved, "r").value().sha256, robot->sha256) << robot->resolved;
  for (const auto& [from, to] :
       {std::pair{"20 Nm/rad", "20 N/rad"}, std::pair{"300 Nm/m", "300 Nm/rad"}, std::pair{"40 N/rad", "40 N/m"},
        std::pair{"500 N/m", "500 Nm/rad"}, std::pair{"2 Nms/rad", "2 Ns/m"}, std::pair{"30 Nms/m", "30 Ns/m"},
        std::pair{"4 Ns/rad", "4 Nms/rad"}, std::pair{"50 Ns/m", "50 Nms/m"}}) {
    const std::string said = refusal_of(replaced(text, from, to));
    EXPECT_NE(said.find(std::string("; write it in ") + std::string(from).substr(std::string(from).find(' ') + 1)),
              std::string::npos)
        << to << ": " << said;
  }
}

struct OtherUnit {
  std::string_view from, to, key;
};

TEST(Slide, WhatIsInAHingesUnitIsRefused) {
  for (const OtherUnit& each :
       {OtherUnit{"[0 m, 40 mm]", "[0 rad, 40 mm]", "limits.position"},
        OtherUnit{"position_margin: 2 mm", "position_margin: 2 deg", "limits.position_margin"},
        OtherUnit{"velocity: 100 mm/s", "velocity: 1 rad/s", "limits.velocity"},
        OtherUnit{"velocity_hard: 0.4 m/s", "velocity_hard: 4 deg/s", "limits.velocity_hard"},
        OtherUnit{"acceleration: 5 m/s2", "acceleration: 5 rad/s2", "limits.acceleration"},
        OtherUnit{"torque: 60 N,", "torque: 60 Nm,", "limits.torque"},
        OtherUnit{"torque_rate: 3000 N/s", "torque_rate: 3000 Nm/s", "limits.torque_rate"},
        OtherUnit{"kp: 4000 N/m", "kp: 4000 Nm/rad", "limits.kp"},
        OtherUnit{"kd: 400 Ns/m", "kd: 400 Nms/rad", "limits.kd"},
        OtherUnit{"kp: 2000 N/m", "kp: 2000 Nm/rad", "gains.kp"},
        OtherUnit{"damping: 90 Ns/m", "damping: 90 Nms/rad", "gains.damping"},
        OtherUnit{"inertia: 0.4 kg", "inertia: 0.4 kgm2", "inertia"},
        OtherUnit{"inertia_max: 0.5 kg", "inertia_max: 0.5 kgm2", "inertia_max"},
        OtherUnit{"home: 20 mm", "home: 20 deg", "home"}, OtherUnit{"offset: 1 mm", "offset: 1 rad", "drive.offset"},
        OtherUnit{"gear_ratio: 100 rad/m", "gear_ratio: 100", "drive.gear_ratio"}}) {
    const std::string said = refusal_of(with_slide(each.from, each.to));
    EXPECT_NE(said.find(fmt::format("joints[1].{}: ", each.key)), std::string::npos) << each.to << ": " << said;
    EXPECT_TRUE(said.ends_with(", or leave `kind: slide` out")) << each.to << ": " << said;
    EXPECT_EQ(said.find('\n'), std::string::npos) << said;
  }
}

TEST(Slide, WhatIsInASlidesUnitIsRefusedOfAHinge) {
  for (const OtherUnit& each :
       {OtherUnit{"[-1 rad, 1 rad]", "[-1 m, 1 rad]", "limits.position"},
        OtherUnit{"position_margin: 0.1 rad", "position_margin: 1 mm", "limits.position_margin"},
        OtherUnit{"velocity: 2 rad/s", "velocity: 2 m/s", "limits.velocity"},
        OtherUnit{"torque: 12 Nm", "torque: 12 N", "limits.torque"},
        OtherUnit{"kp: 100 Nm/rad", "kp: 100 N/m", "limits.kp"},
        OtherUnit{"inertia: 0.1 kgm2", "inertia: 0.1 kg", "inertia"},
        OtherUnit{"id: 1, reply_id: 0,", "id: 1, reply_id: 0, gear_ratio: 100 rad/m,", "drive.gear_ratio"}}) {
    const std::string said = refusal_of(test::with(each.from, each.to));
    EXPECT_NE(said.find(fmt::format("joints[0].{}: ", each.key)), std::string::npos) << each.to << ": " << said;
    EXPECT_TRUE(said.ends_with(", or write `kind: slide` into the joint")) << each.to << ": " << said;
    EXPECT_EQ(said.find('\n'), std::string::npos) << said;
  }
}

TEST(Slide, WhatHasNoMeaningForItIsRefused) {
  const auto refused = [](const std::string& text, std::string_view sentence) {
    const std::string said = refusal_of(text);
    EXPECT_NE(said.find(sentence), std::string::npos) << said;
  };
  refused(with_slide(", gear_ratio: 100 rad/m", ""), "key `gear_ratio` is missing in `joints[1].drive`");
  refused(with_slide("kind: slide", "kind: slides"),
          "joints[1].kind: kind `slides` is not known; did you mean `slide`?");
  refused(
      with_slide("position_after_power_up: absolute", "position_after_power_up: one_of_several, places_per_turn: 9"),
      "one_of_several counts turns of the joint, which a slide has none of; write unknown");
  refused(replaced(with_slide(), "pose: [0 rad, 10 mm]", "pose: [0 rad, 10 deg]"),
          "fallbacks.tuck.pose: 10 deg is an angle, not a length; write it in m or mm");
  refused(replaced(with_slide(), "pose: [0 rad, 10 mm]", "pose: [0 rad, 50 mm]"),
          "fallbacks.tuck.pose: 0.05 m for knee is outside its limits [0, 0.04] m; move it inside");
  refused(replaced(with_slide(), "speed: 0.5 rad/s,", "speed: 0.5 rad/s, slide_speed: 1 m/s,"),
          "fallbacks.tuck.slide_speed: 1 m/s exceeds the velocity limit 0.1 m/s of knee; lower it");
  refused(with_slide("home: 20 mm", "home: 50 mm"), "home: 0.05 m is outside limits.position [0, 0.04] m");
  refused(with_slide("velocity_hard: 0.4 m/s", "velocity_hard: 10 mm/s"),
          "0.01 m/s is below velocity 0.1 m/s; raise it");
}

}  // namespace
}  // namespace takt::config

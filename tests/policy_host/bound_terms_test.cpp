// SPDX-License-Identifier: Apache-2.0
// Goal: of every network it is said which values of its inputs come from which term, with unit. Method: the small
// robot's terms, in one input and in several, by term and by time.
#include "policy_host/bound_terms.hpp"

#include <gtest/gtest.h>

#include "tests/policy_host/small_robot.hpp"

namespace takt::policy_host {
namespace {

using Lines = std::vector<std::string>;

TEST(BoundTerms, HavePlacesUnitsAndWhatBecomesOfThem) {
  auto robot = small_robot();
  robot.policy->observation[0].scale = {0.5};
  robot.policy->observation[0].clip = {-1, 1};
  const FilledTensor obs{"obs", 10};
  EXPECT_EQ(bound_lines({&obs, 1}, robot),
            (Lines{"obs 0..2: joint_position_relative of 3 joints, rad from home, clipped to [-1, 1], times 0.5",
                   "obs 3..6: sensor eye, 2 values, unit unstated, 2 instants, oldest first",
                   "obs 7..9: last_action of 3 joints, as the network gave it"}));
}

TEST(BoundTerms, JointsThatSlideAreInMetres) {
  auto robot = small_robot();
  robot.joints[2].kind = config::JointKind::slide;
  const FilledTensor obs{"obs", 10};
  EXPECT_EQ(bound_lines({&obs, 1}, robot)[0],
            "obs 0..2: joint_position_relative of 3 joints, rad (slides: m) from home");
  EXPECT_EQ(action_line(robot), "actions: joint_position of 3 joints, rad (slides: m), times 1, from home");
  robot.policy->action.joint_of_output = {2};
  EXPECT_EQ(action_line(robot), "actions: joint_position of 1 joints, m, times 1, from home");
}

TEST(BoundTerms, ScalesThatDifferAreListed) {
  auto robot = small_robot();
  robot.policy->observation[0].scale = {0.5, 1, 2};
  const FilledTensor obs{"obs", 10};
  EXPECT_EQ(bound_lines({&obs, 1}, robot)[0],
            "obs 0..2: joint_position_relative of 3 joints, rad from home, times [0.5, 1, 2]");
}

TEST(BoundTerms, ActionsAreSaidWithScaleAndOffset) {
  auto robot = small_robot();
  config::Action& action = robot.policy->action;
  action.scale = {0.25};
  EXPECT_EQ(action_line(robot), "actions: joint_position of 3 joints, rad, times 0.25, from home");
  action = {.kind = config::ActionKind::joint_velocity,
            .interpolation = {},
            .join = {},
            .scale = {1, 2},
            .offset = config::OffsetKind::values,
            .offset_values = {0.1, -0.1},
            .joint_of_output = {2, 0}};
  EXPECT_EQ(action_line(robot), "actions: joint_velocity of 2 joints, rad/s, times [1, 2], from [0.1, -0.1]");
}

TEST(BoundTerms, OfSeveralInputsEachHasItsOwn) {
  auto robot = small_robot();
  robot.sensors[0].unit = "m/s";
  robot.sensors[0].frame = "base";
  const FilledTensor inputs[] = {{"q", 3}, {"rest", 7}};
  EXPECT_EQ(bound_lines(inputs, robot), (Lines{"q: joint_position_relative of 3 joints, rad from home",
                                               "rest 0..3: sensor eye, 2 values, m/s, frame base, 2 instants, oldest "
                                               "first",
                                               "rest 4..6: last_action of 3 joints, as the network gave it"}));
}

TEST(BoundTerms, ByTimeAnInstantStandsAsOne) {
  auto robot = small_robot();
  robot.policy->history_layout = "by_time";
  robot.policy->history_order = "newest_first";
  robot.policy->observation = {term(config::TermKind::joint_velocity, 1, 2), term(config::TermKind::sensor, 1, 2)};
  const FilledTensor obs{"obs", 10};
  EXPECT_EQ(bound_lines({&obs, 1}, robot),
            (Lines{"obs 0..2: joint_velocity of 3 joints, rad/s, 2 instants, newest first, one every 5 values",
                   "obs 3..4: sensor eye, 2 values, unit unstated, 2 instants, newest first, one every 5 values"}));
}

}  // namespace
}  // namespace takt::policy_host

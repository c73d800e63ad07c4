// SPDX-License-Identifier: Apache-2.0
// Goal: a robot with a passive joint and a state-feedback fallback is read as it is meant, or refused with the place
// and the remedy. Method: the committed balancing robot; the same broken in one place at a time; what the tick gets of
// it.
#include <gtest/gtest.h>

#include <algorithm>
#include <cctype>
#include <ostream>

#include "config/document.hpp"
#include "config/load.hpp"
#include "executive/setup/tick_config_of.hpp"

namespace takt::config {
namespace {

std::string robot_text() {
  return read_file("config/cart_pole.yaml").value();
}

TEST(BalancingRobot, TheTickGetsItsGainsPoseAndPassiveJoint) {
  const auto robot = load("config/cart_pole.yaml");
  ASSERT_TRUE(robot) << robot.error();
  const pipeline::TickConfig tick = setup::tick_config_of(*robot, 0);
  EXPECT_EQ(tick.degraded, pipeline::DegradedBehaviour::fallback);
  EXPECT_EQ(tick.fallback, pipeline::FallbackKind::state_feedback);
  EXPECT_FALSE(tick.joints[0].passive);
  EXPECT_TRUE(tick.joints[1].passive);
  EXPECT_EQ(tick.joints[1].limits.torque, 0.0F);
  EXPECT_EQ(tick.joints[1].kp + tick.joints[1].kd + tick.joints[1].damping, 0.0F);
  const std::vector<FeedbackRow>& gains = robot->fallbacks.at(0).gains;
  EXPECT_FLOAT_EQ(tick.feedback_gains[0][1].position, static_cast<float>(gains.at(0).position.at(1)));
  EXPECT_FLOAT_EQ(tick.feedback_gains[0][0].velocity, static_cast<float>(gains.at(0).velocity.at(0)));
  EXPECT_EQ(tick.feedback_gains[1][0].position, 0.0F);
}

TEST(BalancingRobot, ItsCanonicalTextMeansTheSame) {
  const auto robot = load("config/cart_pole.yaml");
  ASSERT_TRUE(robot) << robot.error();
  const auto again = parse(robot->resolved, "config/cart_pole.yaml");
  ASSERT_TRUE(again) << again.error();
  EXPECT_EQ(again->sha256, robot->sha256);
}

struct Refusal {
  std::string_view when, from, to, complaint;  // the complaint holds this
  friend void PrintTo(const Refusal& refusal, std::ostream* out) { *out << refusal.when; }
};

constexpr Refusal kRefusals[] = {
    {"gains on a passive joint", "    passive: true\n",
     "    passive: true\n    gains: { kp: 1 Nm/rad, kd: 1 Nms/rad, damping: 1 Nms/rad }\n",
     "`gains` in `joints[1]` does not apply beside the section's other keys: gains when the policy sends none"},
    {"a torque limit on a passive joint", "      velocity: 6 rad/s\n", "      velocity: 6 rad/s\n      torque: 1 Nm\n",
     "does not apply beside the section's other keys: largest commanded torque"},
    {"a passive joint that the policy drives", ", joints: [cart]", "",
     "policy.action.joints: give passive joint pole an output; list the driven joints only"},
    {"a row of gains for a passive joint", "      - joint: cart\n", "      - joint: pole\n",
     "fallbacks.balance.gains[0].joint: pole is passive and takes no torque; drop the row"},
    {"no row of gains for a driven joint", "      - joint: cart\n", "      - joint: pole\n",
     "fallbacks.balance.gains: has no row for cart; every driven joint needs one"},
    {"a row twice", "      - joint: cart\n",
     "      - { joint: cart, position: [1 Nm/rad, 1 Nm/rad], velocity: [1 Nms/rad, 1 Nms/rad] }\n      - joint: cart\n",
     "fallbacks.balance.gains[1].joint: cart has 2 rows; keep one"},
    {"a gain too few", "[-0.194 Nm/rad, -12.23 Nm/rad]", "[-0.2 Nm/rad]",
     "fallbacks.balance.gains[0].position: has 1 values for 2 joints; write one per joint"},
    {"a gain without a unit", "-12.23 Nm/rad", "-12.23", "-12.23 has no unit; write `-12.23 Nm/rad`"},
    {"the speed of a pose in state feedback", "    pose: [0 rad, 0 rad]\n",
     "    pose: [0 rad, 0 rad]\n    speed: 1 rad/s\n",
     "`speed` in `fallbacks.balance` needs `pose` beside it: joint speed on the way"},
    {"a pose outside the limits", "pose: [0 rad, 0 rad]", "pose: [0 rad, 1 rad]",
     "fallbacks.balance.pose: 1 rad for pole is outside its limits [-0.5, 0.5] rad; move it inside"},
    {"a cart whose pole is driven by name only", "    passive: true\n", "", "key `gains` is missing"},
    {"a drive that holds by itself at a passive joint",
     "variant: damiao, id: 0x02, reply_id: 0x12, direction: 1, offset: 0 rad, gear_ratio: 1, position_range: 3.2 rad, "
     "velocity_range: 20 rad/s, torque_range: 1 Nm, kp_range: 500 Nm/rad, kd_range: 5 Nms/rad }",
     "id: 2, torque_range: 1 Nm, mode: csp, counts_per_turn: 4096, rated_torque: 1 Nm }", "a passive joint needs cst"},
    {"a path for a cart", "{ kind: steps, reach: 0.3 m, every: 3 s }",
     "{ centre: [0 m, 0 m, 0 m], amplitude: [0 m, 0 m, 0 m], frequency: [0 Hz, 0 Hz, 0 Hz] }",
     "simulation.target.kind: a cart is told where to go by `steps`; write `steps`"},
    {"a command of three values", "values: 1,", "values: 3,",
     "the camera gives a position of 1 value; sensor `target` has another number; declare 1"},
    {"a centre of mass beyond the tip", "pole_com: 0.3 m", "pole_com: 0.7 m",
     "simulation.cart_pole.pole_com: 0.7 m lies beyond pole_length 0.6 m; lower it"},
};

class BalancingRefusal : public testing::TestWithParam<Refusal> {};

TEST_P(BalancingRefusal, NamesTheMistakeAndTheRemedy) {
  std::string text = robot_text();
  const std::size_t at = text.find(GetParam().from);
  ASSERT_NE(at, std::string::npos);
  text.replace(at, GetParam().from.size(), GetParam().to);
  if (GetParam().when.find("holds by itself") != std::string_view::npos)
    text.replace(text.rfind("protocol: mit,"), 14, "protocol: cia402, position_after_power_up: absolute,");
  const auto robot = parse(text, "robot.yaml");
  ASSERT_FALSE(robot.has_value());
  EXPECT_NE(robot.error().find(GetParam().complaint), std::string::npos) << robot.error();
}

INSTANTIATE_TEST_SUITE_P(Load, BalancingRefusal, testing::ValuesIn(kRefusals), [](const auto& row) {
  std::string name(row.param.when);
  std::ranges::replace_if(
      name, [](char c) { return std::isalnum(static_cast<unsigned char>(c)) == 0; }, '_');
  return name;
});

TEST(BalancingRobot, ARobotOfPassiveJointsAloneIsRefused) {
  std::string text = robot_text();
  // The cart becomes passive too: its commanded keys go.
  const std::size_t from = text.find("      acceleration: 200 rad/s2"), to = text.find("    observer_bandwidth");
  text.replace(from, to - from, "");
  text.replace(text.find("    bus: can0\n"), 14, "    bus: can0\n    passive: true\n");
  const auto robot = parse(text, "robot.yaml");
  ASSERT_FALSE(robot.has_value());
  EXPECT_NE(robot.error().find("joints: are all passive"), std::string::npos) << robot.error();
}

}  // namespace
}  // namespace takt::config

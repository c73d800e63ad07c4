// SPDX-License-Identifier: Apache-2.0
// Goal: a policy that does not belong to the robot is refused with both sizes and the sum that shows why. Method: one
// fitting robot, then one deviation at a time.
#include "policy_host/policy_fit.hpp"

#include <gtest/gtest.h>

#include <functional>

#include "tests/policy_host/scripted_policy.hpp"
#include "tests/policy_host/small_robot.hpp"

namespace takt::policy_host {
namespace {

TEST(PolicyFit, AcceptsThePolicyThatTheTermsAddUpTo) {
  const auto robot = small_robot();
  ASSERT_TRUE(check_policy_section(robot));
  EXPECT_TRUE(check_fit(robot, ScriptedPolicy(3 + 2 * 2 + 3, 4 * 3)));
}

TEST(PolicyFit, NamesBothInputSizesAndTheSum) {
  const auto fits = check_fit(small_robot(), ScriptedPolicy(13, 12));
  ASSERT_FALSE(fits);
  EXPECT_EQ(fits.error(),
            "small.onnx: obs wants 13 values, the configuration's terms give 10: joint_position_relative 3 + "
            "sensor eye 2 x 2 + last_action 3; correct policy.observation in small.yaml");
}

TEST(PolicyFit, NamesBothOutputSizesAndTheProduct) {
  const auto fits = check_fit(small_robot(), ScriptedPolicy(10, 3));
  ASSERT_FALSE(fits);
  EXPECT_EQ(
      fits.error(),
      "small.onnx: actions gives 3 values, the configuration wants 12: 4 steps x 3 outputs; correct policy.steps or "
      "policy.action in small.yaml");
}

// An actor's mean and deviations are no chunk of two steps.
TEST(PolicyFit, TwiceTheOutputsOfOneStepInviteNoSecondStep) {
  auto robot = small_robot();
  robot.policy->steps = 1;
  const auto fits = check_fit(robot, ScriptedPolicy(10, 6));
  ASSERT_FALSE(fits);
  EXPECT_EQ(fits.error(),
            "small.onnx: actions gives 6 values, the configuration wants 3: 1 steps x 3 outputs; export the mean alone "
            "if the rest are deviations, or correct policy.action in small.yaml");
}

TEST(PolicyFit, RefusesARecurrentPolicyWithSeveralRequestsInFlight) {
  auto robot = small_robot();
  robot.policy->requests_in_flight = 3;
  ScriptedPolicy policy(10, 12);
  const auto fits = check_fit(robot, policy);
  ASSERT_FALSE(fits);
  EXPECT_EQ(fits.error(),
            "small.yaml: policy.requests_in_flight is 3, and small.onnx is recurrent: each answer needs the one "
            "before; write 1");
  policy.recurrent = false;
  EXPECT_TRUE(check_fit(robot, policy));
}

TEST(PolicyFit, CountsSelectedJointsOnly) {
  auto robot = small_robot();
  robot.policy->joint_order = {2, 0};
  robot.policy->action.joint_of_output = {1};
  ASSERT_TRUE(check_policy_section(robot));
  EXPECT_TRUE(check_fit(robot, ScriptedPolicy(2 + 2 * 2 + 1, 4 * 1)));
}

struct Deviation {
  const char* when;
  std::function<void(config::RobotConfig&)> apply;
  const char* says;
  friend void PrintTo(const Deviation& deviation, std::ostream* out) { *out << deviation.when; }
};

class PolicySection : public testing::TestWithParam<Deviation> {};

TEST_P(PolicySection, IsRefusedWithItsReason) {
  auto robot = small_robot();
  GetParam().apply(robot);
  const auto fine = check_policy_section(robot);
  ASSERT_FALSE(fine);
  EXPECT_NE(fine.error().find(GetParam().says), std::string::npos) << fine.error();
  EXPECT_EQ(fine.error().find('\n'), std::string::npos) << "one line";
  EXPECT_TRUE(fine.error().starts_with("small.yaml: "));
}

INSTANTIATE_TEST_SUITE_P(
    Deviations, PolicySection,
    testing::Values(
        Deviation{"no policy", [](auto& robot) { robot.policy.reset(); }, "no `policy` section"},
        Deviation{"no joints", [](auto& robot) { robot.joints.clear(); }, "0 joints"},
        Deviation{"too many steps", [](auto& robot) { robot.policy->steps = 129; }, "policy.steps is 129"},
        Deviation{"sensor unknown", [](auto& robot) { robot.policy->observation[1].sensor = "ear"; }, "sensor 'ear'"},
        Deviation{"joint order repeats",
                  [](auto& robot) {
                    robot.policy->joint_order = {0, 0};
                  },
                  "joint_order"},
        Deviation{"joint order beyond", [](auto& robot) { robot.policy->joint_order = {3}; }, "joint_order"},
        Deviation{"output twice",
                  [](auto& robot) {
                    robot.policy->action.joint_of_output = {1, 1};
                  },
                  "policy.action"},
        Deviation{"scales of a term",
                  [](auto& robot) {
                    robot.policy->observation[0].scale = {1, 2};
                  },
                  "2 scales for 3"},
        Deviation{"scales of the action",
                  [](auto& robot) {
                    robot.policy->action.scale = {1, 2};
                  },
                  "2 scales for 3"},
        Deviation{"offsets", [](auto& robot) { robot.policy->action.offset = config::OffsetKind::values; },
                  "0 offsets for 3"},
        Deviation{"no history", [](auto& robot) { robot.policy->observation[0].history = 0; }, "history"},
        Deviation{"empty constant",
                  [](auto& robot) { robot.policy->observation[0] = term(config::TermKind::constant, 1); }, "no values"},
        Deviation{"uneven history by time", [](auto& robot) { robot.policy->history_layout = "by_time"; }, "by_time"}));

}  // namespace
}  // namespace takt::policy_host

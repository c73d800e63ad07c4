// SPDX-License-Identifier: Apache-2.0
// Goal: the margins that are computed are those of the loop that runs, for every joint and drive protocol, and a loop
// that runs otherwise than computed is noticed. Method: the demo robots hold their home pose in virtual time; then one
// whose torques come later than the computation knows.
#include "lab/study/joint_margins.hpp"

#include <gtest/gtest.h>

#include <cmath>
#include <numbers>
#include <stdexcept>
#include <vector>

#include "config/load.hpp"
#include "lab/study/gain_advice.hpp"
#include "lab/study/injected_sine.hpp"

namespace takt::study {
namespace {

config::RobotConfig robot(const std::string& file) {
  auto loaded = config::load(file);
  if (!loaded) throw std::runtime_error(loaded.error());
  return *loaded;
}

void expect_agreement(const std::string& file) {
  const config::RobotConfig described = robot(file);
  const auto all = joint_margins({.robot = described, .measured = described, .pose = home_pose(described)});
  ASSERT_TRUE(all) << all.error();
  EXPECT_EQ(all->size(), described.joints.size());
  for (const JointMargins& joint : *all) {
    EXPECT_EQ(joint.trouble, "") << joint.joint;
    ASSERT_TRUE(joint.disagreement) << joint.joint;
    EXPECT_LE(*joint.disagreement, kAgreement) << joint.joint;
    EXPECT_TRUE(joint.computed.gain && joint.computed.phase_rad && joint.computed.delay_s) << joint.joint;
  }
}

TEST(JointMargins, OfTheDemoArmAgree) {
  expect_agreement("config/arm6.yaml");
}

// The response at a few frequencies instead of all margins: enough to see the same bits.
TEST(JointMargins, TheSameRunGivesTheSameBits) {
  const config::RobotConfig described = robot("config/arm6.yaml");
  const Eigen::VectorXd pose = home_pose(described);
  const auto measured = [&] {
    auto still = dynamics_of(described), moving = dynamics_of(described);
    const auto computed = InnerLoop::make(described, **still, pose);
    auto loop = HoldingLoop::make(described, std::move(*moving), pose);
    InjectedSine sine(described, **loop, *computed);
    return std::vector{sine.response(0, 30), sine.response(5, 200)};
  };
  EXPECT_EQ(measured(), measured());
}

TEST(JointMargins, ALoopThatRunsLaterThanComputedIsNoticed) {
  const config::RobotConfig described = robot("config/arm6.yaml");
  config::RobotConfig late = described;
  late.simulation->torque_delay = milliseconds(3);
  const auto all = joint_margins({.robot = described, .measured = late, .pose = home_pose(described)});
  ASSERT_TRUE(all) << all.error();
  for (const JointMargins& joint : *all) {
    EXPECT_FALSE(joint.agrees()) << joint.joint;
    ASSERT_TRUE(joint.computed.delay_s && joint.injected.delay_s);
    EXPECT_NEAR(*joint.computed.delay_s - *joint.injected.delay_s, 2e-3, 0.4e-3) << joint.joint;
  }
}

TEST(JointMargins, AnUnstableLoopIsSaidToBeOne) {
  const config::RobotConfig described = robot("config/arm6.yaml");
  config::RobotConfig late = described;
  late.simulation->torque_delay = milliseconds(20);  // beyond the wrist's delay margin
  const auto all = joint_margins({.robot = described, .measured = late, .pose = home_pose(described)});
  ASSERT_FALSE(all);
  EXPECT_NE(all.error().find("does not come to rest"), std::string::npos) << all.error();
}

TEST(JointMargins, ARobotWithoutSimulationIsRefused) {
  config::RobotConfig described = robot("config/arm6.yaml");
  described.simulation.reset();
  EXPECT_FALSE(joint_margins({.robot = described, .measured = described, .pose = home_pose(described)}));
}

// Goal: a joint without gains is said to have no loop, and where no joint has one nothing need rest. Method: the demo
// arm with a passive wrist, then without any gains.
TEST(JointMargins, AJointWithoutALoopSaysSo) {
  config::RobotConfig described = robot("config/arm6.yaml");
  described.joints[5].kp = described.joints[5].kd = 0;
  EXPECT_EQ(no_loop(described.joints[5]), "kp and kd are 0: the policy alone holds it");
  described.joints[5].passive = true;
  for (std::size_t joint = 0; joint < 5; ++joint) described.joints[joint].kp = described.joints[joint].kd = 0;
  const auto all = joint_margins({.robot = described, .measured = described, .pose = home_pose(described)});
  ASSERT_TRUE(all) << all.error();
  ASSERT_EQ(all->size(), described.joints.size());
  EXPECT_EQ(all->back().no_loop, "passive: no drive moves it");
  for (const JointMargins& joint : *all) {
    EXPECT_FALSE(joint.has_loop()) << joint.joint;
    EXPECT_FALSE(joint.rings());
  }
}

// Goal: robots that fall without their policy are told from those that rest. Method: the shipped ones.
TEST(JointMargins, ARobotThatFallsHasNoRest) {
  EXPECT_EQ(no_rest(robot("config/arm6.yaml")), "");
  EXPECT_NE(no_rest(robot("config/cart_pole.yaml")).find("its pole falls"), std::string::npos);
  EXPECT_NE(no_rest(robot("config/balancer.yaml")).find("its base is free and falls"), std::string::npos);
}

// Goal: the advice to a joint that rings ends the ringing. Method: the demo arm's shoulder rings; it is computed again
// as advised, by less stiffness, then by more damping where its limit leaves room for that.
TEST(JointMargins, TheAdviceEndsTheRinging) {
  config::RobotConfig described = robot("config/arm6.yaml");
  const Eigen::VectorXd pose = home_pose(described);
  const auto phase_of = [&](const config::RobotConfig& one) {
    auto mechanics = dynamics_of(one);
    const auto loop = InnerLoop::make(one, **mechanics, pose);
    return *margins_of([&](double omega) { return loop->loop(1, omega); }, sweep_of(loop->step(), 300, 30)).phase_rad;
  };
  ASSERT_LT(phase_of(described), kLeastPhase_rad);
  const auto advised = [&](const std::string& beginning) {
    const std::string advice = gain_advice(described, 1, dynamics_of, pose);
    const std::size_t to = advice.find(" to ");
    EXPECT_TRUE(advice.starts_with(beginning) && to != std::string::npos) << advice;
    return to == std::string::npos ? 0 : std::stod(advice.substr(to + 4));
  };
  config::RobotConfig softer = described;
  softer.joints[1].kp = advised("lower gains.kp from 200 to ");
  EXPECT_LT(softer.joints[1].kp, described.joints[1].kp);
  EXPECT_GE(phase_of(softer), kLeastPhase_rad);
  described.joints[1].limits.kd = 10;
  config::RobotConfig damped = described;
  damped.joints[1].kd = advised("raise gains.kd from 4.9 to ");
  EXPECT_GT(damped.joints[1].kd, described.joints[1].kd);
  EXPECT_GE(phase_of(damped), kLeastPhase_rad);
}

TEST(JointMargins, OfDrivesOfFiveProtocolsAgree) {
  expect_agreement("config/dual_arm12.yaml");
}

}  // namespace
}  // namespace takt::study

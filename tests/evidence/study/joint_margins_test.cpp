// Goal: the margins that are computed are those of the loop that runs, for every joint and drive protocol, and a loop
// that runs otherwise than computed is noticed. Method: the demo robots hold their home pose in virtual time; then one
// whose torques come later than the computation knows.
#include "evidence/study/joint_margins.hpp"

#include <gtest/gtest.h>

#include <cmath>
#include <numbers>
#include <stdexcept>
#include <vector>

#include "config/load.hpp"
#include "evidence/study/injected_sine.hpp"

namespace takt::margin {
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

TEST(JointMargins, OfDrivesOfFiveProtocolsAgree) {
  expect_agreement("config/dual_arm12.yaml");
}

}  // namespace
}  // namespace takt::margin

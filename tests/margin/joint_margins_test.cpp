// Goal: the margins that are computed are those of the loop that runs, for every joint and drive protocol, and a loop
// that runs otherwise than computed is noticed. Method: the demo robots hold their home pose in virtual time; then one
// whose torques come later than the computation knows.
#include "monitor/margin/joint_margins.hpp"

#include <gtest/gtest.h>

#include <cmath>
#include <numbers>

#include "config/load.hpp"

namespace takt::margin {
namespace {

config::RobotConfig robot(const std::string& file) {
  auto loaded = config::load(file);
  if (!loaded) throw std::runtime_error(loaded.error());
  return *loaded;
}

void show(const JointMargins& joint) {
  const auto text = [](const std::optional<double>& value, double factor) { return value ? *value * factor : NAN; };
  for (const LoopMargins* margins : {&joint.computed, &joint.injected})
    std::printf("%-14s gain %8.3f at %7.1f rad/s  phase %7.2f deg at %7.2f rad/s  delay %7.3f ms\n",
                joint.joint.c_str(), text(margins->gain, 1), text(margins->gain_at, 1),
                text(margins->phase_rad, 180 / std::numbers::pi), text(margins->crossover, 1),
                text(margins->delay_s, 1e3));
}

void expect_agreement(const std::string& file) {
  const config::RobotConfig described = robot(file);
  const auto all = joint_margins({.robot = described, .measured = described, .pose = home_pose(described)});
  ASSERT_TRUE(all) << all.error();
  EXPECT_EQ(all->size(), described.joints.size());
  for (const JointMargins& joint : *all) {
    show(joint);
    EXPECT_EQ(joint.trouble, "") << joint.joint;
    ASSERT_TRUE(joint.disagreement) << joint.joint;
    EXPECT_LE(*joint.disagreement, kAgreement) << joint.joint;
    EXPECT_TRUE(joint.computed.gain && joint.computed.phase_rad && joint.computed.delay_s) << joint.joint;
  }
}

TEST(JointMargins, OfTheDemoArmAgree) {
  expect_agreement("config/arm6.yaml");
}

TEST(JointMargins, OfDrivesOfFiveProtocolsAgree) {
  expect_agreement("config/dual_arm12.yaml");
}

}  // namespace
}  // namespace takt::margin

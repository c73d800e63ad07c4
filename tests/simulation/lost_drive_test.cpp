// SPDX-License-Identifier: Apache-2.0
// Goal: a drive that obeys and is no longer heard is not driven by its last reading; the rest of the robot keeps its
// weight and comes to rest.
// Method: tick, drivers, simulated drives and mechanics in virtual time; the drive's line falls silent, nothing else.
#include <gtest/gtest.h>

#include <algorithm>
#include <cmath>

#include "config/load.hpp"
#include "simulation/free_inertias.hpp"
#include "simulation/robot_plant.hpp"
#include "tests/simulation/whole_loop.hpp"

namespace takt::simulation {
namespace {

config::RobotConfig dual_arm() {
  auto robot = config::load("config/dual_arm12.yaml");
  if (!robot) throw std::runtime_error(robot.error());
  return *robot;
}

constexpr std::size_t kLeftWristPitch = 4, kRightShoulder = 7, kRightElbow = 8, kRightWristRoll = 9;

// One joint of the two-armed robot by itself: its drive on a flywheel, no gravity, no stops, no friction.
config::RobotConfig lone(std::size_t joint) {
  config::RobotConfig robot = dual_arm();
  robot.joints = {robot.joints[joint]};
  robot.buses = {robot.buses[robot.joints[0].bus]};
  robot.joints[0].bus = 0;
  robot.joints[0].home = 0;
  robot.joints[0].limits.q_min = -3;
  robot.joints[0].limits.q_max = 3;
  robot.fallbacks.clear();
  robot.degraded.fallback = "none";
  robot.model.reset();
  robot.simulation->viscous = robot.simulation->coulomb = 0;
  return robot;
}

class LostDrive : public testing::TestWithParam<std::size_t> {};

TEST_P(LostDrive, IsNeverDrivenByItsLastReading) {
  const config::RobotConfig robot = lone(GetParam());
  Plant plant = Plant::on_free_inertias(robot).value();
  test::WholeLoop loop(robot, plant);
  loop.run(1000);  // it was moved where it hangs: a jump blocks arming for half a second
  ASSERT_TRUE(loop.arm()) << loop.out->record.header.causes_active;
  loop.run(100);
  ASSERT_EQ(loop.mode(), Mode::tracking);
  ArmState pushed = plant.state();
  pushed.dq[0] = 3;
  plant.set_state(pushed);
  loop.run(5);
  ASSERT_GT(loop.joint(0).dq_estimate, 0.1F) << "it was seen to move";
  plant.set_line(0, {.silent = true});
  double last = std::abs(plant.state().dq[0]);
  for (int i = 0; i < 5000; ++i) {
    loop.tick();
    const double speed = std::abs(plant.state().dq[0]);
    ASSERT_LE(speed, 3.01) << i;
    // Two ticks on their way, and the drive's own pace of obeying.
    ASSERT_TRUE(i <= 30 || speed <= last + 1e-6) << "gains energy from us, tick " << i;
    ASSERT_FALSE(i > 20 && loop.out->drive_enabled[0]);
    last = speed;
  }
  EXPECT_EQ(loop.mode(), Mode::fault_latched);
  EXPECT_NE(plant.drive(0).state(), DeviceState::enabled);
}

INSTANTIATE_TEST_SUITE_P(EveryProtocol, LostDrive,
                         testing::Values(std::size_t{0}, std::size_t{2}, std::size_t{3}, kLeftWristPitch,
                                         kRightShoulder, kRightElbow, kRightWristRoll),
                         [](const auto& joint) { return dual_arm().joints[joint.param].name; });

TEST(LostDrive, OfOneArmLeavesTheOtherArmWhereItIs) {
  const config::RobotConfig robot = dual_arm();
  RobotPlant plant = std::move(*RobotPlant::make(robot));
  test::WholeLoop loop(robot, plant);
  loop.run(1000);  // it was moved where it hangs: a jump blocks arming for half a second
  ASSERT_TRUE(loop.arm()) << loop.out->record.header.causes_active;
  // The elbow moves while its line falls silent; the left arm holds its home.
  loop.pose[kRightElbow] += 0.8F;
  for (int i = 0; i < 4000 && std::abs(plant.state().dq[kRightElbow]) < 0.5; ++i) loop.tick();
  ASSERT_GT(std::abs(plant.state().dq[kRightElbow]), 0.4);
  const Eigen::VectorXd before = plant.state().q;
  plant.set_line(kRightElbow, {.silent = true});
  double farthest = 0, elbow_fastest = 0;
  int rests_after = -1;
  for (int i = 0; i < 8000; ++i) {
    loop.tick();
    for (Eigen::Index j = 0; j < 6; ++j) farthest = std::max(farthest, std::abs(plant.state().q[j] - before[j]));
    if (i > 60) elbow_fastest = std::max(elbow_fastest, std::abs(plant.state().dq[kRightElbow]));
    if (rests_after < 0 && loop.out->setpoints[0].kp > 0 && loop.mode() == Mode::fault_latched) rests_after = i;
  }
  ASSERT_EQ(loop.mode(), Mode::fault_latched);
  EXPECT_LT(farthest, 0.02) << "rad, the healthy arm";
  EXPECT_LT(elbow_fastest, 0.05) << "rad/s; its brake holds it";
  EXPECT_GT(rests_after, 0);
  EXPECT_LT(rests_after, 5000) << "ms until what is left holds";
  EXPECT_FALSE(loop.out->drive_enabled[kRightElbow]);
  EXPECT_TRUE(loop.out->drive_enabled[kRightShoulder]);
}

// The same robot as ever: five protocols, loops closed on either side, still follow their policy.
TEST(WholeLoop, EveryProtocolFollows) {
  const config::RobotConfig robot = dual_arm();
  RobotPlant plant = std::move(*RobotPlant::make(robot));
  test::WholeLoop loop(robot, plant);
  ASSERT_TRUE(loop.arm());
  for (float& q : loop.pose) q += 0.3F;
  loop.run(4000);
  ASSERT_EQ(loop.mode(), Mode::tracking);
  for (std::size_t j = 0; j < loop.pose.size(); ++j)
    EXPECT_NEAR(plant.state().q[static_cast<Eigen::Index>(j)], loop.pose[j], 0.02) << robot.joints[j].name;
  EXPECT_LT(plant.state().dq.cwiseAbs().maxCoeff(), 0.1);
}

// Joints on flywheels, and a base that only tells whether it hangs.
class Hung final : public Dynamics {
 public:
  Hung(std::size_t joints, bool& hangs) : wheels_(std::vector<double>(joints, 0.1)), hangs_(hangs) {}
  void integrate(ArmState& state, const Eigen::VectorXd& tau, const std::vector<Friction>& friction,
                 Duration step) override {
    wheels_.integrate(state, tau, friction, step);
  }
  void hoist(bool hangs) override { hangs_ = hangs; }

 private:
  FreeInertias wheels_;
  bool& hangs_;
};

// Goal: the hoist catches no robot that loses a drive while it stands by itself; one that lies there is hung again for
// the next attempt. Method: armed, one drive's supply fails for a moment; a person takes the power of all; armed
// again.
TEST(Hoist, LetsGoOfAnArmedRobotAndTakesUpOneWithoutPower) {
  const config::RobotConfig robot = dual_arm();
  bool hangs = false;
  Plant plant = Plant::make(robot, std::make_unique<Hung>(robot.joints.size(), hangs)).value();
  test::WholeLoop loop(robot, plant);
  loop.run(500);
  EXPECT_TRUE(hangs) << "disabled since the start";
  ASSERT_TRUE(loop.arm());
  EXPECT_FALSE(hangs);
  plant.drive(kRightElbow).power_cycle(plant.now());
  for (int i = 0; i < 5000; ++i) {
    loop.tick();
    ASSERT_FALSE(hangs) << "tick " << i << " after the loss of one drive";
  }
  loop.tick(OperatorRequest::deenergise);  // what hangs on the lost drive swings on, so that a reset is refused
  MonoTime powerless;
  for (int i = 0; i < 10'000 && !hangs; ++i) {
    loop.tick();
    std::size_t disabled = 0;
    for (std::size_t j = 0; j < plant.joint_count(); ++j) disabled += plant.drive(j).brake_engaged() ? 1U : 0U;
    if (disabled == plant.joint_count() && !powerless.is_set()) powerless = plant.now();
  }
  ASSERT_TRUE(hangs);
  ASSERT_TRUE(powerless.is_set());
  EXPECT_NEAR((plant.now() - powerless).seconds(), kTakenUpAfter.seconds(), 0.01);
  loop.run(1000);  // it was moved where it hangs: a jump blocks arming for half a second
  ASSERT_TRUE(loop.arm()) << loop.out->record.header.causes_active;
  EXPECT_FALSE(hangs) << "and is let go again";
}

}  // namespace
}  // namespace takt::simulation

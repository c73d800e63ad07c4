// SPDX-License-Identifier: Apache-2.0
// Goal: host driver and simulated arm work together: the loop closes, in joint units, and the drive's own watchdog is
// there when the host is not.
// Method: MitDriver and RobotPlant in virtual time, frames handed over by function call; replies reach the host one
// step later, as on the bus.
#include "simulation/robot_plant.hpp"

#include <gtest/gtest.h>

#include <algorithm>
#include <array>
#include <cmath>
#include <cstring>

#include "drivers/protocol/protocol_table.hpp"
#include "simulation/arm_dynamics.hpp"
#include "tests/simulation/plant_robots.hpp"

namespace takt::simulation {
namespace {

class Loop {
 public:
  explicit Loop(const config::RobotConfig& robot)
      : robot_(robot), model_(ArmDynamics::make(robot).value()), arm(std::move(*RobotPlant::make(robot))) {
    for (std::size_t joint = 0; joint < robot_.joints.size(); ++joint)
      hosts.push_back(std::move(*drivers::make_joint_driver(robot_, joint)));
    // Standby, until the drives' settings have been read back.
    for (int ms = 0; ms < 30; ++ms) tick(false, std::vector<drivers::DriveSetpoint>(hosts.size()));
  }
  // One millisecond: commands out, answers in, arm forward.
  void tick(bool enable, const std::vector<drivers::DriveSetpoint>& setpoints) {
    for (std::size_t joint = 0; joint < hosts.size(); ++joint) {
      std::array<drivers::CanFrame, drivers::kMaxFramesPerDrive> out;
      const std::size_t count = hosts[joint]->encode(enable, setpoints[joint], {}, {}, out);
      Frames answers;
      for (std::size_t i = 0; i < count; ++i) arm.receive(robot_.joints[joint].bus, out[i], answers);
      for (const drivers::CanFrame& answer : answers) hosts[joint]->decode({answer, arm.now()});
    }
    arm.step();
  }
  bool all(DriveState state) const {
    return std::ranges::all_of(hosts, [state](const auto& host) { return host->feedback().drive_state == state; });
  }
  Eigen::VectorXd gravity_torque() { return model_->gravity_torque(arm.state().q); }
  // Impedance about home with gravity carried, as the executive would ask for.
  std::vector<drivers::DriveSetpoint> hold_home() {
    const Eigen::VectorXd gravity = gravity_torque();
    std::vector<drivers::DriveSetpoint> setpoints;
    for (std::size_t i = 0; i < hosts.size(); ++i) {
      const config::Joint& joint = robot_.joints[i];
      setpoints.push_back({static_cast<float>(joint.home), 0, static_cast<float>(joint.kp),
                           static_cast<float>(joint.kd), static_cast<float>(gravity[static_cast<Eigen::Index>(i)])});
    }
    return setpoints;
  }
  double furthest_from_home() const {
    double worst = 0;
    for (std::size_t i = 0; i < hosts.size(); ++i)
      worst = std::max(worst, std::abs(arm.state().q[static_cast<Eigen::Index>(i)] - robot_.joints[i].home));
    return worst;
  }

 private:
  config::RobotConfig robot_;
  std::unique_ptr<ArmDynamics> model_;  // the arm's own, of a pose

 public:
  RobotPlant arm;
  std::vector<std::unique_ptr<drivers::JointDriver>> hosts;
};

const std::vector<drivers::DriveSetpoint> kNothing(6);
constexpr int kSetUpTicks = 20;  // until every drive was asked what it is, and is enabled

TEST(RobotPlant, StandbyReportsTheHomePoseAndDoesNotFall) {
  Loop loop(test::demo_arm());
  for (int ms = 0; ms < 5000; ++ms) loop.tick(false, kNothing);
  EXPECT_TRUE(loop.all(DriveState::disabled));
  EXPECT_LT(loop.furthest_from_home(), 0.002) << "held by the brakes";
  for (std::size_t i = 0; i < 6; ++i)
    EXPECT_NEAR(loop.hosts[i]->feedback().q, test::demo_arm().joints[i].home, 0.003) << i;
}

TEST(RobotPlant, EnablesAndHoldsTheHomePose) {
  Loop loop(test::demo_arm());
  for (int ms = 0; ms < kSetUpTicks; ++ms) loop.tick(true, loop.hold_home());
  EXPECT_TRUE(loop.all(DriveState::enabled));
  for (int ms = 0; ms < 3000; ++ms) loop.tick(true, loop.hold_home());
  EXPECT_LT(loop.furthest_from_home(), 0.005);
  EXPECT_LT(loop.arm.state().dq.cwiseAbs().maxCoeff(), 0.05);
}

TEST(RobotPlant, WithoutGravityTorqueItSagsAsFarAsStiffnessAllows) {
  const config::RobotConfig robot = test::demo_arm();
  Loop loop(robot);
  for (int ms = 0; ms < 3000; ++ms) {
    auto setpoints = loop.hold_home();
    for (auto& setpoint : setpoints) setpoint.tau = 0;
    loop.tick(true, setpoints);
  }
  // Shoulder: the sag balances the gravity torque, within the Coulomb friction.
  const double sag = robot.joints[1].home - loop.arm.state().q[1];
  const double gravity = loop.gravity_torque()[1];
  EXPECT_NEAR(sag * robot.joints[1].kp, gravity, robot.simulation->coulomb + 0.2);
  EXPECT_GT(std::abs(gravity), 0.5);
}

TEST(RobotPlant, FollowsAStepOfOneJointAndNoOther) {
  Loop loop(test::demo_arm());
  for (int ms = 0; ms < 5; ++ms) loop.tick(true, loop.hold_home());
  for (int ms = 0; ms < 3000; ++ms) {
    auto setpoints = loop.hold_home();
    setpoints[2].q += 0.3F;  // the elbow, whose motor turns the other way
    loop.tick(true, setpoints);
  }
  EXPECT_NEAR(loop.arm.state().q[2], -1.2 + 0.3, 0.005);
  EXPECT_NEAR(loop.arm.state().q[1], 0.6, 0.005);
  EXPECT_NEAR(loop.hosts[2]->feedback().q, -0.9, 0.005);
}

TEST(RobotPlant, DirectionOffsetAndGearAreTheSameThingOnBothSides) {
  config::RobotConfig robot = test::demo_arm();
  for (std::size_t i = 0; i < robot.joints.size(); ++i) {
    robot.joints[i].drive.position_after_power_up = config::PositionAfterPowerUp::absolute;
    robot.joints[i].drive.direction = i % 2 == 0 ? -1 : 1;
    robot.joints[i].drive.offset = 0.1 * static_cast<double>(i) - 0.2;
    robot.joints[i].drive.gear_ratio = 1 + 0.5 * static_cast<double>(i % 3);
  }
  Loop loop(robot);
  for (int ms = 0; ms < 3000; ++ms) loop.tick(true, loop.hold_home());
  EXPECT_LT(loop.furthest_from_home(), 0.01);
  const Eigen::VectorXd gravity = loop.gravity_torque();
  for (std::size_t i = 0; i < 6; ++i) {
    EXPECT_NEAR(loop.hosts[i]->feedback().q, loop.arm.state().q[static_cast<Eigen::Index>(i)], 0.002) << i;
    EXPECT_NEAR(loop.hosts[i]->feedback().tau, gravity[static_cast<Eigen::Index>(i)], 1.0) << i;
  }
}

TEST(RobotPlant, WhenTheHostFallsSilentTheDrivesStopByThemselves) {
  Loop loop(test::demo_arm());
  std::vector<drivers::DriveSetpoint> push = loop.hold_home();
  for (int ms = 0; ms < 200; ++ms) {
    push = loop.hold_home();
    push[0].dq = 2;
    push[0].kp = 0;  // the base turns
    loop.tick(true, push);
  }
  ASSERT_GT(loop.arm.state().dq[0], 0.5);
  for (int ms = 0; ms < 101; ++ms) loop.arm.step();
  for (std::size_t i = 0; i < 6; ++i) EXPECT_EQ(loop.arm.drive(i).state(), DeviceState::lost) << i;
  for (int ms = 0; ms < 3000; ++ms) loop.arm.step();
  EXPECT_LT(std::abs(loop.arm.state().dq[0]), 0.02);
  loop.tick(true, kNothing);
  EXPECT_TRUE(loop.all(DriveState::fault));
  EXPECT_EQ(loop.hosts[0]->feedback().error_code, 0xDU);
  // The operator disables: the host clears the error, and the drives may be enabled again.
  for (int ms = 0; ms < 5; ++ms) loop.tick(false, kNothing);
  EXPECT_TRUE(loop.all(DriveState::disabled));
  for (int ms = 0; ms < 60; ++ms) loop.tick(true, kNothing);  // their time-outs are written and read back first
  EXPECT_TRUE(loop.all(DriveState::enabled));
}

TEST(RobotPlant, TorqueArrivesOneStepLate) {
  config::RobotConfig robot = test::demo_arm();
  robot.model->gravity = {0, 0, 0};
  robot.simulation->coulomb = 0;
  Loop loop(robot);
  for (int ms = 0; ms < kSetUpTicks; ++ms) loop.tick(true, kNothing);
  const Eigen::VectorXd before = loop.arm.state().dq;
  std::vector<drivers::DriveSetpoint> push(6);
  push[0].tau = 10;
  loop.tick(true, push);
  EXPECT_NEAR(loop.arm.state().dq[0], before[0], 1e-3) << "computed, not yet there";
  loop.tick(true, push);
  EXPECT_GT(loop.arm.state().dq[0], before[0] + 0.01);
}

TEST(RobotPlant, TheEncoderReportsItsGrid) {
  config::RobotConfig robot = test::demo_arm();
  robot.simulation->encoder_step = 0.1;
  Loop loop(robot);
  ArmState state = loop.arm.state();
  state.q[0] = 0.234;
  loop.arm.set_state(state);
  for (int ms = 0; ms < 3; ++ms) loop.tick(false, kNothing);
  EXPECT_NEAR(loop.hosts[0]->feedback().q, 0.2, 1e-3);
}

TEST(RobotPlant, SameInputsSameBits) {
  const auto run = [] {
    Loop loop(test::demo_arm());
    for (int ms = 0; ms < 500; ++ms) loop.tick(ms > 50, loop.hold_home());
    return loop.arm.state();
  };
  const ArmState a = run();
  const ArmState b = run();
  EXPECT_EQ(std::memcmp(a.q.data(), b.q.data(), 6 * sizeof(double)), 0);
  EXPECT_EQ(std::memcmp(a.dq.data(), b.dq.data(), 6 * sizeof(double)), 0);
}

TEST(RobotPlant, AFrameOnTheWrongBusReachesNobody) {
  Loop loop(test::demo_arm());
  drivers::CanFrame frame;
  frame.id = 1;
  frame.length = 8;
  Frames answers;
  EXPECT_TRUE(loop.arm.receive(0, frame, answers));
  EXPECT_FALSE(loop.arm.receive(1, frame, answers));
  frame.id = 0x7FF;
  EXPECT_FALSE(loop.arm.receive(0, frame, answers));
  EXPECT_EQ(answers.size(), 1U);
}

TEST(RobotPlant, RefusesARobotItCannotSimulate) {
  config::RobotConfig robot = test::demo_arm();
  robot.simulation.reset();
  EXPECT_FALSE(RobotPlant::make(robot));
}

}  // namespace
}  // namespace takt::simulation

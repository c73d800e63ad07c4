// SPDX-License-Identifier: Apache-2.0
// Goal: host driver and simulated drive, written apart from each other, agree: the loop closes in joint units, a fault
// reaches the host and is cleared by disabling, and a drive without its host stops by itself.
// Method: one joint behind each protocol in virtual time (drive_loop.hpp), geared, reversed and offset. One row a
// protocol.
#include "tests/simulation/drive_loop.hpp"

#include <algorithm>
#include <cmath>
#include <cstdio>
#include <random>

namespace takt::drivers {
namespace {

using test::DriveLoop;

struct Row {
  const char* name;
  config::Drive drive;
  std::uint32_t over_temperature;  // error codes as the host reports them
  std::uint32_t watchdog_expired;
};

config::Drive common(config::DriveProtocol protocol) {
  config::Drive drive;
  drive.protocol = protocol;
  drive.id = 3;
  drive.direction = -1;
  drive.gear_ratio = 2;
  drive.offset = 0.3;
  drive.torque_range = 6;
  return drive;
}

Row odrive() {
  Row row{"odrive", common(config::DriveProtocol::odrive), 0x2000, 0x0100'0000};
  row.drive.watchdog_waiver = "the simulated drive's is set";
  return row;
}

// Wanted are 10 Nm/rad and 0.75 Nm s/rad at the motor: within the servo's gains, and beyond them.
Row moteus(const char* name, double servo_kp, double servo_kd) {
  Row row{name, common(config::DriveProtocol::moteus), 38, 11};
  row.drive.servo_kp = servo_kp;
  row.drive.servo_kd = servo_kd;
  return row;
}

class DriveLoopTest : public testing::TestWithParam<Row> {
 protected:
  static constexpr DriveSetpoint at(double q) {
    return {.q = static_cast<float>(q), .dq = 0, .kp = 40, .kd = 3, .tau = 0};
  }
  void enable() { ASSERT_GE(loop.ticks_until(DriveState::enabled, true, at(loop.joint_q())), 0); }
  DriveLoop loop{GetParam().drive, milliseconds(50)};
};

TEST_P(DriveLoopTest, StandbyReportsOncePerTickAndHoldsTheBrake) {
  for (int ms = 0; ms < 20; ++ms) loop.tick(false);
  const int before = loop.host->feedback().replies;
  for (int ms = 0; ms < 50; ++ms) loop.tick(false);
  EXPECT_EQ(loop.host->feedback().replies - before, 50);
  EXPECT_EQ(loop.host->feedback().drive_state, DriveState::disabled);
  EXPECT_TRUE(loop.device->brake_engaged());
  EXPECT_NEAR(loop.host->feedback().q, loop.joint_q(), 1e-3);
}

TEST_P(DriveLoopTest, EnablesAndFollowsInJointUnits) {
  for (int ms = 0; ms < 20; ++ms) loop.tick(false);
  enable();
  EXPECT_EQ(loop.device->state(), simulation::DeviceState::enabled);
  for (int ms = 0; ms < 1500; ++ms) loop.tick(true, at(0.9));
  EXPECT_NEAR(loop.joint_q(), 0.9, 2e-3);
  EXPECT_NEAR(loop.host->feedback().q, 0.9, 2e-3);
}

TEST_P(DriveLoopTest, StiffnessAndTorqueAreTheSetpointsOwn) {
  enable();
  // A load of 1.5 Nm at the motor is -3 Nm at the joint (ratio -2): at 40 Nm/rad it gives way by 0.075 rad, and a
  // feed-forward of +3 Nm carries it.
  loop.load = 1.5;
  for (int ms = 0; ms < 1500; ++ms) loop.tick(true, at(0.3));
  EXPECT_NEAR(loop.joint_q(), 0.3 - 0.075, 2e-3);
  DriveSetpoint carried = at(0.3);
  carried.tau = 3;
  for (int ms = 0; ms < 1500; ++ms) loop.tick(true, carried);
  EXPECT_NEAR(loop.joint_q(), 0.3, 2e-3);
  EXPECT_NEAR(loop.host->feedback().tau, 3, 0.05);
}

TEST_P(DriveLoopTest, DampingAloneStopsTheJoint) {
  enable();
  loop.motor_dq = 4;
  for (int ms = 0; ms < 300; ++ms) loop.tick(true, {.q = 0, .dq = 0, .kp = 0, .kd = 3, .tau = 0});
  // J at the joint 0.08 kg m^2, 3 Nm s/rad: a time constant of 27 ms.
  EXPECT_NEAR(loop.joint_dq(), 0, 0.01);
}

TEST_P(DriveLoopTest, AFaultReachesTheHostAndDisablingClearsIt) {
  enable();
  for (int ms = 0; ms < 50; ++ms) loop.tick(true, at(0.3));
  ASSERT_TRUE(loop.device->inject(simulation::DeviceFault::over_temperature));
  ASSERT_GE(loop.ticks_until(DriveState::fault, true, at(0.3)), 0);
  for (int ms = 0; ms < 600; ++ms) {
    loop.tick(true, at(0.3));
    ASSERT_EQ(loop.host->feedback().drive_state, DriveState::fault) << "stays until disabled";
    ASSERT_EQ(loop.host->feedback().error_code, GetParam().over_temperature);
    ASSERT_EQ(loop.torque, 0);
  }
  EXPECT_EQ(error_name(GetParam().drive, GetParam().over_temperature).find("error code"), std::string::npos);
  ASSERT_GE(loop.ticks_until(DriveState::disabled, false), 0);
  for (int ms = 0; ms < 20; ++ms) loop.tick(false);
  EXPECT_EQ(loop.host->feedback().error_code, 0U);
  enable();
}

TEST_P(DriveLoopTest, WithoutItsHostTheDriveStopsByItself) {
  enable();
  for (int ms = 0; ms < 100; ++ms) loop.tick(true, {.q = 0, .dq = 2, .kp = 0, .kd = 3, .tau = 0}, milliseconds(50));
  ASSERT_GT(loop.joint_dq(), 1);
  for (int ms = 0; ms < 51; ++ms) loop.silent_tick();
  EXPECT_EQ(loop.device->state(), simulation::DeviceState::lost);
  for (int ms = 0; ms < 500; ++ms) loop.silent_tick();
  EXPECT_NEAR(loop.joint_dq(), 0, 0.01);
  // The host returns, still wanting to drive: refused, told why, and cleared by disabling only.
  ASSERT_GE(loop.ticks_until(DriveState::fault, true, at(0.3)), 0);
  for (int ms = 0; ms < 600; ++ms) loop.tick(true, at(0.3));
  EXPECT_EQ(loop.host->feedback().drive_state, DriveState::fault);
  EXPECT_EQ(loop.host->feedback().error_code, GetParam().watchdog_expired);
  EXPECT_EQ(loop.device->state(), simulation::DeviceState::lost);
  ASSERT_GE(loop.ticks_until(DriveState::disabled, false), 0);
  for (int ms = 0; ms < 20; ++ms) loop.tick(false);
  enable();
}

// A supply that blinks leaves a drive that would obey: it must wait for the operator all the same.
TEST_P(DriveLoopTest, ADriveThatRestartedIsNotEnabledAgain) {
  enable();
  for (int ms = 0; ms < 100; ++ms) loop.tick(true, at(0.3));
  loop.device->power_cycle(loop.now);
  for (int ms = 0; ms < 1500; ++ms) {
    loop.tick(true, at(0.3));
    ASSERT_NE(loop.device->state(), simulation::DeviceState::enabled) << ms;
  }
  EXPECT_NE(loop.host->feedback().drive_state, DriveState::enabled);
  for (int ms = 0; ms < 50; ++ms) loop.tick(false);
  enable();
}

// Goal: who wants ideal drives in a simulation has them: a moteus, whose every number is a float, with gains of its
// own servo. Method: setpoints drawn at random against the servo law at the motor, at the instant when the drive acts.
TEST(IdealDrive, AMoteusGivesWhatTheServoLawSays) {
  DriveLoop loop(moteus("ideal", 40, 10).drive, milliseconds(50));
  ASSERT_GE(loop.ticks_until(DriveState::enabled, true, {.q = static_cast<float>(loop.joint_q())}), 0);
  std::mt19937 random(1);
  std::uniform_real_distribution<float> share(0.0F, 1.0F);
  double farthest = 0;
  for (int ms = 0; ms < 2000; ++ms) {
    const DriveSetpoint setpoint{.q = 0.3F + 0.1F * share(random),
                                 .dq = 0,
                                 .kp = 20 + 20 * share(random),
                                 .kd = 2 * share(random),
                                 .tau = share(random) - 0.5F};
    const double q = loop.joint_q(), dq = loop.joint_dq();
    loop.tick(true, setpoint);
    const double at_joint = static_cast<double>(setpoint.kp) * (static_cast<double>(setpoint.q) - q) -
                            static_cast<double>(setpoint.kd) * dq + static_cast<double>(setpoint.tau);
    farthest = std::max(farthest, std::abs(loop.torque - at_joint / -2.0));
  }
  std::printf("a moteus is %.2g Nm from the servo law at most\n", farthest);
  EXPECT_LT(farthest, 1e-4);
}

INSTANTIATE_TEST_SUITE_P(EveryProtocol, DriveLoopTest,
                         testing::Values(odrive(), moteus("moteus", 20, 1), moteus("moteus_with_weak_gains", 7, 0.5)),
                         [](const auto& row) { return row.param.name; });

}  // namespace
}  // namespace takt::drivers

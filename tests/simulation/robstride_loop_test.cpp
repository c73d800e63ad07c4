// SPDX-License-Identifier: Apache-2.0
// Goal: host driver and simulated drive, each written from the protocol alone, work together: set-up, enabling,
// following a position, a fault and its clearing, the drive's own watchdog when the host falls silent. Method: a
// turning mass behind the drive, both sides stepped in virtual time, one tick of delay for what the drive says.
#include <gtest/gtest.h>

#include <array>
#include <cmath>

#include "drivers/protocol/protocol_table.hpp"
#include "drivers/protocol/robstride/robstride_driver.hpp"
#include "simulation/device_table.hpp"

namespace takt::drivers {
namespace {

constexpr Duration kTick = milliseconds(1);
constexpr double kInertia = 0.05;  // kg m^2, motor side

config::RobotConfig one_joint() {
  config::RobotConfig robot;
  config::Joint joint;
  joint.name = "knee";
  joint.drive.protocol = config::DriveProtocol::robstride;
  joint.drive.id = 9;
  joint.drive.host_id = 253;
  joint.drive.direction = -1;
  joint.drive.gear_ratio = 2;
  joint.drive.offset = 0.3;
  joint.drive.position_range = 12.566370614359172;
  joint.drive.velocity_range = 30;
  joint.drive.torque_range = 12;
  joint.drive.kp_range = 500;
  joint.drive.kd_range = 5;
  robot.joints = {joint};
  return robot;
}

class RobstrideLoop : public testing::Test {
 protected:
  // Both sides live one tick. `host`: false: the host is silent.
  void tick(bool enable, const DriveSetpoint& setpoint = {}, bool host = true) {
    now_ = now_ + kTick;
    for (const CanFrame& frame : on_the_wire_) EXPECT_TRUE(driver_->decode({frame, now_}));
    on_the_wire_.clear();
    if (host) {
      const std::size_t count = driver_->encode(enable, setpoint, {}, {}, out_);
      for (std::size_t i = 0; i < count; ++i) device_->receive(out_[i], now_, on_the_wire_);
    }
    torque_ = device_->update({motor_.position, motor_.velocity}, now_, kTick, on_the_wire_);
    if (device_->brake_engaged()) motor_.velocity = 0;
    motor_.velocity += torque_ / kInertia * kTick.seconds();
    motor_.position += motor_.velocity * kTick.seconds();
  }
  void ticks(int count, bool enable, const DriveSetpoint& setpoint = {}, bool host = true) {
    for (int i = 0; i < count; ++i) tick(enable, setpoint, host);
  }
  [[nodiscard]] const JointFeedback& feedback() const { return driver_->feedback(); }
  [[nodiscard]] double joint_position() const { return motor_.position / -2 + 0.3; }
  // Joint side: kp / 4 and kd / 4 on the motor's.
  static constexpr DriveSetpoint kThere{.q = 0.8F, .dq = 0, .kp = 200, .kd = 12, .tau = 0};

  config::RobotConfig robot_ = one_joint();
  std::unique_ptr<JointDriver> driver_ = make_joint_driver(robot_, 0).value();
  std::unique_ptr<simulation::Device> device_ = simulation::make_device(robot_.joints[0].drive, milliseconds(50));
  std::array<CanFrame, kMaxFramesPerDrive> out_;
  simulation::Frames on_the_wire_;
  simulation::MotorReading motor_;
  double torque_ = 0;
  MonoTime now_{1};
};

TEST_F(RobstrideLoop, SetsUpEnablesAndFollows) {
  ticks(40, false);
  EXPECT_EQ(feedback().drive_state, DriveState::disabled);
  EXPECT_EQ(feedback().replies, 39) << "one report per tick, set-up or not";
  EXPECT_EQ(dynamic_cast<RobstrideDriver&>(*driver_).stored_timeout(), milliseconds(50));
  EXPECT_NEAR(feedback().q, 0.3, 1e-3) << "the joint's offset";
  ticks(3, true, kThere);
  EXPECT_EQ(feedback().drive_state, DriveState::enabled);
  ticks(1000, true, kThere);
  EXPECT_NEAR(joint_position(), 0.8, 2e-3);
  EXPECT_NEAR(feedback().q, joint_position(), 1e-3);
  EXPECT_NEAR(feedback().dq, 0, 1e-2);
  EXPECT_EQ(feedback().drive_state, DriveState::enabled);
  ticks(2, false);
  EXPECT_EQ(feedback().drive_state, DriveState::disabled);
  EXPECT_EQ(torque_, 0);
}

TEST_F(RobstrideLoop, AFaultStopsIsReportedAndClearsInStandby) {
  ticks(40, false);
  ticks(20, true, kThere);
  ASSERT_TRUE(device_->inject(simulation::DeviceFault::over_temperature));
  ticks(3, true, kThere);
  EXPECT_EQ(feedback().drive_state, DriveState::fault);
  EXPECT_NE(error_name(robot_.joints[0].drive, feedback().error_code).find("over-temperature"), std::string::npos);
  ticks(20, true, kThere);
  EXPECT_EQ(feedback().drive_state, DriveState::fault) << "nobody clears it while the robot is to move";
  EXPECT_EQ(torque_, 0);
  ticks(5, false);
  EXPECT_EQ(feedback().drive_state, DriveState::disabled);
  EXPECT_EQ(feedback().error_code, 0U);
  ticks(40, true, kThere);
  EXPECT_EQ(feedback().drive_state, DriveState::enabled);
}

TEST_F(RobstrideLoop, TheDriveStopsByItselfWhenTheHostFallsSilentAndStaysStopped) {
  ticks(40, false);
  ticks(20, true, kThere);
  ticks(60, true, kThere, false);
  EXPECT_EQ(device_->state(), simulation::DeviceState::lost);
  ticks(20, true, kThere);
  EXPECT_EQ(feedback().drive_state, DriveState::disabled);
  EXPECT_EQ(device_->state(), simulation::DeviceState::lost) << "commands alone do not bring it back";
  ticks(2, false);
  ticks(40, true, kThere);
  EXPECT_EQ(feedback().drive_state, DriveState::enabled) << "the operator does";
}

TEST_F(RobstrideLoop, ADriveInAnotherRunModeIsPutRightBeforeItIsEnabled) {
  CanFrame speed_mode = encode_robstride_setting({9, 0xFD}, RobstrideParameter::run_mode, 2);
  simulation::Frames ignored;
  device_->receive(speed_mode, now_, ignored);
  ticks(60, true, kThere);
  EXPECT_EQ(feedback().drive_state, DriveState::enabled);
  EXPECT_NE(torque_, 0) << "obeys motion commands";
}

// A RobStride forgets its time-out with its supply: were it not told again, the second run would have none.
TEST_F(RobstrideLoop, ADriveThatWasWithoutPowerIsToldItsTimeoutAgain) {
  ticks(40, false);
  device_->power_cycle(now_);
  ticks(300, false);
  ticks(40, true, kThere);
  ASSERT_EQ(feedback().drive_state, DriveState::enabled);
  ticks(60, true, kThere, false);
  EXPECT_EQ(device_->state(), simulation::DeviceState::lost);
}

}  // namespace
}  // namespace takt::drivers

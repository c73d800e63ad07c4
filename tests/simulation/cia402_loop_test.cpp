// SPDX-License-Identifier: Apache-2.0
// Goal: host and drive, each written from the standard alone, understand each other: set-up, enable, follow, faults,
// reboots, lost frames, a host that dies.
// Method: driver and simulated drive in virtual time, 1 ms ticks, every frame handed over by hand; a free mass of known
// inertia on the motor's shaft. Frames are dropped by rule, never by chance.
#include <gtest/gtest.h>

#include <array>
#include <cmath>
#include <functional>

#include "drivers/protocol/protocol_table.hpp"
#include "simulation/cia402_device.hpp"
#include "tests/simulation/finished_setpoint.hpp"

namespace takt::simulation {
namespace {

using config::Cia402Mode;
using drivers::CanFrame;
using drivers::DriveSetpoint;

constexpr double kInertia = 0.05;  // kg m^2, motor side

config::RobotConfig robot_of(Cia402Mode mode, std::size_t joints = 1) {
  config::RobotConfig robot;
  robot.control.period = milliseconds(1);
  robot.feedback.timeout = milliseconds(20);
  robot.joints.resize(joints);
  for (std::size_t i = 0; i < joints; ++i) {
    config::Joint& joint = robot.joints[i];
    joint.name = "joint" + std::to_string(i);
    joint.drive.protocol = config::DriveProtocol::cia402;
    joint.drive.mode = mode;
    joint.drive.id = static_cast<std::uint32_t>(5 + i);
    joint.drive.counts_per_turn = 1 << 17;
    joint.drive.rated_torque = 10;
    joint.drive.torque_range = 3;
    joint.drive.direction = -1;
    joint.drive.offset = 0.25;
    joint.limits.velocity = 5;
    joint.observer_bandwidth = 200;
  }
  return robot;
}

// One bus, its drives and their drivers.
class World {
 public:
  explicit World(Cia402Mode mode, std::size_t joints = 1) {
    const config::RobotConfig robot = robot_of(mode, joints);
    drive_ = robot.joints[0].drive;
    for (std::size_t i = 0; i < joints; ++i) {
      drives.push_back(std::make_unique<Cia402Device>(robot.joints[i].drive, milliseconds(100)));
      hosts.push_back(std::move(drivers::make_joint_driver(robot, i).value()));
      position.push_back(0);
      velocity.push_back(0);
    }
  }

  // What the host asks for, and hears; then one millisecond of the drives' world.
  void tick(bool enable, const DriveSetpoint& setpoint = {}) {
    if (host_lives) {
      for (auto& host : hosts) {
        std::array<CanFrame, drivers::kMaxFramesPerDrive> out;
        const DriveSetpoint told = test::finished(drive_, setpoint, host->feedback(), 3, 5);
        const std::size_t count = host->encode(enable, told, {}, {}, out);
        for (std::size_t i = 0; i < count; ++i)
          if (!lost(out[i])) cross(out[i]);
      }
    }
    now = now + milliseconds(1);
    for (std::size_t i = 0; i < drives.size(); ++i) {
      Frames said;
      const double torque = drives[i]->update({position[i], velocity[i]}, now, milliseconds(1), said);
      most_torque = std::max(most_torque, std::abs(torque));
      if (drives[i]->brake_engaged()) velocity[i] = 0;
      velocity[i] += torque / kInertia * 1e-3;
      position[i] += velocity[i] * 1e-3;
      for (const CanFrame& frame : said) to_hosts(frame);
    }
  }
  void run(int ticks, bool enable, const DriveSetpoint& setpoint = {}) {
    for (int i = 0; i < ticks; ++i) tick(enable, setpoint);
  }
  // Ticks until the joint reports this; -1: never.
  int run_until(DriveState wanted, bool enable, std::size_t joint = 0, const DriveSetpoint& setpoint = {}) {
    for (int i = 0; i < 5000; ++i) {
      if (hosts[joint]->feedback().drive_state == wanted) return i;
      tick(enable, setpoint);
    }
    return -1;
  }
  [[nodiscard]] const JointFeedback& feedback(std::size_t joint = 0) const { return hosts[joint]->feedback(); }
  [[nodiscard]] double joint_angle(std::size_t joint = 0) const { return -position[joint] + 0.25; }

  std::vector<std::unique_ptr<Cia402Device>> drives;
  std::vector<std::unique_ptr<drivers::JointDriver>> hosts;
  std::vector<double> position, velocity;  // motor side
  std::function<bool(const CanFrame&)> lost = [](const CanFrame&) { return false; };
  bool host_lives = true;
  double most_torque = 0;
  MonoTime now{1};

 private:
  config::Drive drive_;
  void cross(const CanFrame& frame) {
    Frames answers;
    for (auto& drive : drives) drive->receive(frame, now, answers);
    for (const CanFrame& answer : answers) to_hosts(answer);
  }
  void to_hosts(const CanFrame& frame) {
    if (lost(frame)) return;
    for (auto& host : hosts)
      if (host->decode({.frame = frame, .received_at = now})) return;
  }
};

class EveryMode : public testing::TestWithParam<Cia402Mode> {};
INSTANTIATE_TEST_SUITE_P(Modes, EveryMode, testing::Values(Cia402Mode::csp, Cia402Mode::csv, Cia402Mode::cst));

TEST_P(EveryMode, SetsUpEnablesAndFollows) {
  World world(GetParam());
  EXPECT_GT(world.run_until(DriveState::disabled, false), 0);
  EXPECT_NEAR(world.feedback().q, 0.25, 1e-4);
  EXPECT_EQ(world.drives[0]->state(), DeviceState::disabled);
  const int ticks = world.run_until(DriveState::enabled, true, 0, {.q = 0.25F});
  EXPECT_GT(ticks, 0);
  EXPECT_LT(ticks, 10);
  EXPECT_EQ(world.drives[0]->state(), DeviceState::enabled);
  EXPECT_NEAR(world.joint_angle(), 0.25, 1e-3) << "enabling moves nothing";
  world.run(3000, true, {.q = 1.25F, .kp = 8, .kd = 1.2F});
  EXPECT_NEAR(world.joint_angle(), 1.25, 0.005);
  EXPECT_NEAR(world.feedback().q, world.joint_angle(), 1e-3);
  EXPECT_NEAR(world.feedback().dq, 0, 0.01);
  EXPECT_LE(world.most_torque, 3);
  world.run(5, false);
  EXPECT_EQ(world.feedback().drive_state, DriveState::disabled);
  EXPECT_EQ(world.drives[0]->state(), DeviceState::disabled);
}

TEST_P(EveryMode, ReportsPositionOncePerTickWhetherEnabledOrNot) {
  World world(GetParam());
  world.run_until(DriveState::disabled, false);
  for (const bool enable : {false, true, false}) {
    const auto before = world.feedback().replies;
    world.run(100, enable);
    EXPECT_EQ(static_cast<std::uint8_t>(world.feedback().replies - before), 100);
  }
}

TEST_P(EveryMode, AFaultIsReportedClearedAndLeftBehind) {
  World world(GetParam());
  world.run_until(DriveState::disabled, false);
  world.run_until(DriveState::enabled, true);
  world.drives[0]->inject(DeviceFault::over_temperature);
  world.run(5, true);
  EXPECT_EQ(world.feedback().drive_state, DriveState::fault);
  EXPECT_EQ(world.feedback().error_code, 0x4310U);
  world.run(100, true);
  EXPECT_EQ(world.feedback().drive_state, DriveState::fault) << "not cleared before it is disabled";
  EXPECT_GT(world.run_until(DriveState::disabled, false), 0);
  EXPECT_EQ(world.feedback().error_code, 0U);
  EXPECT_GT(world.run_until(DriveState::enabled, true), 0);
}

TEST_P(EveryMode, ARebootInTheMiddleIsNoticedAndSetUpAgain) {
  World world(GetParam());
  world.run_until(DriveState::disabled, false);
  world.run_until(DriveState::enabled, true);
  world.drives[0]->power_cycle(world.now);
  EXPECT_GT(world.run_until(DriveState::disabled, true), 0);
  world.run(500, true);
  EXPECT_EQ(world.feedback().drive_state, DriveState::disabled) << "waits for the operator";
  EXPECT_EQ(world.drives[0]->state(), DeviceState::disabled);
  world.run(500, false);
  const auto before = world.feedback().replies;
  world.run(10, false);
  EXPECT_EQ(static_cast<std::uint8_t>(world.feedback().replies - before), 10) << "reports again";
  EXPECT_GT(world.run_until(DriveState::enabled, true), 0);
}

TEST_P(EveryMode, ASilentHostStopsTheDrive) {
  World world(GetParam());
  world.run_until(DriveState::disabled, false);
  world.run_until(DriveState::enabled, true);
  world.run(200, true, {.q = 9, .dq = 1, .kp = 2, .kd = 1, .tau = 1});
  EXPECT_GT(std::abs(world.velocity[0]), 0.1) << "it moves";
  world.host_lives = false;
  world.run(45, true);
  EXPECT_EQ(world.drives[0]->state(), DeviceState::enabled);
  world.run(10, true);
  EXPECT_EQ(world.drives[0]->state(), DeviceState::lost);
  world.run(2000, true);
  EXPECT_NEAR(world.velocity[0], 0, 0.01) << "braked";
  // The host comes back: it hears of the fault, and nothing moves until the operator disabled in between.
  world.host_lives = true;
  world.run(100, true, {.q = 9, .kp = 2, .kd = 1});
  EXPECT_EQ(world.feedback().drive_state, DriveState::fault);
  EXPECT_EQ(world.feedback().error_code, 0x8250U);
  EXPECT_EQ(world.drives[0]->state(), DeviceState::lost);
  EXPECT_GE(world.run_until(DriveState::disabled, false), 0);
  EXPECT_GE(world.run_until(DriveState::enabled, true), 0);
}

// Goal: a set-up that loses every k-th answer, or every k-th question, still reaches operation.
TEST_P(EveryMode, LostSdoFramesOnlyCostTime) {
  for (const std::uint32_t id : {0x585U, 0x605U}) {
    for (const int k : {2, 3, 4, 7}) {
      World world(GetParam());
      int count = 0;
      world.lost = [&count, id, k](const CanFrame& frame) { return frame.id == id && ++count % k == 0; };
      EXPECT_GT(world.run_until(DriveState::disabled, false), 0) << id << " " << k;
      EXPECT_GT(count, 20);
      EXPECT_GT(world.run_until(DriveState::enabled, true), 0) << id << " " << k;
    }
  }
}

TEST(Cia402Loop, LostCyclicFramesDoNotEndOperation) {
  World world(Cia402Mode::cst);
  world.run_until(DriveState::disabled, false);
  int count = 0;
  world.lost = [&count](const CanFrame& frame) {
    const bool cyclic = frame.id == 0x185 || frame.id == 0x205 || frame.id == 0x080;
    return cyclic && ++count % 5 == 0;
  };
  EXPECT_GT(world.run_until(DriveState::enabled, true), 0);
  world.run(3000, true, {.q = 1.25F, .kp = 8, .kd = 1.2F});
  EXPECT_EQ(world.feedback().drive_state, DriveState::enabled);
  EXPECT_NEAR(world.joint_angle(), 1.25, 0.01);
}

TEST(Cia402Loop, ALostNmtStartIsSentAgain) {
  World world(Cia402Mode::cst);
  int starts = 0;
  world.lost = [&starts](const CanFrame& frame) { return frame.id == 0 && frame.data[0] == 1 && ++starts == 1; };
  EXPECT_GT(world.run_until(DriveState::disabled, false), 0);
  EXPECT_GE(starts, 2);
}

TEST(Cia402Loop, ADriveThatIsSwitchedOnLaterIsFound) {
  World world(Cia402Mode::cst);
  world.drives[0]->power_cycle(MonoTime{10'000'000'000});  // ten seconds from now
  EXPECT_GT(world.run_until(DriveState::fault, false), 0);
  EXPECT_EQ(drivers::kind_of(world.feedback().error_code), drivers::SetupFault::settings_unread);
  world.run(10'300 - static_cast<int>(world.now.ns / 1'000'000), false);
  EXPECT_GE(world.run_until(DriveState::disabled, false), 0);
  EXPECT_EQ(world.feedback().error_code, 0U);
}

TEST(Cia402Loop, AnotherRatedTorqueIsASettingThatDiffers) {
  World world(Cia402Mode::cst);
  config::Drive other = robot_of(Cia402Mode::cst).joints[0].drive;
  other.rated_torque = 11;
  world.drives[0] = std::make_unique<Cia402Device>(other, milliseconds(100));
  EXPECT_GT(world.run_until(DriveState::fault, false), 0);
  EXPECT_EQ(drivers::kind_of(world.feedback().error_code), drivers::SetupFault::settings_differ);
  world.run(2000, true);
  EXPECT_EQ(world.drives[0]->state(), DeviceState::disabled);
}

// Goal: drives of one bus do not need one another: SYNC goes on while one is missing, reboots or is faulty.
TEST(Cia402Loop, OneSyncServesTheBus) {
  World world(Cia402Mode::cst, 3);
  world.drives[2]->power_cycle(MonoTime{10'000'000'000});  // the SYNC sender's own drive is not there
  EXPECT_GT(world.run_until(DriveState::disabled, false, 0), 0);
  EXPECT_GE(world.run_until(DriveState::disabled, false, 1), 0);
  int syncs = 0;
  world.lost = [&syncs](const CanFrame& frame) {
    syncs += frame.id == 0x080;
    return false;
  };
  const auto before = world.feedback(0).replies;
  world.run(50, false);
  EXPECT_EQ(syncs, 50);
  EXPECT_EQ(static_cast<std::uint8_t>(world.feedback(0).replies - before), 50);
  EXPECT_NE(world.feedback(2).drive_state, DriveState::disabled);
}

}  // namespace
}  // namespace takt::simulation

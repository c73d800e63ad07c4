// SPDX-License-Identifier: Apache-2.0
// One joint in virtual time: host driver and simulated drive of one protocol, both made by their tables, with a rotor
// between them. Frames are handed over by function call; what the drive says reaches the host in the same millisecond.
#pragma once

#include <gtest/gtest.h>

#include <array>
#include <functional>
#include <memory>

#include "drivers/protocol/protocol_table.hpp"
#include "simulation/device_table.hpp"
#include "tests/simulation/finished_setpoint.hpp"

namespace takt::test {

class DriveLoop {
 public:
  static constexpr double kInertia = 0.02;  // kg m^2, motor side; frictionless
  static constexpr Duration kTick = milliseconds(1);

  DriveLoop(const config::Drive& drive, Duration watchdog) : drive_(drive) {
    config::RobotConfig robot;
    robot.control.period = kTick;
    robot.buses.push_back({.name = "bench",
                           .interface = "can0",
                           .bitrate = 1'000'000,
                           .fd = true,
                           .data_bitrate = 5'000'000,
                           .when_missing = config::WhenBusMissing::loopback});
    robot.joints.resize(1);
    robot.joints[0].name = "elbow";
    robot.joints[0].drive = drive;
    robot.joints[0].observer_bandwidth = 200;
    auto made = drivers::make_joint_driver(robot, 0);
    if (!made) throw std::runtime_error(made.error());
    host = std::move(*made);
    device = simulation::make_device(drive, watchdog);
  }

  // One millisecond: commands out, drive and rotor forward, what it said in.
  void tick(bool enable, const drivers::DriveSetpoint& setpoint = {}, Duration budget = milliseconds(100)) {
    std::array<drivers::CanFrame, drivers::kMaxFramesPerDrive> out;
    const drivers::DriveSetpoint told = finished(drive_, setpoint, host->feedback());
    const std::size_t count = host->encode(enable, told, now, now + budget, out);
    ASSERT_LE(count, out.size());
    simulation::Frames said;
    for (std::size_t i = 0; i < count; ++i)
      if (!on_the_way || on_the_way(out[i])) device->receive(out[i], now, said);
    silent_tick(said);
    for (drivers::CanFrame& frame : said)
      if (!on_the_way || on_the_way(frame)) host->decode({frame, now});
  }
  // The host is gone.
  void silent_tick() {
    simulation::Frames said;
    silent_tick(said);
  }
  // Ticks until the host reports the state; -1: not within a second.
  int ticks_until(DriveState state, bool enable, const drivers::DriveSetpoint& setpoint = {}) {
    for (int ticks = 0; ticks < 1000; ++ticks) {
      if (host->feedback().drive_state == state) return ticks;
      tick(enable, setpoint);
    }
    return -1;
  }
  double joint_q() const { return motor_q / (drive_.direction * drive_.gear_ratio) + drive_.offset; }
  double joint_dq() const { return motor_dq / (drive_.direction * drive_.gear_ratio); }

  std::unique_ptr<drivers::JointDriver> host;
  std::unique_ptr<simulation::Device> device;
  MonoTime now{1};
  double motor_q = 0, motor_dq = 0, torque = 0;  // rad, rad/s, Nm
  double load = 0;                               // Nm on the rotor from outside
  // What becomes of a frame of either side; false: lost. Empty: nothing.
  std::function<bool(drivers::CanFrame&)> on_the_way;

 private:
  void silent_tick(simulation::Frames& said) {
    now = now + kTick;
    torque = device->update({motor_q, motor_dq}, now, kTick, said);
    if (device->brake_engaged())
      motor_dq = 0;
    else
      motor_dq += (torque + load) / kInertia * kTick.seconds();
    motor_q += motor_dq * kTick.seconds();
  }
  config::Drive drive_;
};

}  // namespace takt::test

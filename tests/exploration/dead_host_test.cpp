// SPDX-License-Identifier: Apache-2.0
// Goal: no drive is armed that nothing is known to stop when commands cease, unless the robot file says why. Method:
// the world of the exploration with drives that, left to themselves, go on for ten seconds after the last command; one
// joint after another has no waiver, the others have one; the executive stands still for two seconds. Either it never
// gave that joint power, or the joint's own drive stopped within one second.
#include <gtest/gtest.h>

#include <algorithm>

#include "tests/exploration/world.hpp"

namespace takt::exploration {
namespace {

constexpr Duration kStallsAt = seconds(3), kStall = seconds(2);

struct Seen {
  bool had_power = false;     // before the executive stood still
  bool is_driven_on = false;  // a second after its last frame
};

Seen run_without_waiver(std::size_t joint) {
  config::RobotConfig robot = small_robot();
  robot.simulation->drive_watchdog = seconds(10);
  for (config::Joint& other : robot.joints) other.drive.watchdog_waiver = "another joint is looked at";
  robot.joints[joint].drive.watchdog_waiver = "none";
  World world(robot, {{Happening::stall_in_clock, kStallsAt, kStall}}, 1);
  Seen seen;
  MonoTime last_frame;  // by the plant's clock, which passes through a stall step by step
  world.on_frame = [&](const World::Sent&) { last_frame = world.plant().now(); };
  world.on_tick = [](const TickRecord&) {};
  world.on_step = [&] {
    if (world.plant().drive(joint).state() != simulation::DeviceState::enabled) return;
    seen.had_power |= world.plant().now() < MonoTime{} + kStallsAt;
    seen.is_driven_on |= world.plant().now() - last_frame > seconds(1);
  };
  world.run(kStallsAt + kStall);
  return seen;
}

TEST(DeadHost, NoDriveIsArmedThatNothingIsKnownToStop) {
  const config::RobotConfig robot = small_robot();
  int armed = 0, refused = 0;
  for (std::size_t joint = 0; joint < robot.joints.size(); ++joint) {
    const Seen seen = run_without_waiver(joint);
    ++(seen.had_power ? armed : refused);
    EXPECT_FALSE(seen.is_driven_on) << robot.joints[joint].name << " goes on without its host";
  }
  EXPECT_GE(armed, 1) << "time-outs that the executive sets";
  EXPECT_GE(refused, 1) << "time-outs that it can only read, or not even that";
}

}  // namespace
}  // namespace takt::exploration

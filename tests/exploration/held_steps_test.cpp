// SPDX-License-Identifier: Apache-2.0
// Goal: where steps are held (policy.action.interpolation: hold), no frame carries a velocity setpoint while the
// reference moves; where they are a path, frames do. Method: the world of the exploration without any trouble; frames
// of the mit drive are read by the protocol's paper.
#include <gtest/gtest.h>

#include <algorithm>
#include <cmath>

#include "tests/exploration/world.hpp"

namespace takt::exploration {
namespace {

struct Motion {
  int frames = 0;                                   // with the policy's stiffness
  double fastest_frame = 0, fastest_reference = 0;  // rad/s, at the mit drive
};

Motion run(config::Interpolation interpolation) {
  config::RobotConfig robot = small_robot();
  robot.policy->action.interpolation = interpolation;
  const auto is_mit = [](const config::Joint& joint) { return joint.drive.protocol == config::DriveProtocol::mit; };
  const auto found = std::ranges::find_if(robot.joints, is_mit);
  const auto index = static_cast<std::size_t>(found - robot.joints.begin());
  const config::Joint& joint = *found;
  World world(robot, {}, 1);
  Motion motion;
  world.on_frame = [&](const World::Sent& sent) {
    const drivers::CanFrame& frame = sent.frame;
    if (sent.bus != joint.bus || frame.extended || frame.id != joint.drive.id || frame.length != 8) return;
    const std::uint8_t* const d = frame.data;
    if (std::all_of(d, d + 7, [](std::uint8_t byte) { return byte == 0xFF; })) return;  // enable and its like
    if (((d[3] & 15) << 8 | d[4]) == 0) return;                                         // no stiffness: not tracking
    // 12 bits over -velocity_range..velocity_range: 0 lies between two of them.
    const int beyond_zero = std::max(std::abs((d[2] << 4 | d[3] >> 4) * 2 - 4095) - 1, 0);
    ++motion.frames;
    motion.fastest_frame = std::max(motion.fastest_frame, joint.drive.velocity_range * beyond_zero / 4095.0);
  };
  world.on_tick = [&](const TickRecord& record) {
    if (record.header.mode != Mode::tracking) return;
    motion.fastest_reference =
        std::max(motion.fastest_reference, static_cast<double>(std::abs(record.joints[index].dq_reference)));
  };
  world.on_step = [] {};
  world.run(seconds(6));
  return motion;
}

TEST(HeldSteps, NoFrameCarriesAVelocityWhileTheReferenceMoves) {
  const Motion held = run(config::Interpolation::hold);
  EXPECT_GT(held.frames, 2000);
  EXPECT_EQ(held.fastest_reference, 0.0);
  EXPECT_EQ(held.fastest_frame, 0.0);
  const Motion path = run(config::Interpolation::linear);
  EXPECT_GT(path.frames, 2000);
  EXPECT_NEAR(path.fastest_frame, path.fastest_reference, 0.05);
}

}  // namespace
}  // namespace takt::exploration

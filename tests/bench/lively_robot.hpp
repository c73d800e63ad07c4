// SPDX-License-Identifier: Apache-2.0
// The virtual robot as its record is longest: nothing in it repeats.
#pragma once

#include <cmath>
#include <cstddef>
#include <cstdint>
#include <random>

#include "tests/monitor/record/virtual_robot.hpp"

namespace takt::bench {

// As a machine without real-time guarantees, a camera of 30 Hz and encoders of 0.4 mrad would have it.
inline void make_lively(monitor::VirtualRobot& robot, std::mt19937_64& random) {
  robot.spoil_input = [&random](pipeline::TickInput& input) {
    std::uniform_real_distribution<double> unit;
    for (std::size_t joint = 0; joint < 6; ++joint) {
      const double noisy = static_cast<double>(input.joints[joint].q) + 0.0008 * (unit(random) - 0.5);
      input.joints[joint].q = static_cast<float>(0.0004 * std::round(noisy / 0.0004));
      input.joints[joint].tau = static_cast<float>(2 * unit(random));
    }
    input.lateness = microseconds(static_cast<std::int64_t>(-40 * std::log(1 - unit(random))));
    input.last_duration = microseconds(static_cast<std::int64_t>(5 + 5 * unit(random)));
  };
  robot.spoil_answer = [&random](CommandChunk& chunk) {
    std::uniform_int_distribution<std::int64_t> camera(0, 33'000), inference(0, 4'000);
    chunk.header.outside_sensed_at = chunk.header.outside_sensed_at - microseconds(camera(random));
    chunk.header.infer_ended_at = chunk.header.infer_ended_at - microseconds(inference(random));
  };
}

}  // namespace takt::bench

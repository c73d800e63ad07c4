// SPDX-License-Identifier: Apache-2.0
// The virtual robot with everything ROS 2 would be told of it, kept.
#pragma once

#include <vector>

#include "monitor/dds/condenser.hpp"
#include "tests/monitor/record/virtual_robot.hpp"

namespace takt::monitor::dds {

inline constexpr std::int64_t kOffset = 1'700'000'000'000'000'000;  // ns, CLOCK_MONOTONIC to Unix time

inline config::RobotConfig demo_robot_with_dds(double joint_state_rate) {
  config::RobotConfig robot = demo_robot();
  robot.dds.emplace().joint_state_rate = joint_state_rate;
  return robot;
}

struct CondensedRobot {
  explicit CondensedRobot(double joint_state_rate, MonoTime since = {})
      : config(demo_robot_with_dds(joint_state_rate)), condenser(config, kOffset, since, outbox) {}

  void run(std::uint64_t ticks) {
    for (std::uint64_t tick = 0; tick < ticks; ++tick) {
      robot.run(1);
      tell(robot.latest());
    }
  }
  void tell(const TickRecord& record) {
    condenser.tick(record);
    collect();
  }
  void collect() {
    Outbox::Batch batch = outbox.take(std::chrono::milliseconds(0));
    const auto keep = [](auto& all, auto& some) { all.insert(all.end(), some.begin(), some.end()); };
    keep(joint_states, batch.joint_states);
    keep(diagnostics, batch.diagnostics);
    keep(status, batch.status);
    keep(command_ages, batch.command_ages);
  }

  config::RobotConfig config;
  VirtualRobot robot;
  Outbox outbox;
  Condenser condenser;
  std::vector<JointStates> joint_states;
  std::vector<Diagnostics> diagnostics;
  std::vector<Status> status;
  std::vector<CommandAge> command_ages;
};

}  // namespace takt::monitor::dds

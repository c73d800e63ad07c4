// SPDX-License-Identifier: Apache-2.0
#include "cli/robot/asked_drives.hpp"

#include "config/load.hpp"
#include "drivers/protocol/protocol_table.hpp"
#include "executive/contract/monotonic_clock.hpp"

namespace takt::cli {

std::expected<AskedDrives, Refusal> AskedDrives::open(const DirectRobot& robot) {
  AskedDrives made(robot.config);
  for (std::size_t joint = 0; joint < robot.config.joints.size(); ++joint) {
    auto driver = drivers::make_joint_driver(robot.config, joint);
    if (!driver) return std::unexpected(Refusal{config::kExitBadConfiguration, driver.error()});
    made.drivers_.push_back(std::move(*driver));
  }
  for (std::size_t bus = 0; bus < robot.config.buses.size(); ++bus) {
    auto opened = open_bus(robot, bus);
    if (!opened) made.missing_.push_back(opened.error().sentence);
    made.buses_.push_back(opened ? std::move(*opened) : nullptr);
  }
  return made;
}

bool AskedDrives::is_reached(std::size_t joint) const {
  return buses_[robot_->joints[joint].bus] != nullptr;
}

void AskedDrives::hear(std::size_t bus) {
  if (!buses_[bus]) return;
  const std::size_t count = buses_[bus]->receive(received_);
  for (std::size_t i = 0; i < count; ++i)
    for (std::size_t joint = 0; joint < drivers_.size(); ++joint)
      if (robot_->joints[joint].bus == bus && drivers_[joint]->decode(received_[i])) break;
}

void AskedDrives::turn() {
  for (std::size_t bus = 0; bus < buses_.size(); ++bus) hear(bus);
  std::array<drivers::CanFrame, drivers::kMaxFramesPerDrive> out;
  for (std::size_t joint = 0; joint < drivers_.size(); ++joint) {
    if (!is_reached(joint)) continue;
    const std::size_t frames = drivers_[joint]->encode(false, {}, monotonic_now(), {}, out);
    for (std::size_t i = 0; i < frames; ++i) buses_[robot_->joints[joint].bus]->send(out[i]);
  }
}

}  // namespace takt::cli

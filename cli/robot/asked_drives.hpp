// SPDX-License-Identifier: Apache-2.0
// Every drive of a robot is asked how it is, and kept disabled, as the executive does in standby: its settings are
// compared with the robot file meanwhile. For tools that run where no executive does. Real time; one thread.
#pragma once

#include <array>
#include <expected>
#include <memory>
#include <string>
#include <vector>

#include "cli/robot/direct_bus.hpp"
#include "drivers/protocol/joint_driver.hpp"

namespace takt::cli {

class AskedDrives {
 public:
  // The error: a drive of the file that no driver can be made for. A bus that is not there is among missing(). `robot`
  // must outlive this object.
  static std::expected<AskedDrives, Refusal> open(const DirectRobot& robot);

  // One control period: what came in is heard, every drive is told once more to be disabled.
  void turn();
  // Whether its bus is there.
  [[nodiscard]] bool is_reached(std::size_t joint) const;
  [[nodiscard]] const JointFeedback& feedback(std::size_t joint) const { return drivers_[joint]->feedback(); }
  // JointDriver::is_set_up.
  [[nodiscard]] bool is_set_up(std::size_t joint) const { return drivers_[joint]->is_set_up(); }
  [[nodiscard]] std::size_t count() const { return drivers_.size(); }
  // Why buses are not there.
  [[nodiscard]] const std::vector<std::string>& missing() const { return missing_; }

 private:
  explicit AskedDrives(const config::RobotConfig& robot) : robot_(&robot) {}
  void hear(std::size_t bus);

  const config::RobotConfig* robot_;
  std::vector<std::unique_ptr<drivers::CanBus>> buses_;  // null: not there
  std::vector<std::string> missing_;
  std::vector<std::unique_ptr<drivers::JointDriver>> drivers_;
  std::array<drivers::ReceivedFrame, 64> received_;
};

}  // namespace takt::cli

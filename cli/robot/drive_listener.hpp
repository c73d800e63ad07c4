// SPDX-License-Identifier: Apache-2.0
// Keeps one drive disabled and reporting, for commands of a person who stands at the joint. Real time; one thread.
#pragma once

#include <array>
#include <optional>
#include <string>

#include "config/robot_config.hpp"
#include "drivers/bus/can_bus.hpp"
#include "drivers/protocol/joint_driver.hpp"

namespace takt::cli {

class DriveListener {
 public:
  static constexpr int kPatience = 3000;  // control periods
  static constexpr int kSettle = 50;      // control periods after the drive was told something

  // Both must outlive this object.
  DriveListener(drivers::CanBus& bus, drivers::JointDriver& driver, Duration period)
      : bus_(bus), driver_(driver), period_(period) {}
  // And as the robot file has it. False: it does not answer, or stays enabled or at fault. That it does not know its
  // home is no such fault.
  bool wait_until_disabled();
  // Then: why, in the drive's own words where it has any.
  [[nodiscard]] std::string why_not_disabled(const config::Drive& drive) const;
  void settle();
  // What is typed next, without the end of the line; nothing: no more will be.
  std::optional<std::string> wait_for_line();
  [[nodiscard]] double q() const { return double{driver_.feedback().q}; }  // rad, joint side
  [[nodiscard]] const JointFeedback& feedback() const { return driver_.feedback(); }

 private:
  void turn();  // one control period

  drivers::CanBus& bus_;
  drivers::JointDriver& driver_;
  Duration period_;
  std::array<drivers::ReceivedFrame, 64> received_;
};

}  // namespace takt::cli

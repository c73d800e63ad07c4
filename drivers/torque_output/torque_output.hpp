// SPDX-License-Identifier: Apache-2.0
// The output that permits the robot's torque: a line into the safe-torque-off input of its drives or supply. It adds a
// way to take the torque that needs no bus and no drive's obedience. It is one channel of a general-purpose computer,
// and no emergency stop.
//
// After construction torque is not permitted. At destruction it is taken, and the output is given back; so it is, by
// the kernel, when the process dies. What a line without a holder does is the hardware's affair:
// docs/safe-torque-off.md.
#pragma once

#include <expected>
#include <memory>
#include <string>

#include "config/robot_config.hpp"

namespace takt::drivers {

class TorqueOutput {
 public:
  virtual ~TorqueOutput() = default;
  // Sets it where it is not so already, and reads it back, every time. False: it could not be set, or reads otherwise;
  // then it is set again by the next call. No allocation, lock or log; at most two system calls, which take about a
  // microsecond on lines of the processor or of a PCI card. Lines behind I2C, SPI or USB wait for a transfer: they do
  // not belong here. Thread rule: one thread at a time, the control thread once it runs.
  virtual bool tell(bool permitted) noexcept = 0;
};

struct OpenedTorqueOutput {
  std::unique_ptr<TorqueOutput> output;
  std::string description;  // "line 17 of /dev/gpiochip0 (pinctrl-bcm2711), active high"
};

// The error: one sentence that names the key, the place and what to do.
std::expected<OpenedTorqueOutput, std::string> open_torque_output(const config::SafeTorqueOff& wanted);

}  // namespace takt::drivers

// SPDX-License-Identifier: Apache-2.0
// What brings a CAN interface up, step by step, and what a refusal of the kernel means. Pure.
//
// Bit timing and the restart after bus-off are set by commands of their own: since Linux 6.12.47 a driver that cannot
// restart its controller by itself (gs_usb: candleLight, CANable) refuses the restart, and with it whatever stands in
// the same command.
#pragma once

#include <string>
#include <string_view>
#include <vector>

#include "config/robot_config.hpp"

namespace takt::cli {

enum class LinkKind : std::uint8_t {
  controller,  // the kernel sets its bit timing; also an interface that is not there yet
  vcan,        // no bit timing
  serial       // slcan without bit timing of the kernel's: slcand sets it over the line
};

struct UpStep {
  std::vector<std::string> command;
  bool is_restart = false;  // may be refused: then the controller stays off until it is brought up anew
};

std::vector<UpStep> up_steps(const config::RobotConfig& robot, std::size_t bus, LinkKind kind);

// One sentence, with what mends it. `said`: the output of `ip`.
std::string why_refused(const std::vector<std::string>& command, std::string_view said);

std::string line_of(const std::vector<std::string>& command);

}  // namespace takt::cli

// SPDX-License-Identifier: Apache-2.0
// Brings a CAN interface up, step by step: each is judged, and what it set is read back. And what a refusal of the
// kernel means. Pure but for the two tools.
//
// Bit timing and the restart after bus-off are set by commands of their own: since Linux 6.12.47 a driver that cannot
// restart its controller by itself (gs_usb: candleLight, CANable) refuses the restart, and with it whatever stands in
// the same command.
#pragma once

#include <expected>
#include <functional>
#include <string>
#include <string_view>
#include <vector>

#include "cli/command.hpp"
#include "cli/run/external_tool.hpp"
#include "config/robot_config.hpp"
#include "drivers/bus/can_link.hpp"

namespace takt::cli {

enum class LinkKind : std::uint8_t {
  controller,  // the kernel sets its bit timing; also an interface that is not there yet
  vcan,        // no bit timing
  serial       // slcan without bit timing of the kernel's: slcand sets it over the line
};

LinkKind kind_of(const drivers::CanLink& link);

struct UpStep {
  enum class Sets : std::uint8_t { nothing, timing, restart };
  std::vector<std::string> command;
  Sets sets = Sets::nothing;  // restart: may be refused; then the controller stays off until it is brought up anew
};

std::vector<UpStep> up_steps(const config::RobotConfig& robot, std::size_t bus, LinkKind kind);

struct UpTools {
  std::function<ToolResult(const std::vector<std::string>&)> run;
  std::function<drivers::CanLink()> look;  // at the bus's interface
};
// What is to be told of it, a sentence each.
std::expected<std::vector<std::string>, Refusal> bring_up(const config::RobotConfig& robot, std::size_t bus,
                                                          const UpTools& tools);

// One sentence, with what corrects it. `said`: the output of `ip`.
std::string why_refused(const std::vector<std::string>& command, std::string_view said);

std::string line_of(const std::vector<std::string>& command);

}  // namespace takt::cli

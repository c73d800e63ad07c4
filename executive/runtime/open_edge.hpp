// SPDX-License-Identifier: Apache-2.0
// Builds the edge to the drives a robot file describes: one driver per joint, one open bus per entry. Set-up only.
// Before anything is sent it makes sure that no other host commands the drives: the interfaces are claimed, and for
// kListenFor nothing may be heard on the ids that are ours to send on. Last of all notes of `takt joint home` in the
// runtime directory are taken, and hold for these drivers alone (drivers/protocol/home_note.hpp).
#pragma once

#include <chrono>
#include <expected>
#include <string>
#include <vector>

#include "config/robot_config.hpp"
#include "drivers/bus/interface_claim.hpp"
#include "executive/runtime/drive_edge.hpp"
#include "executive/runtime/executive_file.hpp"

namespace takt::runtime {

// Longer than ten periods of the slowest loop.
inline constexpr std::chrono::milliseconds kListenFor{100};

struct OpenedEdge {
  std::vector<drivers::InterfaceClaim> claims;  // held for as long as the edge
  DriveEdge edge;
  std::vector<OpenedBusFacts> buses;  // in configuration order
  std::string torque_output;          // what it is; empty: the robot has none
};

struct EdgeRefusal {
  int exit_code;
  std::string sentence;
};

// A bus that may fall back to the loopback hub is waited for until `hub_patience` has passed: the hub's process may
// still be starting. The error is the sentence of the bus or drive that cannot be had, or of who commands it already.
std::expected<OpenedEdge, EdgeRefusal> open_edge(const config::RobotConfig& robot, const std::string& runtime_directory,
                                                 std::chrono::milliseconds hub_patience);

}  // namespace takt::runtime

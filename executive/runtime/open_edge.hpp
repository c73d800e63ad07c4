// Builds the edge to the drives a robot file describes: one driver per joint, one open bus per entry. Set-up only.
#pragma once

#include <chrono>
#include <expected>
#include <string>
#include <vector>

#include "config/robot_config.hpp"
#include "executive/runtime/drive_edge.hpp"

namespace takt::runtime {

struct OpenedEdge {
  DriveEdge edge;
  std::vector<std::string> bus_descriptions;  // one per bus, in configuration order
};

// A bus that may fall back to the loopback hub is waited for until `hub_patience` has passed: the hub's process may
// still be starting. The error is the sentence of the bus or drive that cannot be had.
std::expected<OpenedEdge, std::string> open_edge(const config::RobotConfig& robot, const std::string& runtime_directory,
                                                 std::chrono::milliseconds hub_patience);

}  // namespace takt::runtime

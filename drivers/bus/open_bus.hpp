// SPDX-License-Identifier: Apache-2.0
// Opens the bus a robot file names: SocketCAN when the interface exists, else the loopback bus when the file allows it
// (when_missing: loopback), else a refusal; likewise where the controller's bit timing is not the robot file's. Set-up
// only.
#pragma once

#include <cstdint>
#include <expected>
#include <memory>
#include <optional>
#include <span>
#include <string>
#include <vector>

#include "config/drive_ids.hpp"
#include "config/robot_config.hpp"
#include "drivers/bus/can_bus.hpp"
#include "drivers/bus/can_link.hpp"
#include "drivers/bus/interface_claim.hpp"

namespace takt::drivers {

struct OpenedBus {
  std::unique_ptr<CanBus> bus;
  bool loopback = false;
  std::string description;  // "can0: SocketCAN, classic, 1000000 bit/s" or "can0: loopback hub at <path>"
  CanLink link;             // the interface as it was opened; `exists` is false of a loopback
};

// `receive`: ids wanted; an empty list: none; no list: every frame.
std::expected<OpenedBus, std::string> open_bus(const config::Bus& bus, const std::string& runtime_directory,
                                               std::optional<std::vector<config::IdPattern>> receive = {});

// Claims every interface that exists; simulated buses need no claim. The error: the sentence of the first that is held.
std::expected<std::vector<InterfaceClaim>, std::string> claim_interfaces(const std::vector<config::Bus>& buses);

// What the host listens to on that bus: its drives' replies, and their commands too, for those are ours to send: a
// stranger's are to be noticed. And what the drives listen to.
std::vector<config::IdPattern> host_ids(const config::RobotConfig& robot, std::size_t bus);
std::vector<config::IdPattern> device_ids(const config::RobotConfig& robot, std::size_t bus);

}  // namespace takt::drivers

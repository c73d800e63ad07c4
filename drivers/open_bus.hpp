// Opens the bus a robot file names: SocketCAN when the interface exists, else the loopback bus when the file allows it
// (when_missing: loopback), else a refusal. Set-up only.
#pragma once

#include <cstdint>
#include <expected>
#include <memory>
#include <span>
#include <string>
#include <vector>

#include "config/robot_config.hpp"
#include "drivers/can_bus.hpp"

namespace takt::drivers {

struct OpenedBus {
  std::unique_ptr<CanBus> bus;
  bool loopback = false;
  std::string description;  // "can0: SocketCAN, classic, 1000000 bit/s" or "can0: loopback hub at <path>"
};

// `receive_ids`: standard ids wanted; empty: every frame.
std::expected<OpenedBus, std::string> open_bus(const config::Bus& bus, const std::string& runtime_directory,
                                               std::span<const std::uint32_t> receive_ids = {});

// The host side's ids on that bus: what its drives reply with. And the device side's: what they listen to.
std::vector<std::uint32_t> reply_ids(const config::RobotConfig& robot, std::size_t bus);
std::vector<std::uint32_t> command_ids(const config::RobotConfig& robot, std::size_t bus);

}  // namespace takt::drivers

// SPDX-License-Identifier: Apache-2.0
#include "drivers/bus/open_bus.hpp"

#include "config/paths.hpp"
#include "drivers/bus/loopback_bus.hpp"
#include "drivers/bus/socketcan_bus.hpp"

namespace takt::drivers {
namespace {

std::vector<config::IdPattern> ids_on(const config::RobotConfig& robot, std::size_t bus, bool replies_too) {
  std::vector<config::IdPattern> all;
  const auto add = [&all](const std::vector<config::IdPattern>& some) {
    all.insert(all.end(), some.begin(), some.end());
  };
  for (const config::Joint& joint : robot.joints) {
    if (joint.bus != bus) continue;
    const config::DriveIds ids = config::ids_of(joint.drive);
    add(ids.commands);
    add(ids.broadcasts);
    if (replies_too) add(ids.replies);
    if (replies_too) add(ids.betrayals);
  }
  return all;
}

}  // namespace

std::expected<OpenedBus, std::string> open_bus(const config::Bus& bus, const std::string& runtime_directory,
                                               std::optional<std::vector<config::IdPattern>> receive) {
  const BusOptions options{bus.interface, bus.fd, std::move(receive)};
  if (SocketCanBus::interface_exists(bus.interface)) {
    auto opened = SocketCanBus::open(options, bus.bitrate);
    if (!opened) return std::unexpected(opened.error());
    CanLink link = read_can_link(bus.interface);
    if (const std::string wrong = wrong_timing(bus, link); !wrong.empty())
      return std::unexpected(bus.interface + ": " + wrong + ": takt bus up --robot FILE, as root, sets it");
    return OpenedBus{
        std::move(*opened), false,
        bus.interface + ": SocketCAN, " + (bus.fd ? "FD, " : "classic, ") + std::to_string(bus.bitrate) + " bit/s",
        std::move(link)};
  }
  switch (bus.when_missing) {
    case config::WhenBusMissing::refuse:
      return std::unexpected("bus " + bus.name + ": this machine has no interface " + bus.interface +
                             ": plug the adapter in, or set when_missing: loopback to run against takt-plant");
    case config::WhenBusMissing::loopback:
      break;
  }
  const std::string path = config::loopback_socket(runtime_directory, bus.interface);
  auto connected = LoopbackBus::connect(path, options);
  if (!connected) return std::unexpected(connected.error());
  return OpenedBus{std::move(*connected), true, bus.interface + ": loopback hub at " + path, {}};
}

std::expected<std::vector<InterfaceClaim>, std::string> claim_interfaces(const std::vector<config::Bus>& buses) {
  std::vector<InterfaceClaim> claims;
  for (const config::Bus& bus : buses) {
    if (!SocketCanBus::interface_exists(bus.interface)) continue;
    auto claim = InterfaceClaim::make(bus.interface);
    if (!claim) return std::unexpected(claim.error());
    claims.push_back(std::move(*claim));
  }
  return claims;
}

std::vector<config::IdPattern> host_ids(const config::RobotConfig& robot, std::size_t bus) {
  return ids_on(robot, bus, true);
}

std::vector<config::IdPattern> device_ids(const config::RobotConfig& robot, std::size_t bus) {
  return ids_on(robot, bus, false);
}

}  // namespace takt::drivers

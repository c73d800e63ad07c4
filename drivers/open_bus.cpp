#include "drivers/open_bus.hpp"

#include "config/paths.hpp"
#include "drivers/loopback_bus.hpp"
#include "drivers/socketcan_bus.hpp"

namespace takt::drivers {
namespace {

std::vector<std::uint32_t> ids_on(const config::RobotConfig& robot, std::size_t bus, std::uint32_t config::Drive::*id) {
  std::vector<std::uint32_t> ids;
  for (const config::Joint& joint : robot.joints)
    if (joint.bus == bus) ids.push_back(joint.drive.*id);
  return ids;
}

}  // namespace

std::expected<OpenedBus, std::string> open_bus(const config::Bus& bus, const std::string& runtime_directory,
                                               std::span<const std::uint32_t> receive_ids) {
  const BusOptions options{bus.interface, bus.fd, {receive_ids.begin(), receive_ids.end()}};
  if (SocketCanBus::interface_exists(bus.interface)) {
    auto opened = SocketCanBus::open(options, bus.bitrate);
    if (!opened) return std::unexpected(opened.error());
    return OpenedBus{
        std::move(*opened), false,
        bus.interface + ": SocketCAN, " + (bus.fd ? "FD, " : "classic, ") + std::to_string(bus.bitrate) + " bit/s"};
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
  return OpenedBus{std::move(*connected), true, bus.interface + ": loopback hub at " + path};
}

std::vector<std::uint32_t> reply_ids(const config::RobotConfig& robot, std::size_t bus) {
  return ids_on(robot, bus, &config::Drive::reply_id);
}

std::vector<std::uint32_t> command_ids(const config::RobotConfig& robot, std::size_t bus) {
  return ids_on(robot, bus, &config::Drive::id);
}

}  // namespace takt::drivers

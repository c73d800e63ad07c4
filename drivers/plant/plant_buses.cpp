#include "drivers/plant/plant_buses.hpp"

#include <algorithm>

#include "config/paths.hpp"
#include "drivers/loopback_hub.hpp"
#include "drivers/open_bus.hpp"
#include "drivers/socketcan_bus.hpp"

namespace takt::plant {

std::expected<PlantBuses, std::string> PlantBuses::open(const config::RobotConfig& robot,
                                                        const std::string& runtime_directory) {
  PlantBuses opened;
  opened.received_.resize(kMaxFrames);
  for (std::size_t i = 0; i < robot.buses.size(); ++i) {
    const config::Bus& bus = robot.buses[i];
    const std::vector<config::IdPattern> ids = drivers::device_ids(robot, i);
    const bool hosts_hub =
        !drivers::SocketCanBus::interface_exists(bus.interface) && bus.when_missing == config::WhenBusMissing::loopback;
    if (hosts_hub) {
      const std::string path = config::loopback_socket(runtime_directory, bus.interface);
      auto hub = drivers::LoopbackHub::listen(path, {bus.interface, bus.fd, ids});
      if (!hub) return std::unexpected(hub.error());
      opened.buses_.push_back(std::move(*hub));
      opened.descriptions_.push_back(bus.interface + ": loopback hub, served at " + path);
      continue;
    }
    auto node = drivers::open_bus(bus, runtime_directory, ids);
    if (!node) return std::unexpected(node.error());
    opened.buses_.push_back(std::move(node->bus));
    opened.descriptions_.push_back(std::move(node->description));
  }
  return opened;
}

MonoTime PlantBuses::exchange(ArmPlant& arm) {
  MonoTime newest;
  for (std::size_t bus = 0; bus < buses_.size(); ++bus) {
    const std::size_t count = buses_[bus]->receive(received_);
    out_.clear();
    for (std::size_t i = 0; i < count; ++i)
      if (arm.receive(bus, received_[i].frame, out_)) newest = std::max(newest, received_[i].received_at);
    arm.collect(bus, out_);
    // A full queue is the bus's own count; a real drive does not retry either.
    for (const drivers::CanFrame& frame : out_) buses_[bus]->send(frame);
  }
  return newest;
}

}  // namespace takt::plant

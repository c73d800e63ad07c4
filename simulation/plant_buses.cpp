// SPDX-License-Identifier: Apache-2.0
#include "simulation/plant_buses.hpp"

#include <algorithm>
#include <utility>

#include "config/paths.hpp"
#include "drivers/bus/open_bus.hpp"
#include "drivers/bus/socketcan_bus.hpp"

namespace takt::simulation {

std::expected<PlantBuses, std::string> PlantBuses::open(const config::RobotConfig& robot,
                                                        const std::string& runtime_directory, bool on_hardware) {
  PlantBuses opened;
  opened.received_.resize(kMaxFrames);
  for (std::size_t i = 0; i < robot.buses.size(); ++i) {
    const config::Bus& bus = robot.buses[i];
    // Answers' ids too: questions have them, as remote frames.
    const std::vector<config::IdPattern> ids = drivers::host_ids(robot, i);
    if (!on_hardware && drivers::SocketCanBus::has_hardware(bus.interface))
      return std::unexpected(bus.interface +
                             " is a real CAN interface: simulated drives would answer there beside real " +
                             "ones; name another interface, or say --on-hardware");
    const bool hosts_hub =
        !drivers::SocketCanBus::interface_exists(bus.interface) && bus.when_missing == config::WhenBusMissing::loopback;
    if (hosts_hub) {
      const std::string path = config::loopback_socket(runtime_directory, bus.interface);
      auto hub = drivers::LoopbackHub::listen(path, {bus.interface, bus.fd, ids});
      if (!hub) return std::unexpected(hub.error());
      drivers::LoopbackHub* const its_hub = hub->get();
      opened.ends_.push_back({std::move(*hub), its_hub, BusTrouble(robot, i)});
      opened.descriptions_.push_back(bus.interface + ": loopback hub, served at " + path);
      continue;
    }
    auto node = drivers::open_bus(bus, runtime_directory, ids);
    if (!node) return std::unexpected(node.error());
    opened.ends_.push_back({std::move(node->bus), nullptr, BusTrouble(robot, i)});
    opened.descriptions_.push_back(std::move(node->description));
  }
  return opened;
}

MonoTime PlantBuses::hear(End& end, std::size_t bus, Plant& plant) {
  MonoTime newest;
  const std::size_t count = end.bus->receive(received_);
  for (std::size_t i = 0; i < count; ++i)
    if (!end.trouble.loses() && plant.receive(bus, received_[i].frame, out_))
      newest = std::max(newest, received_[i].received_at);
  return newest;
}

void PlantBuses::let_strangers_speak(End& end, std::size_t bus, Plant& plant, int steps) {
  strangers_.clear();
  for (int step = 0; step < steps; ++step) end.trouble.speak(strangers_);
  for (const drivers::CanFrame& frame : strangers_) {
    end.bus->send(frame);
    plant.receive(bus, frame, out_);
  }
}

MonoTime PlantBuses::exchange(Plant& plant, int steps) {
  MonoTime newest;
  for (std::size_t bus = 0; bus < ends_.size(); ++bus) {
    End& end = ends_[bus];
    out_.clear();
    if (end.bus) newest = std::max(newest, hear(end, bus, plant));
    if (end.bus) let_strangers_speak(end, bus, plant, steps);
    plant.collect(bus, out_);
    for (const drivers::CanFrame& frame : out_) {
      end.trouble.overhear(frame, plant.now());
      // A full queue is the bus's own count; a real drive does not retry either.
      if (end.bus && !end.trouble.loses()) end.bus->send(frame);
    }
  }
  return newest;
}

void PlantBuses::set_faults(std::size_t bus, const BusFaults& faults) {
  End& end = ends_[bus];
  const BusState before = end.trouble.faults().state;
  if (faults == end.trouble.faults() || before == BusState::down) return;
  end.trouble.set(faults);
  if (faults.state == before || end.hub == nullptr) return;
  if (faults.state == BusState::down) {
    end.hub = nullptr;
    end.bus.reset();  // the nodes see their connection end
    return;
  }
  end.hub->report_error_state(faults.state);
}

}  // namespace takt::simulation

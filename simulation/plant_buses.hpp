// SPDX-License-Identifier: Apache-2.0
// The plant's end of every configured bus: the hub itself where the bus is a loopback, a SocketCAN node elsewhere.
// Thread rule: one thread at a time. Errors: one sentence.
#pragma once

#include <expected>
#include <memory>
#include <string>
#include <vector>

#include "config/robot_config.hpp"
#include "drivers/bus/can_bus.hpp"
#include "drivers/bus/loopback_hub.hpp"
#include "simulation/bus_trouble.hpp"
#include "simulation/plant.hpp"

namespace takt::simulation {

class PlantBuses {
 public:
  // `robot` outlives what is returned. An interface with hardware behind it, where real drives may be, is refused
  // unless `on_hardware`.
  static std::expected<PlantBuses, std::string> open(const config::RobotConfig& robot,
                                                     const std::string& runtime_directory, bool on_hardware);
  // Lets the drives obey everything that arrived, sends their answers and what they say by themselves; strangers, if
  // there are any, speak for `steps` steps. Returns when the newest frame that a drive answered arrived, unset if none
  // did. Bounded: at most kMaxFrames per bus; the rest waits.
  MonoTime exchange(Plant& plant, int steps = 1);
  // A bus that is down stays down.
  void set_faults(std::size_t bus, const BusFaults& faults);
  // Whether set_faults() can put this bus into a state other than up: the hub can, an interface of the kernel cannot.
  [[nodiscard]] bool has_states(std::size_t bus) const { return ends_[bus].hub != nullptr; }
  [[nodiscard]] const std::vector<std::string>& descriptions() const { return descriptions_; }

 private:
  static constexpr std::size_t kMaxFrames = 256;
  struct End {
    std::unique_ptr<drivers::CanBus> bus;  // null: down
    drivers::LoopbackHub* hub = nullptr;   // the bus, where it is one
    BusTrouble trouble;
  };
  MonoTime hear(End& end, std::size_t bus, Plant& plant);
  void let_strangers_speak(End& end, std::size_t bus, Plant& plant, int steps);

  std::vector<End> ends_;
  std::vector<std::string> descriptions_;
  std::vector<drivers::ReceivedFrame> received_;
  Frames out_, strangers_;
};

}  // namespace takt::simulation

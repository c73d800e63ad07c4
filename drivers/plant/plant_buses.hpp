// The plant's end of every configured bus: the hub itself where the bus is a loopback, a SocketCAN node elsewhere.
// Thread rule: one thread at a time. Errors: one sentence.
#pragma once

#include <expected>
#include <memory>
#include <string>
#include <vector>

#include "config/robot_config.hpp"
#include "drivers/can_bus.hpp"
#include "drivers/plant/arm_plant.hpp"

namespace takt::plant {

class PlantBuses {
 public:
  static std::expected<PlantBuses, std::string> open(const config::RobotConfig& robot,
                                                     const std::string& runtime_directory);
  // Lets the arm obey everything that arrived, sends its answers and what its drives say by themselves. Returns when
  // the newest frame that a drive answered arrived, unset if none did. Bounded: at most kMaxFrames per bus; the rest
  // waits.
  MonoTime exchange(ArmPlant& arm);
  [[nodiscard]] const std::vector<std::string>& descriptions() const { return descriptions_; }

 private:
  static constexpr std::size_t kMaxFrames = 256;
  std::vector<std::unique_ptr<drivers::CanBus>> buses_;
  std::vector<std::string> descriptions_;
  std::vector<drivers::ReceivedFrame> received_;
  Frames out_;
};

}  // namespace takt::plant

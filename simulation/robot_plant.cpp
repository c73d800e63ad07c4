#include "simulation/robot_plant.hpp"

#include <utility>

namespace takt::plant {

std::expected<RobotPlant, std::string> RobotPlant::make(const config::RobotConfig& robot,
                                                        std::span<const double> payloads) {
  auto made = TroubledMechanics::make(robot, payloads);
  if (!made) return std::unexpected(made.error());
  TroubledMechanics& mechanics = **made;
  auto plant = Plant::make(robot, std::move(*made));
  if (!plant) return std::unexpected(plant.error());
  return RobotPlant(std::move(*plant), mechanics);
}

}  // namespace takt::plant

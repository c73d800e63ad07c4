#include "drivers/plant/arm_plant.hpp"

#include <utility>

namespace takt::plant {

std::expected<ArmPlant, std::string> ArmPlant::make(const config::RobotConfig& robot) {
  auto dynamics = ArmDynamics::make(robot);
  if (!dynamics) return std::unexpected(dynamics.error());
  ArmDynamics& arm = **dynamics;
  auto plant = Plant::make(robot, std::move(*dynamics));
  if (!plant) return std::unexpected(plant.error());
  return ArmPlant(std::move(*plant), arm);
}

}  // namespace takt::plant

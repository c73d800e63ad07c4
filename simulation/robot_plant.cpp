// SPDX-License-Identifier: Apache-2.0
#include "simulation/robot_plant.hpp"

#include <utility>

namespace takt::simulation {

std::expected<RobotPlant, std::string> RobotPlant::make(const config::RobotConfig& robot,
                                                        std::span<const double> payloads) {
  auto made = TroubledMechanics::make(robot, payloads);
  if (!made) return std::unexpected(made.error());
  TroubledMechanics& mechanics = **made;
  auto plant = Plant::make(robot, std::move(*made));
  if (!plant) return std::unexpected(plant.error());
  return RobotPlant(std::move(*plant), mechanics);
}

std::expected<RobotPlant, std::string> RobotPlant::make_in(std::unique_ptr<OutsideMechanics> world,
                                                           const config::RobotConfig& robot) {
  const ArmState begin = world->begin();
  auto made = TroubledMechanics::around(std::move(world), robot);
  TroubledMechanics& mechanics = *made;
  auto plant = Plant::make(robot, std::move(made));
  if (!plant) return std::unexpected(plant.error());
  plant->set_state(begin);
  return RobotPlant(std::move(*plant), mechanics);
}

}  // namespace takt::simulation

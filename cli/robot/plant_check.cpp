// SPDX-License-Identifier: Apache-2.0
#include "cli/robot/plant_check.hpp"

#include "simulation/robot_plant.hpp"
#include "simulation/world_process.hpp"

namespace takt::cli {

std::string refused_by_plant(const config::RobotConfig& robot, const std::string& world) {
  if (!robot.simulation) return {};
  if (!world.empty()) {
    const auto facts = simulation::WorldProcess(world).ask(robot);
    return facts ? "" : facts.error().sentence;
  }
  const auto plant = simulation::RobotPlant::make(robot);
  return plant ? "" : plant.error();
}

}  // namespace takt::cli

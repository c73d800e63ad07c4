// In place of mujoco_mechanics.cpp where the library was not installed when this was built.
#include "simulation/mujoco_mechanics.hpp"

namespace takt::plant {

std::expected<std::unique_ptr<MujocoMechanics>, std::string> MujocoMechanics::make(const config::RobotConfig& robot) {
  return std::unexpected(robot.file +
                         ": `simulation.mujoco`: this build has no MuJoCo; install libmujoco-dev and build again");
}

}  // namespace takt::plant

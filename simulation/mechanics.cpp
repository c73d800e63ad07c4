#include "simulation/mechanics.hpp"

#include "simulation/arm_dynamics.hpp"
#include "simulation/cart_pole_dynamics.hpp"
#include "simulation/mujoco_mechanics.hpp"

namespace takt::plant {

std::expected<std::unique_ptr<Mechanics>, std::string> make_mechanics(const config::RobotConfig& robot) {
  if (robot.simulation && robot.simulation->mujoco) {
#ifdef TAKT_HAS_MUJOCO
    return MujocoMechanics::make(robot);
#else
    return std::unexpected(robot.file +
                           ": `simulation.mujoco`: this build has no MuJoCo; install libmujoco-dev and build again");
#endif
  }
  if (robot.simulation && robot.simulation->cart_pole) return CartPoleDynamics::make(robot);
  return ArmDynamics::make(robot);
}

}  // namespace takt::plant

// SPDX-License-Identifier: Apache-2.0
#include "simulation/mechanics.hpp"

#include <span>

#include "simulation/arm_dynamics.hpp"
#include "simulation/cart_pole_dynamics.hpp"
#include "simulation/mujoco_mechanics.hpp"

namespace takt::simulation {

SensorSample imu_sample(const ImuReading& reading, std::uint64_t sequence, MonoTime at) {
  SensorSample sample;
  sample.sequence = sequence;
  sample.sensed_at = sample.published_at = at;
  for (const auto& part :
       {std::span<const double>(reading.orientation), std::span<const double>(reading.angular_velocity),
        std::span<const double>(reading.acceleration)})
    for (const double value : part) sample.values[sample.value_count++] = static_cast<float>(value);
  return sample;
}

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

}  // namespace takt::simulation

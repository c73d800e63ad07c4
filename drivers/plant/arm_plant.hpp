// The simulated arm: a plant whose mechanics are the robot file's rigid bodies.
#pragma once

#include "drivers/plant/arm_dynamics.hpp"
#include "drivers/plant/plant.hpp"

namespace takt::plant {

class ArmPlant final : public Plant {
 public:
  // The error is one sentence: no model, no simulation, a drive of another protocol.
  static std::expected<ArmPlant, std::string> make(const config::RobotConfig& robot);

  [[nodiscard]] config::Vector3 tool_position() { return dynamics_->tool_position(state().q); }
  [[nodiscard]] ArmDynamics& dynamics() { return *dynamics_; }

 private:
  ArmPlant(Plant plant, ArmDynamics& dynamics) : Plant(std::move(plant)), dynamics_(&dynamics) {}
  ArmDynamics* dynamics_;  // the Plant's
};

}  // namespace takt::plant

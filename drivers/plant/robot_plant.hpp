// The simulated robot: a plant whose mechanics are what the robot file describes.
#pragma once

#include "drivers/plant/mechanics.hpp"
#include "drivers/plant/plant.hpp"

namespace takt::plant {

class RobotPlant final : public Plant {
 public:
  // The error is one sentence: no model, no simulation, a drive of another protocol.
  static std::expected<RobotPlant, std::string> make(const config::RobotConfig& robot);

  [[nodiscard]] Mechanics& mechanics() { return *mechanics_; }
  [[nodiscard]] config::Vector3 controlled_point() { return mechanics_->controlled_point(state().q); }

 private:
  RobotPlant(Plant plant, Mechanics& mechanics) : Plant(std::move(plant)), mechanics_(&mechanics) {}
  Mechanics* mechanics_;  // the Plant's
};

}  // namespace takt::plant

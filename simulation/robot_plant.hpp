// SPDX-License-Identifier: Apache-2.0
// The simulated robot: a plant whose mechanics are what the robot file describes.
#pragma once

#include <memory>
#include <span>

#include "simulation/outside_mechanics.hpp"
#include "simulation/plant.hpp"
#include "simulation/troubled_mechanics.hpp"

namespace takt::simulation {

class RobotPlant final : public Plant {
 public:
  // The error is one sentence: no model, no simulation, a drive of another protocol.
  // `payloads`: the masses that set_trouble() may ask for.
  static std::expected<RobotPlant, std::string> make(const config::RobotConfig& robot,
                                                     std::span<const double> payloads = {});
  // In a world that another process plays, beginning where that says; it takes no push and no payload.
  static std::expected<RobotPlant, std::string> make_in(std::unique_ptr<OutsideMechanics> world,
                                                        const config::RobotConfig& robot);

  void set_trouble(const BodyTrouble& trouble) { mechanics_->set(trouble); }
  // As Mechanics::has_body.
  [[nodiscard]] bool has_body(const std::string& name) const { return mechanics_->has_body(name); }
  [[nodiscard]] std::vector<std::string> notes() const { return mechanics_->notes(); }
  [[nodiscard]] std::optional<ImuReading> imu() { return mechanics_->imu(); }
  [[nodiscard]] config::Vector3 controlled_point() { return mechanics_->controlled_point(state().q); }

 private:
  RobotPlant(Plant plant, TroubledMechanics& mechanics) : Plant(std::move(plant)), mechanics_(&mechanics) {}
  TroubledMechanics* mechanics_;  // the Plant's
};

}  // namespace takt::simulation

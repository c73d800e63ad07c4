// SPDX-License-Identifier: Apache-2.0
// cart_pole_balance: a cart that goes where it is told, in steps, without letting its pole fall. The seed draws the
// steps, their instants and the sensor's jitter.
// Error: distance of the cart from where it is told to be. Constraints: cart and pole inside their position limits.
// Lost: the pole beyond its limit by the margin; what hangs cannot be balanced again.
#pragma once

#include <expected>
#include <memory>
#include <string>

#include "config/robot_config.hpp"
#include "evidence/rollout/perturbation.hpp"
#include "evidence/rollout/troubled_dynamics.hpp"
#include "evidence/rollout/world.hpp"
#include "simulation/camera.hpp"

namespace takt::evidence {

class CartPoleWorld final : public World {
 public:
  // The error is one sentence: what the robot file lacks. `robot` and `disturbance` outlive this;
  // `outside` as TroubledDynamics::make has it.
  static std::expected<std::unique_ptr<CartPoleWorld>, std::string> make(
      const config::RobotConfig& robot, const Disturbance& disturbance, MonoTime started, std::uint64_t seed,
      std::unique_ptr<simulation::OutsideMechanics> outside);

  simulation::Plant& plant() override { return plant_; }
  [[nodiscard]] std::string sensor() const override { return simulation_.camera_sensor; }
  std::optional<SensorSample> sample(MonoTime now) override { return sensor_.poll(now); }
  double error_m(MonoTime now) override;
  [[nodiscard]] bool is_violated() const override { return violated_; }
  [[nodiscard]] simulation::OutsideMechanics* outside() const override { return dynamics_.outside(); }
  [[nodiscard]] bool is_lost() const override { return lost_; }

 private:
  CartPoleWorld(const config::RobotConfig& robot, TroubledRobot body, MonoTime told_since, std::uint64_t seed);

  const config::RobotConfig& robot_;
  simulation::Plant plant_;
  TroubledDynamics& dynamics_;  // the plant's
  config::Simulation simulation_;
  MonoTime told_since_;
  simulation::Camera sensor_;
  bool violated_ = false, lost_ = false;
};

}  // namespace takt::evidence

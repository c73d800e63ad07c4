// SPDX-License-Identifier: Apache-2.0
// When a perturbation troubles a robot's mechanics: a push at the tool, a payload, more friction
// (simulation/troubled_mechanics.hpp says what each is). Everything else passes through.
// Thread rule: one thread at a time.
#pragma once

#include <cstdint>
#include <expected>
#include <memory>
#include <optional>
#include <string>
#include <vector>

#include "config/robot_config.hpp"
#include "evidence/rollout/perturbation.hpp"
#include "simulation/outside_mechanics.hpp"
#include "simulation/plant.hpp"
#include "simulation/troubled_mechanics.hpp"

namespace takt::evidence {

inline constexpr Duration kPushLength = milliseconds(100);
// Of the push in that second of the window, from 1: drawn from the seed. Length 1.
config::Vector3 push_direction(std::uint64_t seed, std::int64_t turn);

class TroubledDynamics final : public simulation::Mechanics {
 public:
  // `disturbance` outlives this. `outside`: the mechanics of a process of the user's; null: the robot file's. The error
  // is one sentence: the robot has no model the simulator knows, or the world cannot do what is asked of it.
  static std::expected<std::unique_ptr<TroubledDynamics>, std::string> make(
      const config::RobotConfig& robot, const Disturbance& disturbance, MonoTime started, std::uint64_t seed,
      std::unique_ptr<simulation::OutsideMechanics> outside);

  void integrate(simulation::ArmState& state, const Eigen::VectorXd& tau,
                 const std::vector<simulation::Friction>& friction, Duration step) override;
  config::Vector3 tool_position(const Eigen::VectorXd& q) override { return body_->tool_position(q); }
  config::Vector3 controlled_point(const Eigen::VectorXd& q) override { return body_->controlled_point(q); }
  std::optional<simulation::ImuReading> imu() override { return body_->imu(); }
  [[nodiscard]] std::optional<simulation::BasePose> base() const override { return body_->base(); }
  void hoist(bool hangs) override { body_->hoist(hangs); }
  // Null: no other process plays them.
  [[nodiscard]] simulation::OutsideMechanics* outside() { return outside_; }

 private:
  TroubledDynamics(std::unique_ptr<simulation::TroubledMechanics> body, simulation::OutsideMechanics* outside,
                   const Disturbance& disturbance, MonoTime started, std::uint64_t seed);
  [[nodiscard]] simulation::BodyTrouble trouble_now() const;

  std::unique_ptr<simulation::TroubledMechanics> body_;
  simulation::OutsideMechanics* outside_;  // inside body_; null: the robot file's mechanics
  const Disturbance& disturbance_;
  MonoTime now_;
  std::uint64_t seed_;
};

// The robot of a rollout: drives in front of troubled mechanics, where these begin.
struct TroubledRobot {
  simulation::Plant plant;
  TroubledDynamics& dynamics;  // the plant's

  // As TroubledDynamics::make.
  static std::expected<TroubledRobot, std::string> make(const config::RobotConfig& robot,
                                                        const Disturbance& disturbance, MonoTime started,
                                                        std::uint64_t seed,
                                                        std::unique_ptr<simulation::OutsideMechanics> outside);
};

}  // namespace takt::evidence

// A robot's dynamics with what a perturbation adds: a force at the tool, a point mass at the tool, more friction in the
// joints. The tool of a cart with a pole is the pole's tip. Everything else passes through. Units: N, kg, base frame.
// Thread rule: one thread at a time. Source of the force's joint torques: the transposed Jacobian, by central
// differences of the tool's position.
#pragma once

#include <expected>
#include <memory>
#include <string>
#include <vector>

#include "config/robot_config.hpp"
#include "drivers/plant/mechanics.hpp"
#include "monitor/panel/perturbation.hpp"

namespace takt::panel {

class TroubledDynamics final : public plant::Mechanics {
 public:
  // `disturbance` outlives this. The error is one sentence: the robot has no model the simulator knows.
  static std::expected<std::unique_ptr<TroubledDynamics>, std::string> make(const config::RobotConfig& robot,
                                                                            const Disturbance& disturbance,
                                                                            MonoTime started, std::uint64_t seed);

  void integrate(plant::ArmState& state, const Eigen::VectorXd& tau, const std::vector<plant::Friction>& friction,
                 Duration step) override;
  // As without a payload.
  config::Vector3 tool_position(const Eigen::VectorXd& q) override { return bare_->tool_position(q); }
  config::Vector3 controlled_point(const Eigen::VectorXd& q) override { return bare_->controlled_point(q); }

 private:
  TroubledDynamics(std::unique_ptr<plant::Mechanics> bare, const config::RobotConfig& robot,
                   const Disturbance& disturbance, MonoTime started, std::uint64_t seed);
  [[nodiscard]] Eigen::VectorXd torque_of_push(const Eigen::VectorXd& q);
  [[nodiscard]] std::vector<plant::Friction> with_more(std::vector<plant::Friction> friction) const;

  std::unique_ptr<plant::Mechanics> bare_, loaded_;  // loaded: with the payload; null without
  config::Simulation simulation_;
  std::vector<bool> passive_;  // by joint: not among the joints whose friction is multiplied
  const Disturbance& disturbance_;
  MonoTime now_;
  std::uint64_t seed_;
};

}  // namespace takt::panel

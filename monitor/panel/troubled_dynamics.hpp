// An arm's dynamics with what a perturbation adds: a force at the tool, a point mass at the tool, more friction in the
// joints. Everything else passes through. Units: N, kg, base frame. Thread rule: one thread at a time.
// Source of the force's joint torques: the transposed Jacobian, by central differences of the tool's position.
#pragma once

#include <expected>
#include <memory>
#include <string>

#include "config/robot_config.hpp"
#include "drivers/plant/arm_dynamics.hpp"
#include "monitor/panel/perturbation.hpp"

namespace takt::panel {

class TroubledDynamics final : public plant::Dynamics {
 public:
  // `disturbance` outlives this. The error is one sentence: the robot has no model the simulator knows.
  static std::expected<std::unique_ptr<TroubledDynamics>, std::string> make(const config::RobotConfig& robot,
                                                                            const Disturbance& disturbance,
                                                                            MonoTime started, std::uint64_t seed);

  void integrate(plant::ArmState& state, const Eigen::VectorXd& tau, const std::vector<plant::Friction>& friction,
                 Duration step) override;
  // As without a payload.
  config::Vector3 tool_position(const Eigen::VectorXd& q) { return bare_->tool_position(q); }

 private:
  TroubledDynamics(std::unique_ptr<plant::ArmDynamics> bare, const config::Simulation& simulation,
                   const Disturbance& disturbance, MonoTime started, std::uint64_t seed)
      : bare_(std::move(bare)), simulation_(simulation), disturbance_(disturbance), now_(started), seed_(seed) {}
  [[nodiscard]] Eigen::VectorXd torque_of_push(const Eigen::VectorXd& q);
  [[nodiscard]] std::vector<plant::Friction> with_more(std::vector<plant::Friction> friction) const;

  std::unique_ptr<plant::ArmDynamics> bare_, loaded_;  // loaded: with the payload; null without
  config::Simulation simulation_;
  const Disturbance& disturbance_;
  MonoTime now_;
  std::uint64_t seed_;
};

}  // namespace takt::panel

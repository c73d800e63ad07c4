// SPDX-License-Identifier: Apache-2.0
// A cart on a belt that carries a pole on a free pivot: M(q) ddq + c(q, dq) + friction = tau.
//
// Joint 0 is the pulley, rad; the cart stands at pulley_radius times it. Joint 1 is the pole, rad, 0 upright, positive
// leaning towards positive cart positions. The cart joint's configured `inertia` counts as the rotor's. Friction of the
// pivot is configured apart from the other joints', and added to what the caller gives.
// Integration is semi-implicit, with friction implicit, as ArmDynamics; stops lie outside the configured limits by
// twice their margin, and are inelastic.
//
// Units: rad, rad/s, Nm, joint side. Thread rule: one thread at a time.
// Source: Lagrange's equations of a point-guided rigid rod; Barto, Sutton and Anderson 1983 for the task.
#pragma once

#include <Eigen/Core>
#include <array>
#include <expected>
#include <memory>
#include <string>

#include "config/robot_config.hpp"
#include "simulation/mechanics.hpp"

namespace takt::simulation {

class CartPoleDynamics final : public Mechanics {
 public:
  // The error is one sentence: the robot file has no cart and pole.
  static std::expected<std::unique_ptr<CartPoleDynamics>, std::string> make(const config::RobotConfig& robot);

  void integrate(ArmState& state, const Eigen::VectorXd& tau, const std::vector<Friction>& friction,
                 Duration step) override;
  // The pole's tip.
  [[nodiscard]] config::Vector3 tool_position(const Eigen::VectorXd& q) override;
  // The cart.
  [[nodiscard]] config::Vector3 controlled_point(const Eigen::VectorXd& q) override;

  [[nodiscard]] Eigen::Matrix2d inertia(double pole) const;
  [[nodiscard]] double energy(const ArmState& state) const;  // J, kinetic and potential; 0 upright at rest

 private:
  explicit CartPoleDynamics(const config::RobotConfig& robot);
  void stop_at_limits(ArmState& state) const;

  config::CartPole machine_;
  double pulley_inertia_ = 0;  // kg m^2: everything that moves with the cart
  double coupling_ = 0;        // kg m^2: pole mass x centre of mass x pulley radius
  double pole_inertia_ = 0;    // kg m^2, about the pivot
  double gravity_moment_ = 0;  // Nm, of the pole held level
  std::array<double, 2> lower_stop_{}, upper_stop_{};
};

}  // namespace takt::simulation

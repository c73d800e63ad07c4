// SPDX-License-Identifier: Apache-2.0
#include "simulation/cart_pole_dynamics.hpp"

#include <Eigen/LU>
#include <algorithm>
#include <cmath>

namespace takt::simulation {
namespace {

constexpr double kGravity = 9.81;  // m/s^2
// Longest sub-step: keeps the explicit part (gravity, centrifugal force) accurate, not only stable.
constexpr Duration kLongestCartSubStep = microseconds(250);

}  // namespace

std::expected<std::unique_ptr<CartPoleDynamics>, std::string> CartPoleDynamics::make(const config::RobotConfig& robot) {
  if (!robot.simulation || !robot.simulation->cart_pole)
    return std::unexpected(robot.file + ": no `simulation.cart_pole`: there is no cart to simulate");
  if (robot.joints.size() != 2) return std::unexpected(robot.file + ": a cart and its pole are two joints");
  return std::unique_ptr<CartPoleDynamics>(new CartPoleDynamics(robot));
}

CartPoleDynamics::CartPoleDynamics(const config::RobotConfig& robot) : machine_(*robot.simulation->cart_pole) {
  const double radius = machine_.pulley_radius;
  pulley_inertia_ = (machine_.cart_mass + machine_.pole_mass) * radius * radius + robot.joints[0].inertia;
  coupling_ = machine_.pole_mass * machine_.pole_com * radius;
  pole_inertia_ = machine_.pole_inertia + machine_.pole_mass * machine_.pole_com * machine_.pole_com;
  gravity_moment_ = machine_.pole_mass * kGravity * machine_.pole_com;
  for (std::size_t joint = 0; joint < 2; ++joint) {
    const config::Limits& limits = robot.joints[joint].limits;
    lower_stop_[joint] = limits.q_min - 2 * limits.position_margin;
    upper_stop_[joint] = limits.q_max + 2 * limits.position_margin;
  }
}

Eigen::Matrix2d CartPoleDynamics::inertia(double pole) const {
  const double coupled = coupling_ * std::cos(pole);
  Eigen::Matrix2d mass;
  mass << pulley_inertia_, coupled, coupled, pole_inertia_;
  return mass;
}

double CartPoleDynamics::energy(const ArmState& state) const {
  const Eigen::Vector2d speed = state.dq;
  return 0.5 * speed.dot(inertia(state.q[1]) * speed) + gravity_moment_ * (std::cos(state.q[1]) - 1);
}

config::Vector3 CartPoleDynamics::tool_position(const Eigen::VectorXd& q) {
  return {machine_.pulley_radius * q[0] + machine_.pole_length * std::sin(q[1]), 0,
          machine_.pole_length * std::cos(q[1])};
}

config::Vector3 CartPoleDynamics::controlled_point(const Eigen::VectorXd& q) {
  return {machine_.pulley_radius * q[0], 0, 0};
}

void CartPoleDynamics::integrate(ArmState& state, const Eigen::VectorXd& tau, const std::vector<Friction>& friction,
                                 Duration step) {
  const auto sub_steps = static_cast<int>((step.ns + kLongestCartSubStep.ns - 1) / kLongestCartSubStep.ns);
  const double dt = step.seconds() / sub_steps;
  for (int turn = 0; turn < sub_steps; ++turn) {
    const double sine = std::sin(state.q[1]);
    const Eigen::Matrix2d mass = inertia(state.q[1]);
    const Eigen::Vector2d bias(-coupling_ * sine * state.dq[1] * state.dq[1], -gravity_moment_ * sine);
    Eigen::Matrix2d left = mass;
    left(1, 1) += dt * machine_.pivot_viscous;
    for (Eigen::Index joint = 0; joint < 2; ++joint) {
      const Friction& rubbing = friction[static_cast<std::size_t>(joint)];
      left(joint, joint) += dt * (rubbing.viscous + rubbing.coulomb / std::max(std::abs(state.dq[joint]), kRestSpeed));
    }
    const Eigen::Vector2d momentum = mass * Eigen::Vector2d(state.dq) + dt * (Eigen::Vector2d(tau) - bias);
    state.dq = left.inverse() * momentum;
    state.q += dt * state.dq;
    stop_at_limits(state);
  }
}

void CartPoleDynamics::stop_at_limits(ArmState& state) const {
  for (std::size_t i = 0; i < 2; ++i) {
    const auto joint = static_cast<Eigen::Index>(i);
    const double inside = std::clamp(state.q[joint], lower_stop_[i], upper_stop_[i]);
    const bool outwards = (state.q[joint] - inside) * state.dq[joint] > 0;
    state.q[joint] = inside;
    if (outwards) state.dq[joint] = 0;
  }
}

}  // namespace takt::simulation

// SPDX-License-Identifier: Apache-2.0
#include "simulation/arm_dynamics.hpp"

#include <Eigen/Cholesky>
#include <algorithm>
#include <cmath>

namespace takt::simulation {
namespace {

// Longest sub-step: keeps the explicit part (gravity, Coriolis) accurate, not only stable.
constexpr Duration kLongestArmSubStep = microseconds(500);

}  // namespace

std::expected<std::unique_ptr<ArmDynamics>, std::string> ArmDynamics::make(const config::RobotConfig& robot) {
  if (!robot.model) return std::unexpected(robot.file + ": no `model`: the simulated arm needs its links");
  const std::span<const config::Link> links = robot.model->links;
  if (links.size() != robot.joints.size() || links.empty())
    return std::unexpected(robot.file + ": the model must have one link per joint");
  std::vector<Arm> arms;
  bool tool_is_last = false;
  for (std::size_t first = 0, i = 0; i < links.size(); ++i) {
    if (links[i].parent != -1 && links[i].parent != static_cast<int>(i) - 1)
      return std::unexpected(robot.file + ": link " + links[i].joint +
                             " is carried neither by the base nor by the link before it: the simulator knows serial "
                             "arms only");
    const bool ends = i + 1 == links.size() || links[i + 1].parent == -1;
    if (!ends) continue;
    tool_is_last |= robot.model->tool_link == static_cast<int>(i);
    arms.push_back(
        {static_cast<Eigen::Index>(first),
         std::make_unique<SerialChain>(links.subspan(first, i + 1 - first),
                                       std::span(robot.joints).subspan(first, i + 1 - first), robot.model->gravity)});
    first = i + 1;
  }
  if (!tool_is_last) return std::unexpected(robot.file + ": the tool must sit on the last link of an arm");
  return std::unique_ptr<ArmDynamics>(new ArmDynamics(std::move(arms), robot));
}

ArmDynamics::ArmDynamics(std::vector<Arm> arms, const config::RobotConfig& robot)
    : arms_(std::move(arms)), tool_(robot.model->tool_xyz) {
  for (std::size_t arm = 0; arm < arms_.size(); ++arm)
    if (arms_[arm].first <= robot.model->tool_link) tool_arm_ = arm;
  for (const config::Joint& joint : robot.joints) {
    rotor_inertia_.push_back(joint.inertia);
    lower_stop_.push_back(joint.limits.q_min - 2 * joint.limits.position_margin);
    upper_stop_.push_back(joint.limits.q_max + 2 * joint.limits.position_margin);
  }
}

Eigen::MatrixXd ArmDynamics::inertia(const Eigen::VectorXd& q) {
  const auto count = static_cast<Eigen::Index>(joint_count());
  Eigen::MatrixXd mass = Eigen::MatrixXd::Zero(count, count);
  for (const Arm& arm : arms_) {
    const Eigen::Index size = arm.chain->size();
    mass.block(arm.first, arm.first, size, size) = arm.chain->inertia(q.segment(arm.first, size));
  }
  for (Eigen::Index i = 0; i < count; ++i) mass(i, i) += rotor_inertia_[static_cast<std::size_t>(i)];
  return mass;
}

Eigen::VectorXd ArmDynamics::gravity_torque(const Eigen::VectorXd& q) {
  Eigen::VectorXd torque(q.size());
  for (const Arm& arm : arms_) {
    const Eigen::Index size = arm.chain->size();
    torque.segment(arm.first, size) = arm.chain->gravity_torque(q.segment(arm.first, size));
  }
  return torque;
}

Eigen::VectorXd ArmDynamics::bias(const ArmState& state) {
  Eigen::VectorXd torque(state.q.size());
  for (const Arm& arm : arms_) {
    const Eigen::Index size = arm.chain->size();
    torque.segment(arm.first, size) =
        arm.chain->bias(state.q.segment(arm.first, size), state.dq.segment(arm.first, size));
  }
  return torque;
}

double ArmDynamics::kinetic_energy(const ArmState& state) {
  return 0.5 * state.dq.dot(inertia(state.q) * state.dq);
}

config::Vector3 ArmDynamics::tool_position(const Eigen::VectorXd& q) {
  const Arm& arm = arms_[tool_arm_];
  return arm.chain->point(q.segment(arm.first, arm.chain->size()), tool_);
}

void ArmDynamics::integrate(ArmState& state, const Eigen::VectorXd& tau, const std::vector<Friction>& friction,
                            Duration step) {
  const auto sub_steps = static_cast<int>((step.ns + kLongestArmSubStep.ns - 1) / kLongestArmSubStep.ns);
  const double dt = step.seconds() / sub_steps;
  const Eigen::MatrixXd mass = inertia(state.q);
  for (int turn = 0; turn < sub_steps; ++turn) {
    // M (dq' - dq) / dt = tau - bias - D dq', with D the friction's damping at the present speed.
    Eigen::MatrixXd left = mass;
    for (std::size_t i = 0; i < friction.size(); ++i) {
      const auto row = static_cast<Eigen::Index>(i);
      const double speed = std::max(std::abs(state.dq[row]), kRestSpeed);
      left(row, row) += dt * (friction[i].viscous + friction[i].coulomb / speed);
    }
    state.dq = left.ldlt().solve(mass * state.dq + dt * (tau - bias(state)));
    state.q += dt * state.dq;
    stop_at_limits(state);
  }
}

void ArmDynamics::stop_at_limits(ArmState& state) const {
  for (std::size_t i = 0; i < lower_stop_.size(); ++i) {
    const auto joint = static_cast<Eigen::Index>(i);
    const double inside = std::clamp(state.q[joint], lower_stop_[i], upper_stop_[i]);
    const bool outwards = (state.q[joint] - inside) * state.dq[joint] > 0;
    state.q[joint] = inside;
    if (outwards) state.dq[joint] = 0;
  }
}

}  // namespace takt::simulation

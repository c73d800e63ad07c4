// SPDX-License-Identifier: Apache-2.0
// Rigid-body dynamics of one or several serial arms on one base, from the configuration's link model:
// M(q) ddq + c(q, dq) + g(q) + friction = tau. Arms do not feel one another.
//
// M holds the links (KDL) plus each joint's configured `inertia` as the rotor's, reflected through its gear, so that
// what the configuration calls the lower bound of the effective inertia is one. Friction is viscous and Coulomb.
// Integration is semi-implicit, with friction implicit: any step is stable against it, and a joint at rest stays there
// up to a creep of kRestSpeed. Hard stops lie outside the configured limits by twice their margin; they are inelastic.
//
// Shapes: one value per joint. Units: rad, rad/s, Nm, joint side. Errors of make(): one sentence.
// Thread rule: one thread at a time. Source: Featherstone, Rigid Body Dynamics Algorithms.
#pragma once

#include <Eigen/Core>
#include <expected>
#include <memory>
#include <string>
#include <vector>

#include "config/robot_config.hpp"
#include "executive/contract/mono_time.hpp"
#include "simulation/mechanics.hpp"
#include "simulation/serial_chain.hpp"

namespace takt::simulation {

class ArmDynamics final : public Mechanics {
 public:
  static std::expected<std::unique_ptr<ArmDynamics>, std::string> make(const config::RobotConfig& robot);

  [[nodiscard]] std::size_t joint_count() const { return lower_stop_.size(); }
  void integrate(ArmState& state, const Eigen::VectorXd& tau, const std::vector<Friction>& friction,
                 Duration step) override;

  [[nodiscard]] Eigen::MatrixXd inertia(const Eigen::VectorXd& q);
  [[nodiscard]] Eigen::VectorXd gravity_torque(const Eigen::VectorXd& q);  // what holds the arm still
  [[nodiscard]] double kinetic_energy(const ArmState& state);              // J
  [[nodiscard]] config::Vector3 tool_position(const Eigen::VectorXd& q) override;
  [[nodiscard]] double lower_stop(std::size_t joint) const { return lower_stop_[joint]; }
  [[nodiscard]] double upper_stop(std::size_t joint) const { return upper_stop_[joint]; }

 private:
  struct Arm {
    Eigen::Index first = 0;  // joint
    std::unique_ptr<SerialChain> chain;
  };
  ArmDynamics(std::vector<Arm> arms, const config::RobotConfig& robot);
  [[nodiscard]] Eigen::VectorXd bias(const ArmState& state);
  void stop_at_limits(ArmState& state) const;

  std::vector<Arm> arms_;
  std::size_t tool_arm_ = 0;
  config::Vector3 tool_{};  // in the last link of that arm
  std::vector<double> rotor_inertia_, lower_stop_, upper_stop_;
};

}  // namespace takt::simulation

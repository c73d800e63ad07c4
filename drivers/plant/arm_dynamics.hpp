// Rigid-body dynamics of a serial arm, from the configuration's link model: M(q) ddq + c(q, dq) + g(q) + friction =
// tau.
//
// M holds the links (KDL) plus each joint's configured `inertia` as the rotor's, reflected through its gear, so that
// what the configuration calls the lower bound of the effective inertia is one. Friction is viscous and Coulomb.
// Integration is semi-implicit, with friction implicit: any step is stable against it, and a joint at rest stays there
// up to a creep of kRestSpeed. Hard stops lie outside the configured limits by twice their margin; they are inelastic.
//
// Shapes: one value per joint. Units: rad, rad/s, Nm, joint side. Errors of make(): one sentence.
// Thread rule: one thread at a time. Source: Featherstone, Rigid Body Dynamics Algorithms; orocos-kdl ChainDynParam.
#pragma once

#include <Eigen/Core>
#include <expected>
#include <kdl/chain.hpp>
#include <kdl/chaindynparam.hpp>
#include <kdl/chainfksolverpos_recursive.hpp>
#include <kdl/chainidsolver_recursive_newton_euler.hpp>
#include <memory>
#include <string>
#include <vector>

#include "config/robot_config.hpp"
#include "drivers/plant/dynamics.hpp"
#include "executive/contract/mono_time.hpp"

namespace takt::plant {

class ArmDynamics final : public Dynamics {
 public:
  static std::expected<std::unique_ptr<ArmDynamics>, std::string> make(const config::RobotConfig& robot);

  [[nodiscard]] std::size_t joint_count() const { return lower_stop_.size(); }
  void integrate(ArmState& state, const Eigen::VectorXd& tau, const std::vector<Friction>& friction,
                 Duration step) override;

  [[nodiscard]] Eigen::MatrixXd inertia(const Eigen::VectorXd& q);
  [[nodiscard]] Eigen::VectorXd gravity_torque(const Eigen::VectorXd& q);  // what holds the arm still
  [[nodiscard]] double kinetic_energy(const ArmState& state);              // J
  [[nodiscard]] config::Vector3 tool_position(const Eigen::VectorXd& q);   // m, base frame
  [[nodiscard]] double lower_stop(std::size_t joint) const { return lower_stop_[joint]; }
  [[nodiscard]] double upper_stop(std::size_t joint) const { return upper_stop_[joint]; }

 private:
  ArmDynamics(const KDL::Chain& chain, const config::RobotConfig& robot);
  void stop_at_limits(ArmState& state) const;

  KDL::Chain chain_;  // declared before what refers to it
  KDL::Frame tool_;
  KDL::Vector gravity_;
  KDL::ChainDynParam parameters_;
  KDL::ChainIdSolver_RNE inverse_dynamics_;
  KDL::ChainFkSolverPos_recursive kinematics_;
  std::vector<double> rotor_inertia_, lower_stop_, upper_stop_;
  // Work space, sized once.
  KDL::JntArray q_, dq_, no_acceleration_, bias_;
  KDL::JntSpaceInertiaMatrix mass_;
  KDL::Wrenches no_forces_;
};

}  // namespace takt::plant

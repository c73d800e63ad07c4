// SPDX-License-Identifier: Apache-2.0
// One chain of links, each carried by the one before it, in rigid-body terms: KDL behind Eigen.
// Shapes: one value per joint of the chain. Units: rad, rad/s, Nm, kg m^2. Thread rule: one thread at a time.
// Source: orocos-kdl ChainDynParam, ChainIdSolver_RNE.
#pragma once

#include <Eigen/Core>
#include <kdl/chain.hpp>
#include <kdl/chaindynparam.hpp>
#include <kdl/chainfksolverpos_recursive.hpp>
#include <kdl/chainidsolver_recursive_newton_euler.hpp>
#include <span>

#include "config/robot_config.hpp"

namespace takt::simulation {

class SerialChain {
 public:
  // Precondition: at least one link, each moved by the joint of its index. The first link's frame sits in the base.
  SerialChain(std::span<const config::Link> links, std::span<const config::Joint> joints,
              const config::Vector3& gravity);
  SerialChain(const SerialChain&) = delete;  // the solvers point into this object
  SerialChain& operator=(const SerialChain&) = delete;

  [[nodiscard]] Eigen::Index size() const { return static_cast<Eigen::Index>(chain_.getNrOfJoints()); }
  // Of the links alone, rotors not included.
  [[nodiscard]] Eigen::MatrixXd inertia(const Eigen::VectorXd& q);
  [[nodiscard]] Eigen::VectorXd gravity_torque(const Eigen::VectorXd& q);
  // Torque that keeps the velocity as it is: gravity and Coriolis.
  [[nodiscard]] Eigen::VectorXd bias(const Eigen::VectorXd& q, const Eigen::VectorXd& dq);
  // A point of the last link's frame, in the base frame, m.
  [[nodiscard]] config::Vector3 point(const Eigen::VectorXd& q, const config::Vector3& in_last_link);

 private:
  KDL::Chain chain_;  // declared before what refers to it
  KDL::ChainDynParam parameters_;
  KDL::ChainIdSolver_RNE inverse_dynamics_;
  KDL::ChainFkSolverPos_recursive kinematics_;
  // Work space, sized once.
  KDL::JntArray q_, dq_, no_acceleration_, torque_;
  KDL::JntSpaceInertiaMatrix mass_;
  KDL::Wrenches no_forces_;
};

}  // namespace takt::simulation

// SPDX-License-Identifier: Apache-2.0
#include "simulation/serial_chain.hpp"

namespace takt::simulation {
namespace {

KDL::Vector vector(const config::Vector3& v) {
  return {v[0], v[1], v[2]};
}

// A link's frame sits at its joint; KDL wants joint origin and axis in the parent's frame, inertia in the link's.
KDL::Segment segment_of(const config::Link& link, config::JointKind kind) {
  const KDL::Rotation rotation = KDL::Rotation::RPY(link.origin_rpy[0], link.origin_rpy[1], link.origin_rpy[2]);
  const KDL::Vector origin = vector(link.origin_xyz);
  const KDL::Joint joint(link.joint, origin, rotation * vector(link.axis),
                         kind == config::JointKind::slide ? KDL::Joint::TransAxis : KDL::Joint::RotAxis);
  const KDL::RotationalInertia about_com(link.inertia[0], link.inertia[1], link.inertia[2]);
  return KDL::Segment(link.joint, joint, KDL::Frame(rotation, origin),
                      KDL::RigidBodyInertia(link.mass, vector(link.com), about_com));
}

KDL::Chain chain_of(std::span<const config::Link> links, std::span<const config::Joint> joints) {
  KDL::Chain chain;
  for (std::size_t i = 0; i < links.size(); ++i) chain.addSegment(segment_of(links[i], joints[i].kind));
  return chain;
}

}  // namespace

SerialChain::SerialChain(std::span<const config::Link> links, std::span<const config::Joint> joints,
                         const config::Vector3& gravity)
    : chain_(chain_of(links, joints)),
      parameters_(chain_, vector(gravity)),
      inverse_dynamics_(chain_, vector(gravity)),
      kinematics_(chain_),
      q_(chain_.getNrOfJoints()),
      dq_(chain_.getNrOfJoints()),
      no_acceleration_(chain_.getNrOfJoints()),
      torque_(chain_.getNrOfJoints()),
      mass_(static_cast<int>(chain_.getNrOfJoints())),
      no_forces_(chain_.getNrOfSegments(), KDL::Wrench::Zero()) {}

Eigen::MatrixXd SerialChain::inertia(const Eigen::VectorXd& q) {
  q_.data = q;
  parameters_.JntToMass(q_, mass_);
  return mass_.data;
}

Eigen::VectorXd SerialChain::gravity_torque(const Eigen::VectorXd& q) {
  q_.data = q;
  parameters_.JntToGravity(q_, torque_);
  return torque_.data;
}

Eigen::VectorXd SerialChain::bias(const Eigen::VectorXd& q, const Eigen::VectorXd& dq) {
  q_.data = q;
  dq_.data = dq;
  inverse_dynamics_.CartToJnt(q_, dq_, no_acceleration_, no_forces_, torque_);
  return torque_.data;
}

config::Vector3 SerialChain::point(const Eigen::VectorXd& q, const config::Vector3& in_last_link) {
  q_.data = q;
  KDL::Frame last;
  kinematics_.JntToCart(q_, last);
  const KDL::Vector at = last * vector(in_last_link);
  return {at.x(), at.y(), at.z()};
}

}  // namespace takt::simulation

#include "drivers/plant/arm_dynamics.hpp"

#include <Eigen/Cholesky>
#include <algorithm>
#include <cmath>

namespace takt::plant {
namespace {

// Longest sub-step: keeps the explicit part (gravity, Coriolis) accurate, not only stable.
constexpr Duration kLongestSubStep = microseconds(500);

KDL::Vector vector(const config::Vector3& v) {
  return {v[0], v[1], v[2]};
}

// A link's frame sits at its joint; KDL wants joint origin and axis in the parent's frame, inertia in the link's.
KDL::Segment segment_of(const config::Link& link) {
  const KDL::Rotation rotation = KDL::Rotation::RPY(link.origin_rpy[0], link.origin_rpy[1], link.origin_rpy[2]);
  const KDL::Vector origin = vector(link.origin_xyz);
  const KDL::Joint joint(link.joint, origin, rotation * vector(link.axis), KDL::Joint::RotAxis);
  const KDL::RotationalInertia about_com(link.inertia[0], link.inertia[1], link.inertia[2]);
  return KDL::Segment(link.joint, joint, KDL::Frame(rotation, origin),
                      KDL::RigidBodyInertia(link.mass, vector(link.com), about_com));
}

}  // namespace

std::expected<std::unique_ptr<ArmDynamics>, std::string> ArmDynamics::make(const config::RobotConfig& robot) {
  if (!robot.model) return std::unexpected(robot.file + ": no `model`: the simulated arm needs its links");
  KDL::Chain chain;
  for (std::size_t i = 0; i < robot.model->links.size(); ++i) {
    const config::Link& link = robot.model->links[i];
    if (link.parent != static_cast<int>(i) - 1)
      return std::unexpected(robot.file + ": link " + link.joint +
                             " is not carried by the link before it: the simulator knows serial arms only");
    chain.addSegment(segment_of(link));
  }
  if (chain.getNrOfJoints() != robot.joints.size() || chain.getNrOfJoints() == 0)
    return std::unexpected(robot.file + ": the model must have one link per joint");
  if (robot.model->tool_link != static_cast<int>(robot.joints.size()) - 1)
    return std::unexpected(robot.file + ": the tool must sit on the last link: the simulator knows serial arms only");
  return std::unique_ptr<ArmDynamics>(new ArmDynamics(chain, robot));
}

ArmDynamics::ArmDynamics(const KDL::Chain& chain, const config::RobotConfig& robot)
    : chain_(chain),
      tool_(vector(robot.model->tool_xyz)),
      gravity_(vector(robot.model->gravity)),
      parameters_(chain_, gravity_),
      inverse_dynamics_(chain_, gravity_),
      kinematics_(chain_),
      q_(chain_.getNrOfJoints()),
      dq_(chain_.getNrOfJoints()),
      no_acceleration_(chain_.getNrOfJoints()),
      bias_(chain_.getNrOfJoints()),
      mass_(static_cast<int>(chain_.getNrOfJoints())),
      no_forces_(chain_.getNrOfSegments(), KDL::Wrench::Zero()) {
  for (const config::Joint& joint : robot.joints) {
    rotor_inertia_.push_back(joint.inertia);
    lower_stop_.push_back(joint.limits.q_min - 2 * joint.limits.position_margin);
    upper_stop_.push_back(joint.limits.q_max + 2 * joint.limits.position_margin);
  }
}

Eigen::MatrixXd ArmDynamics::inertia(const Eigen::VectorXd& q) {
  q_.data = q;
  parameters_.JntToMass(q_, mass_);
  Eigen::MatrixXd mass = mass_.data;
  for (std::size_t i = 0; i < rotor_inertia_.size(); ++i) {
    const auto row = static_cast<Eigen::Index>(i);
    mass(row, row) += rotor_inertia_[i];
  }
  return mass;
}

Eigen::VectorXd ArmDynamics::gravity_torque(const Eigen::VectorXd& q) {
  q_.data = q;
  parameters_.JntToGravity(q_, bias_);
  return bias_.data;
}

double ArmDynamics::kinetic_energy(const ArmState& state) {
  return 0.5 * state.dq.dot(inertia(state.q) * state.dq);
}

config::Vector3 ArmDynamics::tool_position(const Eigen::VectorXd& q) {
  q_.data = q;
  KDL::Frame last;
  kinematics_.JntToCart(q_, last);
  const KDL::Vector at = (last * tool_).p;
  return {at.x(), at.y(), at.z()};
}

void ArmDynamics::integrate(ArmState& state, const Eigen::VectorXd& tau, const std::vector<Friction>& friction,
                            Duration step) {
  const auto sub_steps = static_cast<int>((step.ns + kLongestSubStep.ns - 1) / kLongestSubStep.ns);
  const double dt = step.seconds() / sub_steps;
  const Eigen::MatrixXd mass = inertia(state.q);
  for (int turn = 0; turn < sub_steps; ++turn) {
    q_.data = state.q;
    dq_.data = state.dq;
    inverse_dynamics_.CartToJnt(q_, dq_, no_acceleration_, no_forces_, bias_);
    // M (dq' - dq) / dt = tau - bias - D dq', with D the friction's damping at the present speed.
    Eigen::MatrixXd left = mass;
    for (std::size_t i = 0; i < friction.size(); ++i) {
      const auto row = static_cast<Eigen::Index>(i);
      const double speed = std::max(std::abs(state.dq[row]), kRestSpeed);
      left(row, row) += dt * (friction[i].viscous + friction[i].coulomb / speed);
    }
    state.dq = left.ldlt().solve(mass * state.dq + dt * (tau - bias_.data));
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

}  // namespace takt::plant

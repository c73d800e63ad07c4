// SPDX-License-Identifier: Apache-2.0
#include "simulation/troubled_mechanics.hpp"

#include <algorithm>
#include <utility>

#include "simulation/plant.hpp"

namespace takt::simulation {
namespace {

// The link with a point mass at `at`. Only the moments about the axes are kept, as in the robot file.
config::Link with_point_mass(config::Link link, double mass, const config::Vector3& at) {
  const double total = link.mass + mass;
  const double reduced = link.mass * mass / total;
  config::Vector3 apart{}, com{};
  for (std::size_t i = 0; i < 3; ++i) {
    apart[i] = at[i] - link.com[i];
    com[i] = (link.mass * link.com[i] + mass * at[i]) / total;
  }
  const double square = apart[0] * apart[0] + apart[1] * apart[1] + apart[2] * apart[2];
  for (std::size_t i = 0; i < 3; ++i) link.inertia[i] += reduced * (square - apart[i] * apart[i]);
  link.mass = total;
  link.com = com;
  return link;
}

config::CartPole with_point_mass_at_tip(config::CartPole machine, double mass) {
  const double total = machine.pole_mass + mass;
  const double apart = machine.pole_length - machine.pole_com;
  machine.pole_inertia += machine.pole_mass * mass / total * apart * apart;
  machine.pole_com += mass / total * apart;
  machine.pole_mass = total;
  return machine;
}

config::RobotConfig with_payload(config::RobotConfig robot, double mass) {
  if (robot.simulation->cart_pole) {
    robot.simulation->cart_pole = with_point_mass_at_tip(*robot.simulation->cart_pole, mass);
    return robot;
  }
  config::Link& last = robot.model->links[static_cast<std::size_t>(robot.model->tool_link)];
  last = with_point_mass(last, mass, robot.model->tool_xyz);
  return robot;
}

}  // namespace

TroubledMechanics::TroubledMechanics(std::unique_ptr<Mechanics> bare, const config::RobotConfig& robot)
    : bare_(std::move(bare)), body_(bare_.get()) {
  for (const config::Joint& joint : robot.joints)
    own_friction_.push_back(joint.passive ? Friction{} : friction_of(*robot.simulation, joint));
}

std::unique_ptr<TroubledMechanics> TroubledMechanics::around(std::unique_ptr<Mechanics> bare,
                                                             const config::RobotConfig& robot) {
  return std::unique_ptr<TroubledMechanics>(new TroubledMechanics(std::move(bare), robot));
}

std::expected<std::unique_ptr<TroubledMechanics>, std::string> TroubledMechanics::make(
    const config::RobotConfig& robot, std::span<const double> payloads) {
  auto bare = make_mechanics(robot);
  if (!bare) return std::unexpected(bare.error());
  auto made = around(std::move(*bare), robot);
  if (made->body_->load(0, {})) return made;  // these change their masses themselves
  for (const double payload : payloads) {
    auto loaded = make_mechanics(with_payload(robot, payload));
    if (!loaded) return std::unexpected(loaded.error());
    made->loaded_.emplace_back(payload, std::move(*loaded));
  }
  return made;
}

void TroubledMechanics::set(const BodyTrouble& trouble) {
  trouble_ = trouble;
  if (bare_->load(trouble.payload, trouble.loaded)) return;
  const auto found = std::ranges::find(loaded_, trouble.payload, [](const auto& one) { return one.first; });
  body_ = found == loaded_.end() ? bare_.get() : found->second.get();
}

Eigen::VectorXd TroubledMechanics::torque_of_force(const Eigen::VectorXd& q) {
  constexpr double kStep = 1e-5;  // rad
  Eigen::VectorXd torque(q.size()), moved = q;
  for (Eigen::Index joint = 0; joint < q.size(); ++joint) {
    moved[joint] = q[joint] + kStep;
    const config::Vector3 ahead = bare_->tool_position(moved);
    moved[joint] = q[joint] - kStep;
    const config::Vector3 behind = bare_->tool_position(moved);
    moved[joint] = q[joint];
    double along = 0;
    for (std::size_t i = 0; i < 3; ++i) along += trouble_.towards[i] * (ahead[i] - behind[i]) / (2 * kStep);
    torque[joint] = trouble_.force * along;
  }
  return torque;
}

std::vector<Friction> TroubledMechanics::with_more(std::vector<Friction> friction) const {
  const double more = trouble_.friction - 1;
  for (std::size_t joint = 0; joint < friction.size(); ++joint) {
    friction[joint].viscous += more * own_friction_[joint].viscous;
    friction[joint].coulomb += more * own_friction_[joint].coulomb;
  }
  return friction;
}

void TroubledMechanics::integrate(ArmState& state, const Eigen::VectorXd& tau, const std::vector<Friction>& friction,
                                  Duration step) {
  const config::Vector3 force{trouble_.towards[0] * trouble_.force, trouble_.towards[1] * trouble_.force,
                              trouble_.towards[2] * trouble_.force};
  const bool pushed = !body_->push(force, trouble_.pushed) && trouble_.force != 0, rubs = trouble_.friction != 1;
  if (!pushed && !rubs) return body_->integrate(state, tau, friction, step);
  body_->integrate(state, pushed ? Eigen::VectorXd(tau + torque_of_force(state.q)) : tau,
                   rubs ? with_more(friction) : friction, step);
}

}  // namespace takt::simulation

#include "monitor/panel/troubled_dynamics.hpp"

#include <cmath>
#include <utility>

#include "monitor/panel/random.hpp"

namespace takt::panel {
namespace {

constexpr std::uint64_t kPushStream = 401;
constexpr Duration kPushLength = milliseconds(100);

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

config::Vector3 direction(Random& random) {
  const config::Vector3 drawn{random.normal(), random.normal(), random.normal()};
  const double length = std::hypot(drawn[0], drawn[1], drawn[2]);
  return {drawn[0] / length, drawn[1] / length, drawn[2] / length};
}

}  // namespace

TroubledDynamics::TroubledDynamics(std::unique_ptr<plant::Mechanics> bare, const config::RobotConfig& robot,
                                   const Disturbance& disturbance, MonoTime started, std::uint64_t seed)
    : bare_(std::move(bare)), simulation_(*robot.simulation), disturbance_(disturbance), now_(started), seed_(seed) {
  for (const config::Joint& joint : robot.joints) passive_.push_back(joint.passive);
}

std::expected<std::unique_ptr<TroubledDynamics>, std::string> TroubledDynamics::make(const config::RobotConfig& robot,
                                                                                     const Disturbance& disturbance,
                                                                                     MonoTime started,
                                                                                     std::uint64_t seed) {
  auto bare = plant::make_mechanics(robot);
  if (!bare) return std::unexpected(bare.error());
  std::unique_ptr<TroubledDynamics> made(new TroubledDynamics(std::move(*bare), robot, disturbance, started, seed));
  if (disturbance.trouble() != Trouble::payload) return made;
  auto loaded = plant::make_mechanics(with_payload(robot, disturbance.dose(Trouble::payload, disturbance.begins())));
  if (!loaded) return std::unexpected(loaded.error());
  made->loaded_ = std::move(*loaded);
  return made;
}

Eigen::VectorXd TroubledDynamics::torque_of_push(const Eigen::VectorXd& q) {
  constexpr double kStep = 1e-5;  // rad
  const std::int64_t turn = disturbance_.turn(Trouble::push, now_);
  Random random(plant::seed_for(seed_, kPushStream), static_cast<std::uint64_t>(turn));
  const config::Vector3 towards = direction(random);
  const double force = disturbance_.dose(Trouble::push, now_);
  Eigen::VectorXd torque(q.size()), moved = q;
  for (Eigen::Index joint = 0; joint < q.size(); ++joint) {
    moved[joint] = q[joint] + kStep;
    const config::Vector3 ahead = bare_->tool_position(moved);
    moved[joint] = q[joint] - kStep;
    const config::Vector3 behind = bare_->tool_position(moved);
    moved[joint] = q[joint];
    double along = 0;
    for (std::size_t i = 0; i < 3; ++i) along += towards[i] * (ahead[i] - behind[i]) / (2 * kStep);
    torque[joint] = force * along;
  }
  return torque;
}

std::vector<plant::Friction> TroubledDynamics::with_more(std::vector<plant::Friction> friction) const {
  const double more = disturbance_.dose(Trouble::friction, now_) - 1;
  for (std::size_t joint = 0; joint < friction.size(); ++joint) {
    if (passive_[joint]) continue;
    friction[joint].viscous += more * simulation_.viscous;
    friction[joint].coulomb += more * simulation_.coulomb;
  }
  return friction;
}

void TroubledDynamics::integrate(plant::ArmState& state, const Eigen::VectorXd& tau,
                                 const std::vector<plant::Friction>& friction, Duration step) {
  const std::int64_t turn = disturbance_.turn(Trouble::push, now_);
  const bool pushed = turn != 0 && now_ - disturbance_.begins() - kRepeat * (turn - 1) < kPushLength;
  const bool heavy = loaded_ != nullptr && disturbance_.dose(Trouble::payload, now_) > 0;
  plant::Mechanics& body = heavy ? *loaded_ : *bare_;
  if (pushed)
    body.integrate(state, tau + torque_of_push(state.q), friction, step);
  else if (disturbance_.dose(Trouble::friction, now_) > 0)
    body.integrate(state, tau, with_more(friction), step);
  else
    body.integrate(state, tau, friction, step);
  now_ = now_ + step;
}

}  // namespace takt::panel

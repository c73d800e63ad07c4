// SPDX-License-Identifier: Apache-2.0
#include "lab/study/joint_margins.hpp"

#include <algorithm>
#include <cmath>
#include <limits>

#include "evidence/rollout/rollout.hpp"
#include "lab/study/gain_advice.hpp"
#include "lab/study/injected_sine.hpp"
#include "simulation/arm_dynamics.hpp"
#include "simulation/free_inertias.hpp"

namespace takt::study {
namespace {

// Remembers what was asked, for the picture.
LoopResponse remembered(const LoopResponse& response, std::vector<ResponsePoint>& points) {
  return [&response, &points](double omega) {
    points.push_back({omega, response(omega)});
    return points.back().loop;
  };
}

LoopMargins search(const LoopResponse& response, const Sweep& sweep, std::vector<ResponsePoint>& points) {
  const LoopMargins margins = margins_of(remembered(response, points), sweep);
  std::ranges::sort(points, {}, &ResponsePoint::omega);
  return margins;
}

// A margin that only one of the two shows is no agreement.
double difference(const std::optional<double>& computed, const std::optional<double>& injected) {
  if (!computed && !injected) return 0;
  if (!computed || !injected) return std::numeric_limits<double>::infinity();
  return std::abs(*injected - *computed) / std::abs(*computed);
}

double disagreement(const LoopMargins& computed, const LoopMargins& injected) {
  return std::max({difference(computed.gain, injected.gain), difference(computed.phase_rad, injected.phase_rad),
                   difference(computed.delay_s, injected.delay_s)});
}

JointMargins measure(const MarginSetup& setup, std::size_t joint, const InnerLoop& computed, HoldingLoop& loop) {
  const config::Joint& settings = setup.robot.joints[joint];
  JointMargins made;
  made.joint = settings.name;
  made.not_computed = not_computable(settings);
  if (made.not_computed.empty())
    made.computed = search([&](double omega) { return computed.loop(joint, omega); },
                           sweep_of(computed.step(), 300, 30), made.computed_response);
  InjectedSine sine(setup.measured, loop, computed);
  made.injected = search([&](double omega) { return sine.response(joint, omega); }, sweep_of(computed.step(), 24, 3),
                         made.injected_response);
  made.trouble = sine.trouble();
  if (made.not_computed.empty()) made.disagreement = disagreement(made.computed, made.injected);
  if (made.rings()) made.advice = gain_advice(setup.robot, joint, setup.dynamics, setup.pose);
  return made;
}

}  // namespace

bool JointMargins::agrees() const {
  return trouble.empty() && (!disagreement || *disagreement <= kAgreement);
}

std::optional<double> JointMargins::phase_rad() const {
  if (!computed.phase_rad || !injected.phase_rad) return computed.phase_rad ? computed.phase_rad : injected.phase_rad;
  return std::min(*computed.phase_rad, *injected.phase_rad);
}

bool JointMargins::rings() const {
  return phase_rad() && *phase_rad() < kLeastPhase_rad;
}

std::expected<std::unique_ptr<simulation::Dynamics>, std::string> dynamics_of(const config::RobotConfig& robot) {
  if (robot.model) {
    auto arm = simulation::ArmDynamics::make(robot);
    if (!arm) return std::unexpected(arm.error());
    return std::move(*arm);
  }
  std::vector<double> inertia;
  for (const config::Joint& joint : robot.joints) inertia.push_back(joint.inertia);
  return std::make_unique<simulation::FreeInertias>(std::move(inertia));
}

std::string no_rest(const config::RobotConfig& robot) {
  if (robot.simulation && robot.simulation->cart_pole)
    return "its pole falls while the drive holds the cart: no joint comes to rest without the policy";
  if (evidence::task_of(robot) == evidence::Task::base_velocity)
    return "its base is free and falls: no joint comes to rest without the policy";
  return {};
}

Eigen::VectorXd home_pose(const config::RobotConfig& robot) {
  Eigen::VectorXd pose(static_cast<Eigen::Index>(robot.joints.size()));
  for (std::size_t joint = 0; joint < robot.joints.size(); ++joint)
    pose[static_cast<Eigen::Index>(joint)] = robot.joints[joint].home;
  return pose;
}

std::expected<std::vector<JointMargins>, std::string> joint_margins(const MarginSetup& setup) {
  if (!setup.robot.simulation)
    return std::unexpected(setup.robot.file + ": no `simulation`: there is no plant to measure on");
  std::vector<JointMargins> all(setup.robot.joints.size());
  for (std::size_t joint = 0; joint < all.size(); ++joint) {
    all[joint].joint = setup.robot.joints[joint].name;
    all[joint].no_loop = no_loop(setup.robot.joints[joint]);
  }
  if (std::ranges::none_of(all, &JointMargins::has_loop)) return all;
  auto still = setup.dynamics(setup.robot);
  if (!still) return std::unexpected(still.error());
  const auto computed = InnerLoop::make(setup.robot, **still, setup.pose);
  if (!computed) return std::unexpected(computed.error());
  auto moving = setup.dynamics(setup.measured);
  if (!moving) return std::unexpected(moving.error());
  auto loop = HoldingLoop::make(setup.measured, std::move(*moving), setup.pose);
  if (!loop) return std::unexpected(loop.error());
  for (std::size_t joint = 0; joint < all.size(); ++joint) {
    if (all[joint].has_loop()) all[joint] = measure(setup, joint, *computed, **loop);
    if (setup.on_joint) setup.on_joint(joint + 1, all.size());
  }
  return all;
}

}  // namespace takt::study

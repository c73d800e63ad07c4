#include "evidence/study/joint_margins.hpp"

#include <algorithm>
#include <cmath>
#include <limits>
#include <numbers>

#include "evidence/study/injected_sine.hpp"
#include "simulation/arm_dynamics.hpp"
#include "simulation/free_inertias.hpp"

namespace takt::margin {
namespace {

constexpr double kLowest_Hz = 1;
constexpr double kShareOfNyquist = 0.95;

Sweep sweep_of(Duration step, int points, int refinements) {
  return {2 * std::numbers::pi * kLowest_Hz, kShareOfNyquist * std::numbers::pi / step.seconds(), points, refinements};
}

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
  JointMargins made{.joint = settings.name,
                    .not_computed = not_computable(settings),
                    .computed = {},
                    .injected = {},
                    .computed_response = {},
                    .injected_response = {},
                    .trouble = {},
                    .disagreement = {}};
  if (made.not_computed.empty())
    made.computed = search([&](double omega) { return computed.loop(joint, omega); },
                           sweep_of(computed.step(), 300, 30), made.computed_response);
  InjectedSine sine(setup.measured, loop, computed);
  made.injected = search([&](double omega) { return sine.response(joint, omega); }, sweep_of(computed.step(), 24, 3),
                         made.injected_response);
  made.trouble = sine.trouble();
  if (made.not_computed.empty()) made.disagreement = disagreement(made.computed, made.injected);
  return made;
}

}  // namespace

bool JointMargins::agrees() const {
  return trouble.empty() && (!disagreement || *disagreement <= kAgreement);
}

std::expected<std::unique_ptr<plant::Dynamics>, std::string> dynamics_of(const config::RobotConfig& robot) {
  if (robot.model) {
    auto arm = plant::ArmDynamics::make(robot);
    if (!arm) return std::unexpected(arm.error());
    return std::move(*arm);
  }
  std::vector<double> inertia;
  for (const config::Joint& joint : robot.joints) inertia.push_back(joint.inertia);
  return std::make_unique<plant::FreeInertias>(std::move(inertia));
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
  auto still = setup.dynamics(setup.robot);
  if (!still) return std::unexpected(still.error());
  const auto computed = InnerLoop::make(setup.robot, **still, setup.pose);
  if (!computed) return std::unexpected(computed.error());
  auto moving = setup.dynamics(setup.measured);
  if (!moving) return std::unexpected(moving.error());
  auto loop = HoldingLoop::make(setup.measured, std::move(*moving), setup.pose);
  if (!loop) return std::unexpected(loop.error());
  std::vector<JointMargins> all;
  for (std::size_t joint = 0; joint < setup.robot.joints.size(); ++joint) {
    if (has_loop(setup.robot.joints[joint])) all.push_back(measure(setup, joint, *computed, **loop));
    if (setup.on_joint) setup.on_joint(joint + 1, setup.robot.joints.size());
  }
  return all;
}

}  // namespace takt::margin

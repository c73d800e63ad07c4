// SPDX-License-Identifier: Apache-2.0
#include "lab/study/inner_loop.hpp"

#include <Eigen/LU>
#include <algorithm>
#include <array>
#include <utility>

#include "executive/pipeline/gravity_model.hpp"
#include "executive/setup/tick_config_of.hpp"
#include "simulation/plant.hpp"

namespace takt::study {
namespace {

using Complex = std::complex<double>;

Complex delayed(double omega, double seconds) {
  return std::polar(1.0, -omega * seconds);
}

// Slope of what the executive adds against gravity.
Eigen::MatrixXd slope_of_compensation(const config::RobotConfig& robot, const Eigen::VectorXd& pose) {
  constexpr float kStep = 0.02F;  // rad: wide enough for single precision
  const Eigen::Index n = pose.size();
  Eigen::MatrixXd slope = Eigen::MatrixXd::Zero(n, n);
  const pipeline::TickConfig config = setup::tick_config_of(robot, 0);
  if (!config.gravity_compensation) return slope;
  const pipeline::GravityModel model(config);
  const Eigen::VectorXf at = pose.cast<float>();
  std::array<float, kMaxJoints> q{}, ahead{}, behind{};
  std::copy(at.begin(), at.end(), q.begin());
  for (Eigen::Index i = 0; i < n; ++i) {
    float& moved = q[static_cast<std::size_t>(i)];
    moved = at[i] + kStep;
    model.torques(q, ahead);
    moved = at[i] - kStep;
    model.torques(q, behind);
    moved = at[i];
    for (Eigen::Index j = 0; j < n; ++j)
      slope(j, i) =
          double{ahead[static_cast<std::size_t>(j)] - behind[static_cast<std::size_t>(j)]} / (2 * double{kStep});
  }
  return slope;
}

bool closed_by_host(const config::Drive& drive) {
  return drive.protocol == config::DriveProtocol::odrive || drive.protocol == config::DriveProtocol::cia402;
}

}  // namespace

std::string not_computable(const config::Joint& joint) {
  if (joint.drive.protocol != config::DriveProtocol::cia402 || joint.drive.mode == config::Cia402Mode::cst) return {};
  return "the drive closes a loop of its own, whose gains the robot file does not know";
}

std::string no_loop(const config::Joint& joint) {
  if (joint.passive) return "passive: no drive moves it";
  return joint.kp > 0 || joint.kd > 0 ? "" : "kp and kd are 0: the policy alone holds it";
}

std::expected<InnerLoop, std::string> InnerLoop::make(const config::RobotConfig& robot, simulation::Dynamics& dynamics,
                                                      const Eigen::VectorXd& pose) {
  Eigen::VectorXd viscous(pose.size());
  for (Eigen::Index j = 0; j < pose.size(); ++j)
    viscous[j] = simulation::friction_of(*robot.simulation, robot.joints[static_cast<std::size_t>(j)]).viscous;
  const auto linear = linearise(dynamics, pose, viscous);
  if (!linear) return std::unexpected(robot.file + ": " + linear.error());
  std::vector<Gains> gains;
  for (const config::Joint& joint : robot.joints) {
    const bool open = !not_computable(joint).empty();
    gains.push_back({open ? 0 : joint.kp, open ? 0 : joint.kd, closed_by_host(joint.drive)});
  }
  return InnerLoop(sample(*linear, robot.simulation->step), std::move(gains), robot,
                   slope_of_compensation(robot, pose));
}

InnerLoop::InnerLoop(SampledPlant plant, std::vector<Gains> gains, const config::RobotConfig& robot,
                     Eigen::MatrixXd gravity_slope)
    : plant_(std::move(plant)),
      gains_(std::move(gains)),
      gravity_slope_(std::move(gravity_slope)),
      period_(robot.control.period) {
  const Duration step = robot.simulation->step;
  torque_delay_steps_ = (robot.simulation->torque_delay.ns + step.ns / 2) / step.ns;
  for (const config::Joint& joint : robot.joints) observer_bandwidth_.push_back(joint.observer_bandwidth);
}

// velocity_observer.cpp as a transfer function, from the position it is given to the position at the tick; a reply is
// on average half a period old by its stamp.
InnerLoop::Observed InnerLoop::observer(std::size_t joint, Complex z) const {
  const double dt = period_.seconds(), bandwidth = observer_bandwidth_[joint];
  const double pole = 1 / (1 + bandwidth * dt), speed_gain = bandwidth * bandwidth * pole * pole * dt;
  const double position_gain = 1 - pole * pole;
  Eigen::Matrix2cd update;
  update << 1 - position_gain, (1 - position_gain) * dt, -speed_gain, 1 - speed_gain * dt;
  const Eigen::Matrix2cd system = Eigen::Matrix2cd::Identity() - update / z;
  const Eigen::Vector2cd state = system.partialPivLu().solve(Eigen::Vector2cd(position_gain, speed_gain));
  return {state[0] + state[1] * (dt / 2), state[1]};
}

Eigen::MatrixXcd InnerLoop::controller(double omega) const {
  const auto n = static_cast<Eigen::Index>(gains_.size());
  const double step = plant_.step.seconds(), period = period_.seconds();
  const Complex acts = delayed(omega, static_cast<double>(torque_delay_steps_) * step);
  const Complex by_host = delayed(omega, period + step + (period - step) / 2);
  const Complex z_of_period = std::polar(1.0, omega * period);
  Eigen::MatrixXcd made = Eigen::MatrixXcd::Zero(n, 2 * n);
  for (Eigen::Index j = 0; j < n; ++j) {
    const Gains& gains = gains_[static_cast<std::size_t>(j)];
    if (gains.by_host) {  // the law is the pipeline's, on its own estimates
      const Observed seen = observer(static_cast<std::size_t>(j), z_of_period);
      made(j, j) = acts * by_host * (gains.kp * seen.position + gains.kd * seen.velocity);
    } else {
      made(j, j) = gains.kp * acts;
      made(j, n + j) = gains.kd * acts;
    }
  }
  if (gravity_slope_.isZero()) return made;
  for (Eigen::Index i = 0; i < n; ++i)
    made.col(i) -=
        gravity_slope_.col(i) * (acts * by_host * observer(static_cast<std::size_t>(i), z_of_period).position);
  return made;
}

Complex InnerLoop::loop(std::size_t joint, double omega) const {
  const Eigen::MatrixXcd all = controller(omega) * plant_.response(omega);
  const Eigen::Index n = all.rows(), rest = n - 1;
  const auto j = static_cast<Eigen::Index>(joint);
  if (rest == 0) return all(0, 0);
  std::vector<Eigen::Index> others;
  for (Eigen::Index i = 0; i < n; ++i)
    if (i != j) others.push_back(i);
  const Eigen::MatrixXcd closed = Eigen::MatrixXcd::Identity(rest, rest) + all(others, others);
  const Eigen::VectorXcd they = closed.partialPivLu().solve(all(others, j));
  return all(j, j) - (all(j, others) * they)(0);
}

Eigen::VectorXcd InnerLoop::disturbed(std::size_t joint, double omega) const {
  const Eigen::MatrixXcd plant = plant_.response(omega);
  const Eigen::Index n = plant.cols();
  const Eigen::MatrixXcd closed = Eigen::MatrixXcd::Identity(n, n) + controller(omega) * plant;
  return plant * closed.partialPivLu().solve(Eigen::VectorXcd::Unit(n, static_cast<Eigen::Index>(joint)));
}

}  // namespace takt::study

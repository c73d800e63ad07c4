// SPDX-License-Identifier: Apache-2.0
#include "lab/study/linear_plant.hpp"

#include <Eigen/LU>
#include <Eigen/QR>
#include <vector>

namespace takt::study {
namespace {

constexpr Duration kInstant = microseconds(10);
constexpr double kSmallAngle = 1e-4, kSmallSpeed = 1e-4, kSmallTorque = 1e-2;
constexpr double kStill = 1e-6;  // rad/s^2 that the holding torques may leave
constexpr int kSeriesTerms = 24;

// Accelerations at one state, from one instant under constant torque.
class Acceleration {
 public:
  Acceleration(simulation::Dynamics& dynamics, const Eigen::VectorXd& viscous) : dynamics_(dynamics) {
    for (const double each : viscous) friction_.push_back({each, 0});
  }
  Eigen::VectorXd operator()(const Eigen::VectorXd& q, const Eigen::VectorXd& dq, const Eigen::VectorXd& tau) {
    simulation::ArmState state{q, dq};
    dynamics_.integrate(state, tau, friction_, kInstant);
    return (state.dq - dq) / kInstant.seconds();
  }

 private:
  simulation::Dynamics& dynamics_;
  std::vector<simulation::Friction> friction_;
};

// Column by column, central differences of `f` around `at`.
template <class Function>
Eigen::MatrixXd jacobian(const Eigen::VectorXd& at, double small, Function f) {
  Eigen::MatrixXd slopes(at.size(), at.size());
  Eigen::VectorXd moved = at;
  for (Eigen::Index i = 0; i < at.size(); ++i) {
    moved[i] = at[i] + small;
    const Eigen::VectorXd ahead = f(moved);
    moved[i] = at[i] - small;
    slopes.col(i) = (ahead - f(moved)) / (2 * small);
    moved[i] = at[i];
  }
  return slopes;
}

}  // namespace

std::expected<LinearPlant, std::string> linearise(simulation::Dynamics& dynamics, const Eigen::VectorXd& pose,
                                                  const Eigen::VectorXd& viscous) {
  Acceleration acceleration(dynamics, viscous);
  const Eigen::Index n = pose.size();
  const Eigen::VectorXd rest = Eigen::VectorXd::Zero(n);
  const Eigen::MatrixXd by_tau =
      jacobian(rest, kSmallTorque, [&](const auto& tau) { return acceleration(pose, rest, tau); });
  LinearPlant plant;
  plant.holding_tau = by_tau.completeOrthogonalDecomposition().solve(-acceleration(pose, rest, rest));
  const Eigen::VectorXd left = acceleration(pose, rest, plant.holding_tau);
  if (left.cwiseAbs().maxCoeff() > kStill * (1 + by_tau.cwiseAbs().maxCoeff()))
    return std::unexpected("the pose cannot be held: with the best torques the joints still accelerate");
  const Eigen::VectorXd& tau = plant.holding_tau;
  plant.a = Eigen::MatrixXd::Zero(2 * n, 2 * n);
  plant.b = Eigen::MatrixXd::Zero(2 * n, n);
  plant.a.topRightCorner(n, n).setIdentity();
  plant.a.bottomLeftCorner(n, n) =
      jacobian(pose, kSmallAngle, [&](const auto& q) { return acceleration(q, rest, tau); });
  plant.a.bottomRightCorner(n, n) =
      jacobian(rest, kSmallSpeed, [&](const auto& dq) { return acceleration(pose, dq, tau); });
  plant.b.bottomRows(n) = by_tau;
  return plant;
}

// exp([a b; 0 0] step) by its series, which the short step keeps short.
SampledPlant sample(const LinearPlant& plant, Duration step) {
  const Eigen::Index states = plant.a.rows(), inputs = plant.b.cols();
  Eigen::MatrixXd rate = Eigen::MatrixXd::Zero(states + inputs, states + inputs);
  rate.topLeftCorner(states, states) = plant.a * step.seconds();
  rate.topRightCorner(states, inputs) = plant.b * step.seconds();
  Eigen::MatrixXd sum = Eigen::MatrixXd::Identity(states + inputs, states + inputs), term = sum;
  for (int power = 1; power <= kSeriesTerms; ++power) {
    term = (term * rate / power).eval();
    sum += term;
  }
  return {sum.topLeftCorner(states, states), sum.topRightCorner(states, inputs), step};
}

Eigen::MatrixXcd SampledPlant::response(double omega) const {
  const std::complex<double> z = std::polar(1.0, omega * step.seconds());
  const Eigen::MatrixXcd resolvent =
      z * Eigen::MatrixXcd::Identity(phi.rows(), phi.cols()) - phi.cast<std::complex<double>>();
  return resolvent.partialPivLu().solve(gamma.cast<std::complex<double>>());
}

}  // namespace takt::study

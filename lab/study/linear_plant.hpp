// SPDX-License-Identifier: Apache-2.0
// Any mechanics behind simulation::Dynamics, linearised around a pose at rest: ddq = A_q dq + A_v ddq + B tau, by
// central differences of one very short step, so that M(q), gravity's stiffness, viscous friction and joints without a
// drive come out of whatever integrates them. Then sampled: exact for torques that are constant during a step.
//
// Coulomb friction has no linearisation at rest and is left out. It only takes energy out, so a loop is at least as
// stable with it. Units: rad (or m), s, Nm (or N). Errors: one sentence. Thread rule: one thread at a time.
#pragma once

#include <Eigen/Core>
#include <complex>
#include <expected>
#include <string>

#include "executive/contract/mono_time.hpp"
#include "simulation/dynamics.hpp"

namespace takt::study {

// x = (q, dq), each relative to the pose; n joints.
struct LinearPlant {
  Eigen::MatrixXd a;            // 2n x 2n: dx/dt = a x + b tau
  Eigen::MatrixXd b;            // 2n x n
  Eigen::VectorXd holding_tau;  // n: keeps the pose
};

// `viscous`: Nm s/rad, one per joint. The error: the pose cannot be held by the torques that there are.
std::expected<LinearPlant, std::string> linearise(simulation::Dynamics& dynamics, const Eigen::VectorXd& pose,
                                                  const Eigen::VectorXd& viscous);

// x[k+1] = phi x[k] + gamma tau[k].
struct SampledPlant {
  Eigen::MatrixXd phi, gamma;
  Duration step;
  // From tau to x at z = exp(i omega step): 2n x n.
  [[nodiscard]] Eigen::MatrixXcd response(double omega) const;
};
SampledPlant sample(const LinearPlant& plant, Duration step);

}  // namespace takt::study

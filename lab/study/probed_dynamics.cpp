// SPDX-License-Identifier: Apache-2.0
#include "lab/study/probed_dynamics.hpp"

#include <algorithm>
#include <cmath>

namespace takt::study {

void ProbedDynamics::inject(std::size_t joint, double amplitude, double omega) {
  joint_ = static_cast<Eigen::Index>(joint);
  amplitude_ = amplitude;
  omega_ = omega;
  record_ = {};
}

void ProbedDynamics::integrate(simulation::ArmState& state, const Eigen::VectorXd& tau,
                               const std::vector<simulation::Friction>& friction, Duration step) {
  Eigen::VectorXd total = tau;
  total[joint_] += amplitude_ * std::sin(omega_ * step.seconds() * static_cast<double>(record_.total.size()));
  record_.control.push_back(tau[joint_]);
  record_.total.push_back(total[joint_]);
  std::vector<simulation::Friction> smooth = friction;
  for (std::size_t joint = 0; joint < smooth.size(); ++joint)
    smooth[joint].coulomb = std::max(smooth[joint].coulomb - own_[joint].coulomb, 0.0);
  bare_->integrate(state, total, smooth, step);
}

}  // namespace takt::study

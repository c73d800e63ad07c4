// SPDX-License-Identifier: Apache-2.0
#include "simulation/free_inertias.hpp"

#include <algorithm>
#include <cmath>

namespace takt::simulation {

void FreeInertias::integrate(ArmState& state, const Eigen::VectorXd& tau, const std::vector<Friction>& friction,
                             Duration step) {
  const double dt = step.seconds();
  for (std::size_t i = 0; i < inertia_.size(); ++i) {
    const auto joint = static_cast<Eigen::Index>(i);
    const double speed = std::max(std::abs(state.dq[joint]), kRestSpeed);
    const double damping = friction[i].viscous + friction[i].coulomb / speed;
    state.dq[joint] = (inertia_[i] * state.dq[joint] + dt * tau[joint]) / (inertia_[i] + dt * damping);
    state.q[joint] += dt * state.dq[joint];
  }
}

}  // namespace takt::simulation

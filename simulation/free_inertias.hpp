// SPDX-License-Identifier: Apache-2.0
// Mechanics of drives that carry nothing but a flywheel each: J ddq + friction = tau. No gravity, no stops, no
// coupling. Semi-implicit with friction implicit, as ArmDynamics: without friction the speed after constant torque is
// exact, and a wheel at rest stays there up to a creep of kRestSpeed.
#pragma once

#include "simulation/dynamics.hpp"

namespace takt::simulation {

class FreeInertias final : public Dynamics {
 public:
  // kg m^2, joint side, each > 0.
  explicit FreeInertias(std::vector<double> inertia) : inertia_(std::move(inertia)) {}
  void integrate(ArmState& state, const Eigen::VectorXd& tau, const std::vector<Friction>& friction,
                 Duration step) override;

 private:
  std::vector<double> inertia_;
};

}  // namespace takt::simulation

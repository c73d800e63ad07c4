// SPDX-License-Identifier: Apache-2.0
// What the drives' torques move: the port between drives and mechanics. Implementations: a whole robot's
// (mechanics.hpp), FreeInertias (one flywheel per drive). Shapes: one value per joint. Units: rad, rad/s, Nm, joint
// side. Thread rule: one thread at a time.
#pragma once

#include <Eigen/Core>
#include <vector>

#include "executive/contract/mono_time.hpp"

namespace takt::simulation {

// Below this speed Coulomb friction acts as stiff damping instead of jumping between its two signs.
inline constexpr double kRestSpeed = 1e-4;  // rad/s

struct Friction {
  double viscous = 0;  // Nm s/rad
  double coulomb = 0;  // Nm
};

struct ArmState {
  Eigen::VectorXd q, dq;
};

class Dynamics {
 public:
  virtual ~Dynamics() = default;
  // One step of at most a few milliseconds under constant torque; `friction` one entry per joint.
  virtual void integrate(ArmState& state, const Eigen::VectorXd& tau, const std::vector<Friction>& friction,
                         Duration step) = 0;
  // A robot with a base of its own hangs on a hoist from now on, or no longer. Others have none.
  virtual void hoist(bool hangs) { (void)hangs; }
};

}  // namespace takt::simulation

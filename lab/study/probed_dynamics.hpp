// SPDX-License-Identifier: Apache-2.0
// Some mechanics with a sine added to one joint's torque, just where the drive's torque enters, and both written down:
// what a loop's frequency response is measured from. Coulomb friction is taken out (see linear_plant.hpp); brakes stay.
// Units: Nm (or N), rad/s. Thread rule: one thread at a time.
#pragma once

#include <memory>
#include <vector>

#include "simulation/dynamics.hpp"

namespace takt::study {

// One entry per step of the plant since inject().
struct ProbeRecord {
  std::vector<double> control;  // what the loop gave
  std::vector<double> total;    // with what was added: what the joint got
};

class ProbedDynamics final : public simulation::Dynamics {
 public:
  // `own`: the robot file's friction, by joint.
  ProbedDynamics(std::unique_ptr<simulation::Dynamics> bare, std::vector<simulation::Friction> own)
      : bare_(std::move(bare)), own_(std::move(own)) {}

  // From the next step on; amplitude 0 adds nothing and goes on recording.
  void inject(std::size_t joint, double amplitude, double omega);
  void integrate(simulation::ArmState& state, const Eigen::VectorXd& tau,
                 const std::vector<simulation::Friction>& friction, Duration step) override;
  [[nodiscard]] const ProbeRecord& record() const { return record_; }

 private:
  std::unique_ptr<simulation::Dynamics> bare_;
  std::vector<simulation::Friction> own_;
  Eigen::Index joint_ = 0;
  double amplitude_ = 0, omega_ = 0;
  ProbeRecord record_;
};

}  // namespace takt::study

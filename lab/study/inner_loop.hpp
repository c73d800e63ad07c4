// SPDX-License-Identifier: Apache-2.0
// The stabiliser around the linearised plant, as frequency response: joint by joint, opened at the torque, the other
// joints' loops closed. What the loop is made of, as it really runs:
//
//   drive closes the loop (mit, robstride, moteus)    kp, kd on the encoder as read at the plant's step
//   host closes it (odrive, cia402 in cst)            kp, kd on a reading that is one reply old: one control period to
//                                                     arrive, one step to be obeyed, half the rest of a period held;
//                                                     cia402's speed is a difference of positions, low-passed
//   gravity compensation                              its slope over the pose, on the estimate: as old, through the
//                                                     velocity observer
//   simulation.torque_delay and the sampling itself   steps of z; the hold between steps is the sampled plant's
// Joints without gains carry no loop; they are part of the plant. Drives with position or velocity loops of their own
// (cia402 in csp, csv) cannot be computed from the robot file. Thread rule: one thread at a time.
#pragma once

#include <Eigen/Core>
#include <complex>
#include <expected>
#include <string>
#include <vector>

#include "config/robot_config.hpp"
#include "lab/study/linear_plant.hpp"
#include "simulation/dynamics.hpp"

namespace takt::study {

class InnerLoop {
 public:
  // Precondition: robot.simulation. The error is one sentence.
  static std::expected<InnerLoop, std::string> make(const config::RobotConfig& robot, simulation::Dynamics& dynamics,
                                                    const Eigen::VectorXd& pose);

  // L of that joint. omega in rad/s, below the sampling's half.
  [[nodiscard]] std::complex<double> loop(std::size_t joint, double omega) const;
  // What an additional torque at `joint` does, everything closed: x per Nm, 2n (for choosing an amplitude).
  [[nodiscard]] Eigen::VectorXcd disturbed(std::size_t joint, double omega) const;
  [[nodiscard]] Duration step() const { return plant_.step; }

 private:
  struct Gains {
    double kp = 0, kd = 0;
    bool by_host = false;
  };
  InnerLoop(SampledPlant plant, std::vector<Gains> gains, const config::RobotConfig& robot,
            Eigen::MatrixXd gravity_slope);
  // Torque per state with the sign turned: tau = -C x. n x 2n.
  [[nodiscard]] Eigen::MatrixXcd controller(double omega) const;
  // What the executive estimates at a tick, per measured position.
  struct Observed {
    std::complex<double> position, velocity;
  };
  [[nodiscard]] Observed observer(std::size_t joint, std::complex<double> z) const;

  SampledPlant plant_;
  std::vector<Gains> gains_;
  std::vector<double> observer_bandwidth_;  // rad/s
  Eigen::MatrixXd gravity_slope_;           // Nm/rad of the compensation
  Duration period_;
  std::int64_t torque_delay_steps_ = 0;
};

// Why the loop of this joint cannot be computed, or empty.
std::string not_computable(const config::Joint& joint);
// Why the joint has no stabiliser, or empty.
std::string no_loop(const config::Joint& joint);

}  // namespace takt::study

// SPDX-License-Identifier: Apache-2.0
// Every joint's margins, computed and measured, side by side. `takt margin` shows them; docs/margin.md explains.
#pragma once

#include <Eigen/Core>
#include <complex>
#include <expected>
#include <functional>
#include <memory>
#include <numbers>
#include <optional>
#include <string>
#include <vector>

#include "config/robot_config.hpp"
#include "lab/study/loop_margins.hpp"
#include "simulation/dynamics.hpp"

namespace takt::study {

struct ResponsePoint {
  double omega = 0;  // rad/s
  std::complex<double> loop;
};

// Below this phase margin a loop rings.
inline constexpr double kLeastPhase_rad = std::numbers::pi / 6;

struct JointMargins {
  std::string joint;
  std::string no_loop;       // why the joint has no stabiliser, and nothing below; empty: it has one
  std::string not_computed;  // why; empty: it is
  LoopMargins computed, injected;
  std::vector<ResponsePoint> computed_response, injected_response;  // ascending
  std::string trouble;                                              // what spoiled the measurement; empty: nothing
  std::optional<double> disagreement;  // largest relative difference of a margin; absent: nothing to compare
  std::string advice;                  // of a joint that rings: what to change in the robot file (gain_advice.hpp)
  [[nodiscard]] bool has_loop() const { return no_loop.empty(); }
  [[nodiscard]] bool agrees() const;
  // The smaller of both.
  [[nodiscard]] std::optional<double> phase_rad() const;
  [[nodiscard]] bool rings() const;
};
inline constexpr double kAgreement = 0.10;

// A fresh copy of the robot's mechanics.
using DynamicsMaker =
    std::function<std::expected<std::unique_ptr<simulation::Dynamics>, std::string>(const config::RobotConfig& robot)>;
// A rigid-body arm where the robot file has a model, else one flywheel per joint.
std::expected<std::unique_ptr<simulation::Dynamics>, std::string> dynamics_of(const config::RobotConfig& robot);

struct MarginSetup {
  const config::RobotConfig& robot;     // computed from
  const config::RobotConfig& measured;  // run: the same, unless a test plants a difference
  DynamicsMaker dynamics = dynamics_of;
  Eigen::VectorXd pose;
  std::function<void(std::size_t done, std::size_t of)> on_joint = {};
};
// Why no joint of this robot comes to rest without its policy, so that no loop can be measured; empty: they do.
std::string no_rest(const config::RobotConfig& robot);
Eigen::VectorXd home_pose(const config::RobotConfig& robot);

// One entry per joint. Precondition: no_rest() is empty. The error is one sentence: no simulation, no model the
// simulator knows, a loop that does not come to rest.
std::expected<std::vector<JointMargins>, std::string> joint_margins(const MarginSetup& setup);

}  // namespace takt::study

// SPDX-License-Identifier: Apache-2.0
// arm_tracking: an arm whose tool follows a moving target that a simulated camera sees. The seed enters the target's
// path at a random instant and draws the camera's jitter.
// Constraints: no joint outside its position limits, tool no faster than kToolSpeedLimit.
#pragma once

#include <expected>
#include <memory>
#include <string>

#include "config/robot_config.hpp"
#include "evidence/rollout/perturbation.hpp"
#include "evidence/rollout/troubled_dynamics.hpp"
#include "evidence/rollout/world.hpp"
#include "simulation/camera.hpp"

namespace takt::evidence {

inline constexpr double kToolSpeedLimit = 0.6;  // m/s; the target of the demo arm stays below 0.3

// How far along its path the target is when the rollout of this seed begins.
Duration target_entry(std::uint64_t seed);

class ArmWorld final : public World {
 public:
  // The error is one sentence: what the robot file lacks. `robot` and `disturbance` outlive this;
  // `outside` as TroubledDynamics::make has it.
  static std::expected<std::unique_ptr<ArmWorld>, std::string> make(
      const config::RobotConfig& robot, const Disturbance& disturbance, MonoTime started, std::uint64_t seed,
      std::unique_ptr<simulation::OutsideMechanics> outside);

  simulation::Plant& plant() override { return plant_; }
  [[nodiscard]] std::string sensor() const override { return simulation_.camera_sensor; }
  std::optional<SensorSample> sample(MonoTime now) override { return camera_.poll(now); }
  double error_m(MonoTime now) override;
  [[nodiscard]] bool is_violated() const override { return violated_; }
  [[nodiscard]] simulation::OutsideMechanics* outside() const override { return dynamics_.outside(); }

 private:
  ArmWorld(const config::RobotConfig& robot, TroubledRobot body, MonoTime camera_started, std::uint64_t camera_seed);

  const config::RobotConfig& robot_;
  simulation::Plant plant_;
  TroubledDynamics& dynamics_;  // the plant's
  config::Simulation simulation_;
  MonoTime camera_started_;
  simulation::Camera camera_;
  config::Vector3 tool_{};
  MonoTime seen_at_;
  bool violated_ = false;
};

}  // namespace takt::evidence

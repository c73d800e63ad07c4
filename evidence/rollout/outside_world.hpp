// SPDX-License-Identifier: Apache-2.0
// world: what the user's own process wants of the robot (docs/world-protocol.md). That process plays mechanics, IMU,
// sensors of images and at most one of numbers, and judges: by the task's error, by saying that the task is done or
// beyond help, or both. Without such a process, for a robot that has no task: it follows its policy, and
// how is not judged. Error: the world's; 0 where there is none. Constraints: no joint outside its position limits.
#pragma once

#include <expected>
#include <memory>
#include <string>

#include "config/robot_config.hpp"
#include "evidence/rollout/perturbation.hpp"
#include "evidence/rollout/troubled_dynamics.hpp"
#include "evidence/rollout/world.hpp"

namespace takt::evidence {

class OutsideWorld final : public World {
 public:
  // `robot` and `disturbance` outlive this; `outside` as TroubledDynamics::make has it.
  static std::expected<std::unique_ptr<OutsideWorld>, std::string> make(
      const config::RobotConfig& robot, const Disturbance& disturbance, MonoTime started, std::uint64_t seed,
      std::unique_ptr<simulation::OutsideMechanics> outside);

  simulation::Plant& plant() override { return body_.plant; }
  [[nodiscard]] std::string sensor() const override;
  std::optional<SensorSample> sample(MonoTime now) override;
  std::optional<SensorSample> imu(MonoTime now) override;
  double error_m(MonoTime now) override;
  [[nodiscard]] bool is_violated() const override { return violated_; }
  [[nodiscard]] simulation::OutsideMechanics* outside() const override { return body_.dynamics.outside(); }

 private:
  OutsideWorld(const config::RobotConfig& robot, TroubledRobot body) : robot_(robot), body_(std::move(body)) {}

  const config::RobotConfig& robot_;
  TroubledRobot body_;
  std::uint64_t imu_samples_ = 0;
  bool violated_ = false;
};

}  // namespace takt::evidence

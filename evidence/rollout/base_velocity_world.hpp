// SPDX-License-Identifier: Apache-2.0
// base_velocity: a robot on a base of its own that goes as fast as a person commands and stays upright, by physics of
// MuJoCo or of a world that gives the base's pose. The person's command comes through the sensor of the policy's
// `command` term; the IMU through the robot file's. The seed draws when walking begins, which puts a perturbation into
// any phase of the gait, and the IMU's noise. Error: over the last kJudgedOver, how far the base came from where the
// command would have taken it, m. Constraints: no joint outside its position limits. Lost: the base lower than its
// share of where it began, or further from upright than its limit; a robot that has fallen does not stand up.
#pragma once

#include <array>
#include <deque>
#include <expected>
#include <memory>
#include <optional>
#include <string>

#include "config/robot_config.hpp"
#include "evidence/rollout/perturbation.hpp"
#include "evidence/rollout/random.hpp"
#include "evidence/rollout/troubled_dynamics.hpp"
#include "evidence/rollout/world.hpp"

namespace takt::evidence {

inline constexpr Duration kJudgedOver = seconds(1);
inline constexpr Duration kAftermath = milliseconds(500);  // of a fall; then the rollout ends
// Standard deviations of the IMU's noise, per sample and axis.
inline constexpr double kRotationNoise = 0.005, kRateNoise = 0.02, kAccelerationNoise = 0.1;  // rad, rad/s, m/s2

// What is asked of the robot, and when it counts as fallen.
struct BaseVelocityTask {
  std::array<double, 3> command{0.5, 0, 0};  // m/s ahead, m/s to the left, rad/s to the left
  Duration until = {};                       // since the rollout's start; from then on it is to stand. Unset: no end
  double least_height = 0.6;                 // share of the base's height at the start
  double most_tilt = 1;                      // rad
};

// Whether a person can command that robot's policy as the task does.
bool takes_velocity_command(const config::RobotConfig& robot);
// When the command begins: drawn from the seed, within a second of the first instant.
Duration walk_begins(std::uint64_t seed);

class BaseVelocityWorld final : public World {
 public:
  // The error is one sentence: what the robot file lacks. `robot` and `disturbance` outlive this;
  // `outside` as TroubledDynamics::make has it.
  static std::expected<std::unique_ptr<BaseVelocityWorld>, std::string> make(
      const config::RobotConfig& robot, const BaseVelocityTask& task, const Disturbance& disturbance, MonoTime started,
      std::uint64_t seed, std::unique_ptr<simulation::OutsideMechanics> outside);

  simulation::Plant& plant() override { return plant_; }
  [[nodiscard]] std::string sensor() const override { return command_sensor_; }
  std::optional<SensorSample> sample(MonoTime now) override;
  std::optional<SensorSample> imu(MonoTime now) override;
  double error_m(MonoTime now) override;
  [[nodiscard]] bool is_violated() const override { return violated_; }
  [[nodiscard]] bool is_lost() const override { return lost_; }
  [[nodiscard]] simulation::OutsideMechanics* outside() const override { return dynamics_.outside(); }
  [[nodiscard]] std::optional<Duration> ends_after_loss() const override { return kAftermath; }

 private:
  struct Seen {
    MonoTime at;
    std::array<double, 2> base{}, wanted{};  // m, in the world's plane
  };
  BaseVelocityWorld(const config::RobotConfig& robot, const BaseVelocityTask& task, TroubledRobot body,
                    MonoTime started, std::uint64_t seed);
  [[nodiscard]] std::array<double, 3> commanded(MonoTime now) const;
  void look(const simulation::BasePose& base);

  const config::RobotConfig& robot_;
  const BaseVelocityTask task_;
  std::string command_sensor_;
  simulation::Plant plant_;
  TroubledDynamics& dynamics_;  // the plant's
  MonoTime begins_, ends_;      // of walking; ends_ unset: never
  Random noise_;
  double least_height_m_;
  MonoTime next_word_;  // of the person
  std::uint64_t words_ = 0, imu_samples_ = 0;
  std::deque<Seen> seen_;  // of the last kJudgedOver, oldest first
  bool violated_ = false, lost_ = false;
};

}  // namespace takt::evidence

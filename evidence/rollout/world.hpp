// SPDX-License-Identifier: Apache-2.0
// What a task's robot lives in: its plant, its outside sensor, and the truth by which the task is judged. One
// implementation per task. Virtual time is passed in; the plant is stepped by the rollout.
// Thread rule: one thread at a time.
#pragma once

#include <optional>
#include <string>

#include "executive/contract/mono_time.hpp"
#include "executive/contract/sensor_sample.hpp"
#include "simulation/outside_mechanics.hpp"
#include "simulation/plant.hpp"

namespace takt::evidence {

// Some joint is outside its position limits, at `q`: rad, in the robot file's order.
inline bool is_beyond_limits(const config::RobotConfig& robot, const Eigen::VectorXd& q) {
  bool beyond = false;
  for (std::size_t joint = 0; joint < robot.joints.size(); ++joint) {
    const config::Limits& limits = robot.joints[joint].limits;
    const double at = q[static_cast<Eigen::Index>(joint)];
    beyond |= at < limits.q_min || at > limits.q_max;
  }
  return beyond;
}

class World {
 public:
  World() = default;
  World(const World&) = delete;
  World& operator=(const World&) = delete;
  virtual ~World() = default;

  virtual simulation::Plant& plant() = 0;
  // Which of the robot file's sensors sample() is of, by name; empty: none.
  [[nodiscard]] virtual std::string sensor() const = 0;
  // That sensor's newest sample that is ready at `now` and was not returned before.
  virtual std::optional<SensorSample> sample(MonoTime now) = 0;
  // What the base's IMU says at `now`, its sequence counting from 1; empty: the robot has none.
  virtual std::optional<SensorSample> imu(MonoTime now) {
    (void)now;
    return std::nullopt;
  }
  // Distance from where the task wants its point to be, m. Call once per tick, in order.
  virtual double error_m(MonoTime now) = 0;
  // Outside the task's own constraints, as seen by the latest error_m().
  [[nodiscard]] virtual bool is_violated() const = 0;
  // Beyond help: a fallen pole or robot. The task has failed, whatever follows.
  [[nodiscard]] virtual bool is_lost() const { return false; }
  // The process that plays the mechanics has ended, or says that the task is done: nothing follows. Null: it has not.
  [[nodiscard]] const simulation::WorldEnd* ended() const {
    const simulation::OutsideMechanics* const played = outside();
    return played != nullptr && played->end() ? &*played->end() : nullptr;
  }
  // Null: no other process plays the mechanics.
  [[nodiscard]] virtual simulation::OutsideMechanics* outside() const = 0;
  // Where nothing that follows a loss is worth its computing time: how much of it is still looked at.
  [[nodiscard]] virtual std::optional<Duration> ends_after_loss() const { return std::nullopt; }
};

}  // namespace takt::evidence

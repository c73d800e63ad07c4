// What a task's robot lives in: its plant, its outside sensor, and the truth by which the task is judged. One
// implementation per task. Virtual time is passed in; the plant is stepped by the rollout.
// Thread rule: one thread at a time.
#pragma once

#include <optional>

#include "executive/contract/mono_time.hpp"
#include "executive/contract/sensor_sample.hpp"
#include "simulation/plant.hpp"

namespace takt::panel {

class World {
 public:
  World() = default;
  World(const World&) = delete;
  World& operator=(const World&) = delete;
  virtual ~World() = default;

  virtual plant::Plant& plant() = 0;
  // The outside sensor's newest sample that is ready at `now` and was not returned before.
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
  // Where nothing that follows a loss is worth its computing time: how much of it is still looked at.
  [[nodiscard]] virtual std::optional<Duration> ends_after_loss() const { return std::nullopt; }
};

}  // namespace takt::panel

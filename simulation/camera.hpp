// SPDX-License-Identifier: Apache-2.0
// The target and the camera that sees it: a sample is taken at the shutter and is ready after a delay with
// jitter.
//
// lissajous: the target follows a figure around simulation.target_centre; the figure's time starts with the camera's.
// steps: a place on a line, the first value, drawn anew from the seed every simulation.step_period and kept until then;
// before the first period is over it is 0.
// Jitter is uniform in +-camera_jitter and drawn from the seed, so that a run's delays can be repeated. Values of a
// sample: x, y, z in the base frame, m. Pure: time is passed in. Thread rule: one thread at a time.
#pragma once

#include <optional>
#include <random>

#include "config/robot_config.hpp"
#include "executive/contract/mono_time.hpp"
#include "executive/contract/sensor_sample.hpp"

namespace takt::simulation {

config::Vector3 target_at(const config::Simulation& simulation, Duration since_start);

class Camera {
 public:
  Camera(const config::Simulation& simulation, MonoTime started);
  // The newest sample that is ready and was not returned yet, stamped as published now; older ones are dropped.
  std::optional<SensorSample> poll(MonoTime now);

 private:
  void expose_next();

  config::Simulation simulation_;
  MonoTime started_;
  std::mt19937_64 random_;
  std::int64_t exposures_ = 0;
  std::uint64_t sequence_ = 0;
  MonoTime shutter_, ready_;  // of the sample that is under way
};

}  // namespace takt::simulation

// SPDX-License-Identifier: Apache-2.0
#include "evidence/rollout/base_velocity_world.hpp"

#include <fmt/format.h>

#include <algorithm>
#include <cmath>
#include <utility>

#include "config/observation_shape.hpp"

namespace takt::evidence {
namespace {

constexpr std::uint64_t kWalkStream = 601;
constexpr Duration kFirstWord = seconds(2), kDrawnOver = seconds(1);
constexpr Duration kWordEvery = milliseconds(20);

struct Heading {
  double cosine, sine;
};

// Of the base's x axis in the world's plane.
Heading heading_of(const simulation::BasePose& base) {
  const auto [w, x, y, z] = base.orientation;
  const double ahead = 1 - 2 * (y * y + z * z), left = 2 * (x * y + w * z);
  const double length = std::max(std::hypot(ahead, left), 1e-9);
  return {ahead / length, left / length};
}

double tilt_of(const simulation::BasePose& base) {
  const auto [w, x, y, z] = base.orientation;
  return std::acos(std::clamp(1 - 2 * (x * x + y * y), -1.0, 1.0));
}

// Of the policy's term `command`, with a value per part of the task's; null: it has none.
const config::Sensor* command_sensor(const config::RobotConfig& robot) {
  if (!robot.policy) return nullptr;
  for (const config::ObservationTerm& term : robot.policy->observation) {
    if (term.kind != config::TermKind::command) continue;
    const auto sensor = std::ranges::find(robot.sensors, term.sensor, &config::Sensor::name);
    if (sensor != robot.sensors.end() && sensor->command && sensor->values == BaseVelocityTask{}.command.size())
      return &*sensor;
  }
  return nullptr;
}

std::string problem_of(const config::RobotConfig& robot, const BaseVelocityTask& task,
                       const simulation::OutsideMechanics* outside) {
  if (outside != nullptr && !outside->link().gives(TAKT_WORLD_BASE))
    return "world " + outside->link().world() + " does not give the base's pose, which task base_velocity is judged by";
  if (outside == nullptr && (!robot.simulation || !robot.simulation->mujoco))
    return robot.file + ": task base_velocity needs `simulation.mujoco`, whose base may move";
  const config::Sensor* const sensor = command_sensor(robot);
  if (sensor == nullptr)
    return robot.file + ": task base_velocity needs a policy with a term `command` of three values";
  for (std::size_t i = 0; i < task.command.size(); ++i)
    if (task.command[i] < sensor->command->minimum[i] || task.command[i] > sensor->command->maximum[i])
      return fmt::format("{}: the task's command {:g}, {:g}, {:g} is outside the limits of sensor {}; command less",
                         robot.file, task.command[0], task.command[1], task.command[2], sensor->name);
  for (const config::ObservationTerm& term : robot.policy->observation)
    if (!term.sensor.empty() && term.sensor != sensor->name && config::image_of(robot, term) == nullptr)
      return fmt::format("{}: task base_velocity plays the command and the IMU, but not sensor {}", robot.file,
                         term.sensor);
  if (robot.imu && outside != nullptr && !outside->link().gives(TAKT_WORLD_IMU))
    return "world " + outside->link().world() + " gives no IMU's readings, and " + robot.file + " has `imu`";
  if (robot.imu && outside == nullptr && robot.simulation->mujoco->imu_site.empty())
    return robot.file + ": has `imu`, and its `simulation.mujoco` none; name the site as `simulation.mujoco.imu.site`";
  return {};
}

// A small turn, each axis of which is drawn.
std::array<double, 4> shaken(const std::array<double, 4>& q, Random& noise) {
  const double x = noise.normal() * kRotationNoise / 2, y = noise.normal() * kRotationNoise / 2,
               z = noise.normal() * kRotationNoise / 2;
  std::array<double, 4> turned{q[0] - q[1] * x - q[2] * y - q[3] * z, q[1] + q[0] * x + q[2] * z - q[3] * y,
                               q[2] + q[0] * y + q[3] * x - q[1] * z, q[3] + q[0] * z + q[1] * y - q[2] * x};
  const double length = std::hypot(std::hypot(turned[0], turned[1]), std::hypot(turned[2], turned[3]));
  for (double& part : turned) part /= length;
  return turned;
}

}  // namespace

bool takes_velocity_command(const config::RobotConfig& robot) {
  return command_sensor(robot) != nullptr;
}

Duration walk_begins(std::uint64_t seed) {
  Random random(seed, kWalkStream);
  return kFirstWord + Duration{std::llround(random.between(0, static_cast<double>(kDrawnOver.ns)))};
}

std::expected<std::unique_ptr<BaseVelocityWorld>, std::string> BaseVelocityWorld::make(
    const config::RobotConfig& robot, const BaseVelocityTask& task, const Disturbance& disturbance, MonoTime started,
    std::uint64_t seed, std::unique_ptr<simulation::OutsideMechanics> outside) {
  if (const std::string problem = problem_of(robot, task, outside.get()); !problem.empty())
    return std::unexpected(problem);
  auto body = TroubledRobot::make(robot, disturbance, started, seed, std::move(outside));
  if (!body) return std::unexpected(body.error());
  return std::unique_ptr<BaseVelocityWorld>(new BaseVelocityWorld(robot, task, std::move(*body), started, seed));
}

BaseVelocityWorld::BaseVelocityWorld(const config::RobotConfig& robot, const BaseVelocityTask& task, TroubledRobot body,
                                     MonoTime started, std::uint64_t seed)
    : robot_(robot),
      task_(task),
      command_sensor_(command_sensor(robot)->name),
      plant_(std::move(body.plant)),
      dynamics_(body.dynamics),
      begins_(started + walk_begins(seed)),
      ends_(task.until.ns == 0 ? MonoTime{} : started + task.until),
      noise_(seed, kWalkStream + 1),
      least_height_m_(task.least_height * dynamics_.base()->position[2]),
      next_word_(started) {}

std::array<double, 3> BaseVelocityWorld::commanded(MonoTime now) const {
  const bool walks = now >= begins_ && (!ends_.is_set() || now < ends_);
  return walks ? task_.command : std::array<double, 3>{};
}

std::optional<SensorSample> BaseVelocityWorld::sample(MonoTime now) {
  if (now < next_word_) return std::nullopt;
  next_word_ = now + kWordEvery;
  SensorSample word;
  word.sequence = ++words_;
  word.sensed_at = word.published_at = now;
  for (const double value : commanded(now)) word.values[word.value_count++] = static_cast<float>(value);
  return word;
}

std::optional<SensorSample> BaseVelocityWorld::imu(MonoTime now) {
  if (!robot_.imu) return std::nullopt;
  auto reading = dynamics_.imu();
  if (!reading) return std::nullopt;
  reading->orientation = shaken(reading->orientation, noise_);
  for (double& rate : reading->angular_velocity) rate += noise_.normal() * kRateNoise;
  for (double& force : reading->acceleration) force += noise_.normal() * kAccelerationNoise;
  return simulation::imu_sample(*reading, ++imu_samples_, now);
}

void BaseVelocityWorld::look(const simulation::BasePose& base) {
  lost_ |= base.position[2] < least_height_m_ || tilt_of(base) > task_.most_tilt;
  violated_ = is_beyond_limits(robot_, plant_.state().q);
}

double BaseVelocityWorld::error_m(MonoTime now) {
  const simulation::BasePose base = *dynamics_.base();
  look(base);
  Seen newest{now, {base.position[0], base.position[1]}, {}};
  if (!seen_.empty()) {
    const auto [ahead, left, turn] = commanded(now);
    const Heading heading = heading_of(base);
    const double dt = (now - seen_.back().at).seconds();
    newest.wanted = {seen_.back().wanted[0] + dt * (ahead * heading.cosine - left * heading.sine),
                     seen_.back().wanted[1] + dt * (ahead * heading.sine + left * heading.cosine)};
  }
  seen_.push_back(newest);
  while (now - seen_.front().at > kJudgedOver) seen_.pop_front();
  const Seen& then = seen_.front();
  const auto strayed = [&](std::size_t i) {
    return newest.base[i] - then.base[i] - (newest.wanted[i] - then.wanted[i]);
  };
  return std::hypot(strayed(0), strayed(1));
}

}  // namespace takt::evidence

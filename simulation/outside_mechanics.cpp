// SPDX-License-Identifier: Apache-2.0
#include "simulation/outside_mechanics.hpp"

#include <fmt/format.h>

#include <algorithm>

namespace takt::simulation {
namespace {

ArmState state_of(const takt_world_state& answer, std::size_t joint_count) {
  const auto count = static_cast<Eigen::Index>(joint_count);
  return {Eigen::Map<const Eigen::VectorXd>(answer.q, count), Eigen::Map<const Eigen::VectorXd>(answer.dq, count)};
}

// What the world says of a sensor that the robot file says otherwise; empty: nothing.
std::string sensor_problem(const WorldLink& link, const config::RobotConfig& robot) {
  if (link.sensor().empty()) return {};
  const auto found = std::ranges::find(robot.sensors, link.sensor(), &config::Sensor::name);
  if (found == robot.sensors.end()) return fmt::format("{} has no sensor {}", robot.robot, link.sensor());
  if (found->values == link.sensor_count()) return {};
  return fmt::format("sensor {} has {} values in {}, {} here", link.sensor(), found->values, robot.robot,
                     link.sensor_count());
}

}  // namespace

OutsideMechanics::OutsideMechanics(WorldLink link, const takt_world_state& first, std::size_t joint_count,
                                   std::vector<std::size_t> sensor_of_camera)
    : link_(std::move(link)),
      begin_(state_of(first, joint_count)),
      state_(first),
      viscous_(joint_count),
      coulomb_(joint_count),
      sensor_of_camera_(std::move(sensor_of_camera)) {
  keep_images();
}

std::expected<std::unique_ptr<OutsideMechanics>, WorldEnd> OutsideMechanics::connect(
    const config::RobotConfig& robot, const std::string& path, std::uint64_t seed,
    const WorldLink::Patience& patience) {
  WorldLink::Robot played{robot.robot, {}, robot.simulation->step};
  std::vector<std::size_t> sensor_of_camera;
  for (std::size_t sensor = 0; sensor < robot.sensors.size(); ++sensor) {
    if (!robot.sensors[sensor].image || sensor_of_camera.size() == TAKT_WORLD_MAX_CAMERAS) continue;
    played.cameras.push_back({robot.sensors[sensor].name, *robot.sensors[sensor].image});
    sensor_of_camera.push_back(sensor);
  }
  std::vector<double> home;
  for (const config::Joint& joint : robot.joints) {
    played.joints.push_back(joint.name);
    home.push_back(joint.home);
  }
  auto link = WorldLink::connect(path, played, patience);
  if (!link) return std::unexpected(link.error());
  if (const std::string problem = sensor_problem(*link, robot); !problem.empty())
    return std::unexpected(
        WorldEnd{WorldEndKind::refused, fmt::format("world {} ({}): {}", path, link->world(), problem)});
  const auto first = link->reset(seed, home);
  if (!first) return std::unexpected(first.error());
  return std::unique_ptr<OutsideMechanics>(
      new OutsideMechanics(std::move(*link), *first, home.size(), std::move(sensor_of_camera)));
}

void OutsideMechanics::integrate(ArmState& state, const Eigen::VectorXd& tau, const std::vector<Friction>& friction,
                                 Duration /*step*/) {
  if (end_) return;
  for (std::size_t joint = 0; joint < friction.size(); ++joint) {
    viscous_[joint] = friction[joint].viscous;
    coulomb_[joint] = friction[joint].coulomb;
  }
  const auto answer = link_.step({{tau.data(), friction.size()}, viscous_, coulomb_, hangs_, push_});
  if (!answer) {
    end_ = answer.error();
    state.dq.setZero();
    return;
  }
  if (answer->sensor_sequence != state_.sensor_sequence) sensed_ = Duration{static_cast<std::int64_t>(answer->time_ns)};
  state_ = *answer;
  keep_images();
  state = state_of(state_, friction.size());
}

config::Vector3 OutsideMechanics::tool_position(const Eigen::VectorXd& /*q*/) {
  return link_.gives(TAKT_WORLD_POINT) ? std::to_array(state_.point) : config::Vector3{};
}

std::optional<ImuReading> OutsideMechanics::imu() {
  if (!link_.gives(TAKT_WORLD_IMU)) return std::nullopt;
  return ImuReading{std::to_array(state_.orientation), std::to_array(state_.angular_velocity),
                    std::to_array(state_.acceleration)};
}

std::optional<BasePose> OutsideMechanics::base() const {
  if (!link_.gives(TAKT_WORLD_BASE)) return std::nullopt;
  return BasePose{std::to_array(state_.base_position), std::to_array(state_.base_orientation)};
}

bool OutsideMechanics::push(const config::Vector3& force, const std::string& /*body*/) {
  push_ = force;
  return link_.gives(TAKT_WORLD_PUSH);
}

std::optional<SensorSample> OutsideMechanics::sample(MonoTime now) {
  if (link_.sensor().empty() || state_.sensor_sequence == sampled_) return std::nullopt;
  SensorSample sample;
  sample.sequence = sampled_ = state_.sensor_sequence;
  sample.sensed_at = now - (Duration{static_cast<std::int64_t>(state_.time_ns)} - sensed_);
  sample.published_at = now;
  for (const double value : std::span(state_.sensor).first(link_.sensor_count()))
    sample.values[sample.value_count++] = static_cast<float>(value);
  return sample;
}

double OutsideMechanics::error() const {
  return link_.gives(TAKT_WORLD_ERROR) ? state_.error : 0;
}

void OutsideMechanics::keep_images() {
  for (const WorldImage& image : link_.images()) {
    std::erase_if(images_, [&](const WorldImage& older) { return older.camera == image.camera; });
    images_.push_back(image);
  }
}

std::vector<OutsideMechanics::Image> OutsideMechanics::images(MonoTime now) {
  std::vector<Image> news;
  for (WorldImage& image : images_) {
    const Duration age = Duration{static_cast<std::int64_t>(state_.time_ns)} - image.sensed_at;
    Sensed sensed{.sample = {}, .pixels = std::move(image.pixels)};
    sensed.sample.sequence = image.sequence;
    sensed.sample.sensed_at = now - age;
    sensed.sample.published_at = now;
    news.push_back({sensor_of_camera_[image.camera], std::move(sensed)});
  }
  images_.clear();
  return news;
}

bool OutsideMechanics::films(std::size_t sensor) const {
  const auto cameras = link_.cameras();
  return std::ranges::any_of(cameras, [&](std::size_t camera) { return sensor_of_camera_[camera] == sensor; });
}

}  // namespace takt::simulation

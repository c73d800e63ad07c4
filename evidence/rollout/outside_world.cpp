// SPDX-License-Identifier: Apache-2.0
#include "evidence/rollout/outside_world.hpp"

#include <fmt/format.h>

#include <utility>

#include "policy_host/sensor_link.hpp"

namespace takt::evidence {
namespace {

// A person who says nothing is no fault: a command's sensor need not be played.
std::string problem_of(const config::RobotConfig& robot, const simulation::OutsideMechanics* outside) {
  const std::string world = outside != nullptr ? "world " + outside->link().world() : "the simulator";
  if (robot.imu && outside != nullptr && !outside->link().gives(TAKT_WORLD_IMU))
    return world + " gives no IMU's readings, and " + robot.file + " has `imu`";
  for (const std::size_t sensor : policy_host::sensors_in_use(robot))
    if (!robot.sensors[sensor].command && !robot.sensors[sensor].image &&
        (outside == nullptr || robot.sensors[sensor].name != outside->link().sensor()))
      return fmt::format("{}: its policy needs sensor {}, which {} does not play", robot.file,
                         robot.sensors[sensor].name, world);
  return {};
}

}  // namespace

std::expected<std::unique_ptr<OutsideWorld>, std::string> OutsideWorld::make(
    const config::RobotConfig& robot, const Disturbance& disturbance, MonoTime started, std::uint64_t seed,
    std::unique_ptr<simulation::OutsideMechanics> outside) {
  if (const std::string why = problem_of(robot, outside.get()); !why.empty()) return std::unexpected(why);
  auto body = TroubledRobot::make(robot, disturbance, started, seed, std::move(outside));
  if (!body) return std::unexpected(body.error());
  return std::unique_ptr<OutsideWorld>(new OutsideWorld(robot, std::move(*body)));
}

std::string OutsideWorld::sensor() const {
  return outside() != nullptr ? outside()->link().sensor() : "";
}

std::optional<SensorSample> OutsideWorld::sample(MonoTime now) {
  simulation::OutsideMechanics* const played = body_.dynamics.outside();
  return played != nullptr ? played->sample(now) : std::nullopt;
}

std::optional<SensorSample> OutsideWorld::imu(MonoTime now) {
  const auto reading = robot_.imu ? body_.dynamics.imu() : std::nullopt;
  if (!reading) return std::nullopt;
  return simulation::imu_sample(*reading, ++imu_samples_, now);
}

double OutsideWorld::error_m(MonoTime) {
  violated_ = is_beyond_limits(robot_, body_.plant.state().q);
  return outside() != nullptr ? outside()->error() : 0;
}

}  // namespace takt::evidence

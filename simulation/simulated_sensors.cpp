// SPDX-License-Identifier: Apache-2.0
#include "simulation/simulated_sensors.hpp"

#include <algorithm>
#include <cstring>
#include <span>
#include <utility>

#include "config/paths.hpp"
#include "executive/contract/image_sample.hpp"
#include "simulation/chance.hpp"

namespace takt::simulation {
namespace {

constexpr std::uint64_t kSensorPathStream = 201;  // and one more for each sensor

// An empty name is no sensor's.
std::optional<std::size_t> sensor_called(const config::RobotConfig& robot, const std::string& name) {
  const auto found = std::ranges::find(robot.sensors, name, &config::Sensor::name);
  if (found == robot.sensors.end()) return std::nullopt;
  return static_cast<std::size_t>(found - robot.sensors.begin());
}

ipc::RingShape shape_of(const config::Sensor& sensor) {
  if (!sensor.image) return ipc::sensor_mailbox();
  const auto& [height, width, channels] = *sensor.image;
  return ipc::image_mailbox(height, width, channels);
}

void publish(ipc::SensorServer& server, const Sensed& sensed) {
  const auto& [sample, pixels] = sensed;
  if (!pixels) return server.publish(sample);
  const ImageHeader header{sample.sequence, sample.sensed_at, sample.published_at,
                           static_cast<std::uint32_t>(pixels->size()), 0};
  const std::span<std::byte> slot = server.begin();
  std::memcpy(slot.data(), &header, sizeof header);
  std::memcpy(slot.data() + sizeof header, pixels->data(), pixels->size());
  server.commit(sizeof header + pixels->size());
}

}  // namespace

std::expected<SimulatedSensors, std::string> SimulatedSensors::open(const config::RobotConfig& robot,
                                                                    const std::string& directory,
                                                                    std::optional<uid_t> policy_user, MonoTime started,
                                                                    RobotPlant& body, OutsideMechanics* world) {
  SimulatedSensors opened(robot, started, world);
  if (world != nullptr) opened.of_world_ = sensor_called(robot, world->link().sensor());
  if (body.imu()) opened.imu_ = robot.imu ? sensor_called(robot, robot.imu->sensor) : std::nullopt;
  opened.filmed_ = sensor_called(robot, robot.simulation->camera_sensor);
  if (opened.filmed_ == opened.of_world_) opened.filmed_.reset();
  for (std::size_t i = 0; i < robot.sensors.size(); ++i) {
    Mailbox& mailbox =
        opened.mailboxes_.emplace_back(nullptr, SensorPath(seed_for(robot.simulation->seed, kSensorPathStream + i)));
    if (i != opened.filmed_ && i != opened.imu_ && i != opened.of_world_ && (world == nullptr || !world->films(i)))
      continue;
    auto server = ipc::SensorServer::start(config::sensor_socket(directory, robot.sensors[i].name), policy_user,
                                           shape_of(robot.sensors[i]));
    if (!server) return std::unexpected(server.error());
    mailbox.server = std::move(*server);
  }
  return opened;
}

std::string SimulatedSensors::unplayed(const Scenario& scenario, const std::string& file) const {
  for (const FaultEvent& event : scenario.events)
    if (event.strikes == Target::sensor && !mailboxes_[event.target].server)
      return file + ": " + text_of(event) + " of sensor " + event.target_name +
             ", which this simulation does not play; remove the event";
  return {};
}

void SimulatedSensors::look(RobotPlant& body, const ScenarioPlayer& scenario, MonoTime now) {
  const auto take = [&](std::size_t sensor, const Sensed& sensed) {
    mailboxes_[sensor].path.take(sensed, scenario.on_sensor(sensor));
  };
  if (filmed_)
    if (const auto sample = camera_.poll(now)) take(*filmed_, {*sample});
  if (imu_)
    if (const auto reading = body.imu()) take(*imu_, {imu_sample(*reading, ++imu_samples_, now)});
  if (of_world_)
    if (const auto sample = world_->sample(now)) take(*of_world_, {*sample});
  if (world_ != nullptr)
    for (const auto& [sensor, sensed] : world_->images(now)) take(sensor, sensed);
  for (auto& [server, path] : mailboxes_)
    while (const auto sensed = path.deliver(now)) publish(*server, *sensed);
}

}  // namespace takt::simulation

// SPDX-License-Identifier: Apache-2.0
#include "client/sensor_session.hpp"

#include <fmt/format.h>

#include <algorithm>
#include <cstring>
#include <optional>
#include <span>
#include <utility>

#include "client/stream_view.hpp"
#include "config/load.hpp"
#include "config/paths.hpp"
#include "executive/contract/image_sample.hpp"
#include "executive/contract/monotonic_clock.hpp"
#include "executive/ipc/unix_socket.hpp"
#include "policy_host/sensor_link.hpp"

namespace takt::client {
namespace {

// Values lie behind it in either kind of sample.
constexpr std::size_t kHeaderBytes = sizeof(ImageHeader);
static_assert(offsetof(SensorSample, values) == kHeaderBytes);

std::string shape_text(const config::ImageShape& shape) {
  return fmt::format("{} x {} x {}", shape.height, shape.width, shape.channels);
}

// What the spec says otherwise than the robot file; empty: nothing.
std::string disagreement(const SensorSpec& spec, const config::Sensor& sensor) {
  if (spec.is_image != sensor.image.has_value())
    return sensor.image ? fmt::format("images of uint8, {}", shape_text(*sensor.image))
                        : fmt::format("{} values of float32", sensor.values);
  if (sensor.image && shape_text(*sensor.image) != shape_text(spec.image))
    return fmt::format("images of {}, this one {}", shape_text(*sensor.image), shape_text(spec.image));
  if (!sensor.image && sensor.values != spec.values)
    return fmt::format("{} values, this one {}", sensor.values, spec.values);
  if (!spec.unit.empty() && spec.unit != sensor.unit) return fmt::format("{}, this one {}", sensor.unit, spec.unit);
  return {};
}

std::string known_sensors(const config::RobotConfig& robot) {
  std::string names;
  for (const config::Sensor& sensor : robot.sensors) names += (names.empty() ? "there is " : ", ") + sensor.name;
  return names.empty() ? "it is empty" : names;
}

}  // namespace

std::expected<std::unique_ptr<SensorSession>, Refusal> SensorSession::open(const SensorSpec& spec) {
  auto robot = config::load(spec.robot_file);
  if (!robot) return refuse(robot.error().substr(0, robot.error().find('\n')));
  const auto sensor = std::ranges::find(robot->sensors, spec.name, &config::Sensor::name);
  if (sensor == robot->sensors.end())
    return refuse(fmt::format("{}: `sensors` does not list '{}' ({}); add it there, or correct the name", robot->file,
                              spec.name, known_sensors(*robot)));
  if (const std::string other = disagreement(spec, *sensor); !other.empty())
    return refuse(fmt::format("{}: sensor {} gives {}: make them equal", robot->file, spec.name, other));
  std::optional<uid_t> reader;
  if (!spec.policy_user.empty()) {
    const auto user = ipc::user_id(spec.policy_user);
    if (!user) return std::unexpected(Refusal{TAKT_USAGE, "policy_user: " + user.error()});
    reader = *user;
  }
  const std::string directory =
      spec.runtime_directory.empty() ? config::default_runtime_directory(robot->robot) : spec.runtime_directory;
  auto server =
      ipc::SensorServer::start(config::sensor_socket(directory, spec.name), reader, policy_host::mailbox_of(*sensor));
  if (!server) return std::unexpected(Refusal{TAKT_REFUSED, server.error()});
  return std::unique_ptr<SensorSession>(new SensorSession(std::move(*sensor), std::move(*server)));
}

SensorSession::SensorSession(config::Sensor sensor, std::unique_ptr<ipc::SensorServer> server)
    : sensor_(std::move(sensor)), stream_(view_of(sensor_)), server_(std::move(server)) {}

void* SensorSession::values() {
  return server_->begin().data() + kHeaderBytes;
}

int SensorSession::publish(MonoTime sensed_at) {
  const MonoTime now = monotonic_now();
  sentence_ = "";
  if (!sensed_at.is_set() || sensed_at > now) {
    sentence_ =
        "the stamp is after now, or none: say when it was sensed in ns of CLOCK_MONOTONIC (time.monotonic_ns())";
    return TAKT_USAGE;
  }
  const std::span<std::byte> slot = server_->begin();
  const ImageHeader header{++sequence_, sensed_at, now, stream_.values, 0};
  std::memcpy(slot.data(), &header, sizeof header);
  server_->commit(sensor_.image ? kHeaderBytes + stream_.values : sizeof(SensorSample));
  return TAKT_OK;
}

}  // namespace takt::client

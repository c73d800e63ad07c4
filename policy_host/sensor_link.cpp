#include "policy_host/sensor_link.hpp"

#include <fmt/format.h>

#include <algorithm>
#include <chrono>
#include <utility>

#include "executive/ipc/executive_segments.hpp"

namespace takt::policy_host {
namespace {

constexpr std::chrono::milliseconds kAttachTimeout{100};
constexpr Duration kRetry = milliseconds(500);

}  // namespace

SensorLink::SensorLink(std::string socket, const Hello& hello) : socket_(std::move(socket)), hello_(hello) {}

void SensorLink::attach() {
  auto lease = ipc::attach(socket_, hello_, kAttachTimeout);
  if (!lease) {
    problem_ = lease.error();
    return;
  }
  if (lease->descriptors.empty()) {
    problem_ = socket_ + ": the sensor handed out no mailbox";
    return;
  }
  auto segment = ipc::Segment::adopt_read_only(lease->descriptors[0].release(), ipc::ring_bytes(ipc::sensor_mailbox()));
  if (!segment) {
    problem_ = segment.error();
    return;
  }
  auto reader = ipc::SlotReader::attach(segment->readable(), ipc::sensor_mailbox());
  if (!reader) {
    problem_ = reader.error();
    return;
  }
  attached_.emplace(std::move(*lease), std::move(*segment), std::move(*reader));
  problem_.clear();
}

void SensorLink::update(MonoTime now, SensorSample& sample) {
  if (attached_ && ipc::is_over(attached_->lease)) {
    attached_.reset();
    problem_ = socket_ + ": the sensor's process went away";
  }
  if (!attached_ && now >= next_attempt_) {
    next_attempt_ = now + kRetry;
    attach();
  }
  if (!attached_) return;
  SensorSample newest;
  const auto result = attached_->reader.read_latest(std::as_writable_bytes(std::span(&newest, 1)));
  if (result.status == ipc::ReadStatus::fresh) sample = newest;
}

std::vector<std::size_t> sensors_in_use(const config::RobotConfig& robot) {
  std::vector<std::size_t> in_use;
  for (std::size_t i = 0; i < robot.sensors.size(); ++i) {
    const auto uses = [&](const config::ObservationTerm& term) {
      return term.kind == config::TermKind::sensor && term.sensor == robot.sensors[i].name;
    };
    if (std::ranges::any_of(robot.policy->observation, uses)) in_use.push_back(i);
  }
  return in_use;
}

std::string unusable(const config::RobotConfig& robot, std::span<const std::size_t> in_use,
                     std::span<const SensorSample> samples, MonoTime now) {
  for (const std::size_t i : in_use) {
    const config::Sensor& sensor = robot.sensors[i];
    const SensorSample& sample = samples[i];
    if (sample.sequence == 0) return fmt::format("sensor {}: no sample yet", sensor.name);
    if (sample.value_count != sensor.values) {
      return fmt::format("sensor {}: its sample has {} values, {} lists {}", sensor.name, sample.value_count,
                         robot.file, sensor.values);
    }
    const Duration age = now - sample.sensed_at;
    if (age > sensor.timeout) {
      return fmt::format("sensor {}: its newest sample is older than {:.0f} ms", sensor.name,
                         sensor.timeout.milliseconds());
    }
  }
  return {};
}

}  // namespace takt::policy_host

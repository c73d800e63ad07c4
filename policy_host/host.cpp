#include "policy_host/host.hpp"

#include <spdlog/spdlog.h>

#include "config/paths.hpp"
#include "policy_host/monotonic_clock.hpp"
#include "policy_host/pacing.hpp"

namespace takt::policy_host {
namespace {

constexpr char kProgram[] = "takt-policy-host";
constexpr Duration kAttachRetry = milliseconds(200);
constexpr Duration kReportPeriod = seconds(10);

}  // namespace

Host::Host(const config::RobotConfig& robot, const std::string& runtime_directory, std::uint64_t policy_hash,
           Policy& policy)
    : robot_(robot),
      socket_(config::executive_socket(runtime_directory)),
      hello_(hello_of(robot, policy_hash, Role::policy, kProgram)),
      introduction_(kProgram, robot.hash, policy_hash, robot.joints),
      responder_(robot, policy_hash, policy),
      sensors_in_use_(sensors_in_use(robot)),
      samples_(robot.sensors.size()) {
  for (const std::size_t sensor : sensors_in_use_) {
    sensors_.emplace_back(config::sensor_socket(runtime_directory, robot.sensors[sensor].name),
                          hello_of(robot, policy_hash, Role::sensor_reader, kProgram));
  }
}

void Host::run(const std::atomic<bool>& stop) {
  reported_ = monotonic_now();
  while (!stop) {
    const MonoTime now = monotonic_now();
    introduction_.when_traced(now);
    if (!executive_) {
      attach(now);
      if (!executive_) sleep_until(now + kAttachRetry);
      continue;
    }
    sleep_until(next_look(now, observed_, robot_.policy->period, looked_since_due_));
    if (stop) break;
    look(monotonic_now());
    report(monotonic_now());
  }
}

void Host::attach(MonoTime now) {
  auto link = ExecutiveLink::attach(socket_, hello_);
  if (!link) {
    no_executive_.say(now, "waiting for the executive: " + link.error());
    return;
  }
  executive_.emplace(std::move(*link));
  responder_.start_session();
  observed_ = {};
  observed_id_ = 0;
  no_executive_.clear();
  spdlog::info("attached to {}", socket_);
}

void Host::look(MonoTime now) {
  Observation observation;
  trace::dequeue_begin(observed_id_);
  const bool fresh = executive_->read(observation);
  trace::dequeue_end(fresh ? observation.id : 0);
  if (fresh) {
    observed_ = observation.published_at;
    observed_id_ = observation.id;
    answer(observation, now);
    looked_since_due_ = false;
    return;
  }
  looked_since_due_ = true;
  if (executive_->is_over()) {
    spdlog::warn("the executive ended the session");
    executive_.reset();
  }
}

void Host::answer(const Observation& observation, MonoTime dequeued_at) {
  for (std::size_t i = 0; i < sensors_.size(); ++i) sensors_[i].update(dequeued_at, samples_[sensors_in_use_[i]]);
  std::string reason = unusable(robot_, sensors_in_use_, samples_, dequeued_at);
  if (!reason.empty()) {
    for (const SensorLink& sensor : sensors_) {
      if (!sensor.problem().empty()) reason += "; " + sensor.problem();
    }
    no_sensor_.say(dequeued_at, "no command published: " + reason);
    statistics_.withheld();
    return;
  }
  no_sensor_.clear();
  const CommandChunk& chunk = responder_.answer(observation, samples_, dequeued_at, monotonic_now);
  trace::publish_begin(chunk.header);
  executive_->publish(chunk);
  trace::publish_end(chunk.header.observation_id, chunk.header.sequence);
  statistics_.add(chunk.header);
}

void Host::report(MonoTime now) {
  if (now - reported_ < kReportPeriod) return;
  spdlog::info("{}", statistics_.summary(now - reported_));
  reported_ = now;
}

}  // namespace takt::policy_host

#include "policy_host/host.hpp"

#include <spdlog/spdlog.h>

#include <utility>

#include "config/observation_shape.hpp"
#include "config/paths.hpp"
#include "executive/contract/monotonic_clock.hpp"
#include "policy_host/pacing.hpp"

namespace takt::policy_host {
namespace {

constexpr char kProgram[] = "takt-policy-host";
constexpr Duration kAttachRetry = milliseconds(200);
constexpr Duration kReportPeriod = seconds(10);

}  // namespace

Host::Host(const config::RobotConfig& robot, const std::string& runtime_directory, std::uint64_t policy_hash,
           Policy& policy, HostFaults faults, Role role)
    : robot_(robot),
      socket_(config::executive_socket(runtime_directory)),
      hello_(hello_of(robot, policy_hash, role, kProgram)),
      introduction_(kProgram, robot.hash, policy_hash, robot.joints),
      responder_(robot, policy_hash, policy),
      largest_input_(config::largest_policy_input(robot)),
      sensors_in_use_(sensors_in_use(robot)),
      samples_(robot.sensors.size()),
      used_(robot.sensors.size()),
      faults_(std::move(faults)) {
  if (largest_input_ != 0) evidence_.emplace(robot, policy_hash, policy.is_built_in());
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
    const MonoTime wake = next_look(now, observed_, robot_.policy->period, looked_since_due_);
    if (!held_.empty() && held_.front().due < wake) {
      sleep_until(held_.front().due);
      publish_held(monotonic_now());
      continue;
    }
    sleep_until(wake);
    if (stop) break;
    look(monotonic_now());
    report(monotonic_now());
  }
}

void Host::attach(MonoTime now) {
  auto link = ExecutiveLink::attach(socket_, hello_, largest_input_);
  if (!link) {
    no_executive_.say(now, "waiting for the executive: " + link.error());
    return;
  }
  executive_.emplace(std::move(*link));
  responder_.start_session();
  observed_ = {};
  observed_id_ = 0;
  queue_.clear();
  held_.clear();
  no_executive_.clear();
  spdlog::info("attached to {}", socket_);
}

void Host::look(MonoTime now) {
  Observation observation;
  trace::dequeue_begin(observed_id_);
  const bool fresh = read(observation);
  trace::dequeue_end(fresh ? observation.id : 0);
  if (fresh) {
    observed_ = observation.published_at;
    observed_id_ = observation.id;
    answer(observation, faults_.any() ? monotonic_now() : now);
    looked_since_due_ = false;
    return;
  }
  looked_since_due_ = true;
  if (executive_->is_over()) {
    spdlog::warn("the executive ended the session");
    executive_.reset();
  }
}

bool Host::read(Observation& observation) {
  return faults_.any() ? read_from_queue(observation) : executive_->read(observation);
}

// A consumer that keeps all: while it has other things to do observations queue up, and are answered in order.
bool Host::read_from_queue(Observation& observation) {
  MonoTime now = monotonic_now();
  const MonoTime free_at = now + faults_.take_callbacks(now);
  for (;; now = monotonic_now()) {
    Observation newest;
    if (executive_->read(newest)) {
      faults_.see(newest);
      if (!faults_.keeps_all(now)) queue_.clear();
      queue_.push_back(newest);
    }
    if (now >= free_at) break;
    sleep_until(now + kCallback);
  }
  if (queue_.empty()) return false;
  observation = queue_.front();
  queue_.pop_front();
  return true;
}

void Host::answer(const Observation& observation, MonoTime dequeued_at) {
  for (std::size_t i = 0; i < sensors_.size(); ++i) sensors_[i].update(dequeued_at, samples_[sensors_in_use_[i]]);
  std::string reason = take_usable(robot_, sensors_in_use_, samples_, monotonic_now(), used_);
  if (!reason.empty()) {
    for (const SensorLink& sensor : sensors_) {
      if (!sensor.problem().empty()) reason += "; " + sensor.problem();
    }
    no_sensor_.say(dequeued_at, "no command published: " + reason);
    statistics_.withheld();
    return;
  }
  no_sensor_.clear();
  const CommandChunk& chunk = responder_.answer(observation, used_, dequeued_at, monotonic_now);
  if (faults_.any()) {
    const MonoTime at = chunk.header.published_at;
    held_.push_back({at + faults_.publish_delay(at), chunk});
    faults_.spoil(held_.back().chunk, at);
    publish_held(monotonic_now());
  } else {
    publish(chunk);
  }
  // Behind the command: what the robot waits for goes first.
  if (evidence_)
    executive_->publish_input(evidence_->pack(observation, used_, chunk.header.sequence, responder_.inference()));
}

void Host::publish(const CommandChunk& chunk) {
  trace::publish_begin(chunk.header);
  executive_->publish(chunk);
  trace::publish_end(chunk.header.observation_id, chunk.header.sequence);
  statistics_.add(chunk.header);
}

// In order: what was made later does not overtake.
void Host::publish_held(MonoTime now) {
  for (; !held_.empty() && held_.front().due <= now; held_.pop_front()) publish(held_.front().chunk);
}

void Host::report(MonoTime now) {
  if (now - reported_ < kReportPeriod) return;
  spdlog::info("{}", statistics_.summary(now - reported_));
  reported_ = now;
}

}  // namespace takt::policy_host

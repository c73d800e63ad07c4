// SPDX-License-Identifier: Apache-2.0
#include "policy_host/host.hpp"

#include <spdlog/spdlog.h>

#include <algorithm>
#include <utility>

#include "config/observation_shape.hpp"
#include "config/paths.hpp"
#include "executive/contract/image_sample.hpp"
#include "executive/contract/monotonic_clock.hpp"

namespace takt::policy_host {
namespace {

constexpr char kProgram[] = "takt-policy-host";
constexpr Duration kAttachRetry = milliseconds(200);
constexpr Duration kLongestWait = milliseconds(200);  // for an inference: the host may be told to end meanwhile
constexpr Duration kReportPeriod = seconds(10);

PathOwner owner_of(Role role) {
  if (role == Role::candidate_policy) return PathOwner::candidate;
  return role == Role::policy ? PathOwner::policy : PathOwner::nobody;
}

}  // namespace

Host::Host(const config::RobotConfig& robot, const std::string& runtime_directory, std::uint64_t policy_hash,
           std::span<Policy* const> policies, HostFaults faults, Role role)
    : robot_(robot),
      socket_(config::executive_socket(runtime_directory)),
      hello_(hello_of(robot, policy_hash, role, kProgram)),
      introduction_(kProgram, robot.hash, policy_hash, robot.joints),
      responder_(robot, policy_hash, *policies.front(), owner_of(role)),
      largest_input_(config::largest_policy_input(robot)),
      sensors_in_use_(sensors_in_use(robot)),
      samples_(robot.sensors.size()),
      images_(robot.sensors.size()),
      only_policy_(*policies.front()),
      asked_(policies.size(), Asked{.request = {}, .used = std::vector<SensorSample>(robot.sensors.size())}),
      pacing_(static_cast<std::uint32_t>(policies.size())),
      faults_(std::move(faults)) {
  if (policies.size() > 1) pool_.emplace(policies, monotonic_now);
  if (largest_input_ != 0) evidence_.emplace(robot, policy_hash, policies.front()->is_built_in(), owner_of(role));
  for (const std::size_t sensor : sensors_in_use_) {
    const config::Sensor& declared = robot.sensors[sensor];
    sensors_.emplace_back(config::sensor_socket(runtime_directory, declared.name),
                          hello_of(robot, policy_hash, Role::sensor_reader, kProgram), mailbox_of(declared));
    const std::vector<std::byte>& buffer = image_buffers_.emplace_back(image_bytes(declared));
    if (declared.image)
      images_[sensor] = {reinterpret_cast<const std::uint8_t*>(buffer.data()) + sizeof(ImageHeader),
                         declared.image->bytes()};
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
    if (wait(now) && !stop) look(monotonic_now());
    report(monotonic_now());
  }
}

MonoTime Host::next_request(MonoTime now) const {
  if (pool_ && !pool_->idle()) return now + kLongestWait;
  return std::max(next_look(now, observed_, robot_.policy->period, looked_since_due_), pacing_.next());
}

bool Host::wait(MonoTime now) {
  const MonoTime due = next_request(now);
  const bool holds = !held_.empty() && held_.front().due < due;
  const MonoTime wake = std::min(holds ? held_.front().due : due, now + kLongestWait);
  if (!pool_) {
    sleep_until(wake);
  } else if (const auto ended = pool_->finished(wake)) {
    deliver(*ended);
    return false;
  }
  if (holds) publish_held(monotonic_now());
  return !holds && wake == due && (!pool_ || pool_->idle());
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
    if (!responder_.awaits(observation)) answer(observation, faults_.any() ? monotonic_now() : now);
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

void Host::update_sensors(MonoTime now) {
  for (std::size_t i = 0; i < sensors_.size(); ++i) {
    SensorSample& sample = samples_[sensors_in_use_[i]];
    if (image_buffers_[i].empty())
      sensors_[i].update(now, sample);
    else
      sensors_[i].update(now, sample, image_buffers_[i]);
  }
}

void Host::answer(const Observation& observation, MonoTime dequeued_at) {
  update_sensors(dequeued_at);
  const std::size_t slot = pool_ ? pool_->idle().value_or(0) : 0;
  Asked& asked = asked_[slot];
  std::string reason = take_usable(robot_, sensors_in_use_, samples_, monotonic_now(), asked.used);
  if (!reason.empty()) {
    for (const SensorLink& sensor : sensors_) {
      if (!sensor.problem().empty()) reason += "; " + sensor.problem();
    }
    no_sensor_.say(dequeued_at, "no command published: " + reason);
    executive_->state_problem(dequeued_at, reason);
    statistics_.withheld();
    return;
  }
  no_sensor_.clear();
  executive_->state_problem(dequeued_at, "");
  responder_.ask(observation, asked.used, dequeued_at, asked.request, images_);
  pacing_.asked(dequeued_at);
  if (pool_) {
    pool_->start(slot, asked.request);
  } else {
    Responder::infer(only_policy_, asked.request, monotonic_now);
    deliver(slot);
  }
}

void Host::deliver(std::size_t asked) {
  const auto& [request, used] = asked_[asked];
  pacing_.took(request.infer_ended_at - request.infer_started_at);
  const CommandChunk* const chunk = executive_ ? responder_.take(request, monotonic_now) : nullptr;
  if (chunk == nullptr) {
    statistics_.overtaken();
    return;
  }
  if (faults_.any()) {
    const MonoTime at = chunk->header.published_at;
    held_.push_back({at + faults_.publish_delay(at), *chunk});
    faults_.spoil(held_.back().chunk, at);
    publish_held(monotonic_now());
  } else {
    publish(*chunk);
  }
  // Behind the command: what the robot waits for goes first.
  if (evidence_)
    executive_->publish_input(
        evidence_->pack(request.observation, used, chunk->header.sequence, responder_.inference()));
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

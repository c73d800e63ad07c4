// SPDX-License-Identifier: Apache-2.0
#include "evidence/rollout/virtual_policy.hpp"

#include <algorithm>
#include <array>
#include <cmath>
#include <utility>

#include "policy_host/bad_actions.hpp"
#include "policy_host/host_faults.hpp"
#include "policy_host/sensor_link.hpp"

namespace takt::evidence {
namespace {

constexpr std::uint64_t kSampleLossStream = 201, kPolicyStream = 301, kModeStream = 351;
constexpr std::uint64_t kImageLossStream = 701;  // of a robot's first sensor, the others' behind it
constexpr Duration kPollSpread = microseconds(100);
constexpr Duration kBuildInput = microseconds(20);  // dequeued -> inference starts

// The responder asks a clock when an inference starts, when it ends, and when its command is published.
struct Script {
  std::array<MonoTime, 2> stamps;
  std::size_t next = 0;
};
thread_local Script t_script;

MonoTime scripted_clock() {
  return t_script.stamps[t_script.next++ % t_script.stamps.size()];
}

Duration scaled(Duration duration, double factor) {
  return {std::llround(static_cast<double>(duration.ns) * factor)};
}

}  // namespace

VirtualPolicy::VirtualPolicy(const config::RobotConfig& robot, std::uint64_t policy_hash, const Answering& answering,
                             const PolicyTiming& timing, const Disturbance& disturbance, const Disturbance& of_sensors,
                             std::uint64_t seed)
    : robot_(robot),
      timing_(timing),
      disturbance_(disturbance),
      seed_(seed),
      answering_(answering),
      pacing_(robot.policy->requests_in_flight),
      sensors_in_use_(policy_host::sensors_in_use(robot)),
      samples_(robot.sensors.size()),
      used_(robot.sensors.size()),
      images_(robot.sensors.size()),
      free_at_(robot.policy->requests_in_flight) {
  // At most one sensor of numbers has samples.
  for (std::size_t sensor = 0; sensor < robot.sensors.size(); ++sensor)
    feeds_.emplace_back(of_sensors, seed, robot.sensors[sensor].image ? kImageLossStream + sensor : kSampleLossStream);
  if (answering_.network != nullptr) responder_.emplace(robot, policy_hash, *answering_.network).start_session();
}

bool VirtualPolicy::is_dead(MonoTime at) const {
  return disturbance_.dose(Trouble::policy_crash, at) > 0;
}

void VirtualPolicy::observe(const Observation& observation) {
  const MonoTime at = observation.published_at;
  if (is_dead(at)) return;
  Random draw(simulation::seed_for(seed_, kPolicyStream), observation.id);
  Duration callbacks;
  if (const std::int64_t turn = disturbance_.turn(Trouble::queue_growth, at); turn > bursts_) {
    bursts_ = turn;
    callbacks = scaled(policy_host::kCallback, disturbance_.dose(Trouble::queue_growth, at));
  }
  waiting_.push_back({observation, at + policy_host::kPublishMargin + scaled(kPollSpread, draw.unit()), callbacks});
}

void VirtualPolicy::live_through_crash(MonoTime now) {
  if (!disturbance_.has(Trouble::policy_crash) || now < disturbance_.begins(Trouble::policy_crash)) return;
  const MonoTime died = disturbance_.begins(Trouble::policy_crash), back = disturbance_.ends(Trouble::policy_crash);
  if (!crashed_) {
    crashed_ = true;
    waiting_.clear();
    std::erase_if(sent_, [&](const ArrivedCommand& one) { return one.published_at > died; });
    std::erase_if(in_flight_, [&](const InFlight& one) { return one.published > died; });
    std::ranges::fill(free_at_, back);
  }
  if (!restarted_ && now >= back) {
    restarted_ = true;
    ++session_;
    if (responder_) return responder_->start_session();
    (void)answering_.program->begin_anew();  // it keeps why not
  }
}

// A process that stands still does what it was about to do once it goes on.
MonoTime VirtualPolicy::awake(MonoTime at) const {
  return disturbance_.dose(Trouble::policy_freeze, at) > 0 ? disturbance_.ends(Trouble::policy_freeze) : at;
}

MonoTime VirtualPolicy::end_of(MonoTime start, Duration work) const {
  const MonoTime end = start + work;
  if (!disturbance_.has(Trouble::policy_freeze)) return end;
  const MonoTime begins = disturbance_.begins(Trouble::policy_freeze), ends = disturbance_.ends(Trouble::policy_freeze);
  return start < begins && end > begins ? end + (ends - begins) : end;
}

VirtualPolicy::Waiting VirtualPolicy::next(MonoTime ready) {
  const bool queue = disturbance_.dose(Trouble::queue_growth, ready) > 0;
  while (!queue && waiting_.size() > 1 && waiting_[1].readable_at <= ready) waiting_.pop_front();
  Waiting taken = std::move(waiting_.front());
  waiting_.pop_front();
  return taken;
}

MonoTime VirtualPolicy::next_request() const {
  if (waiting_.empty()) return {};
  const MonoTime free = std::max(*std::ranges::min_element(free_at_), pacing_.next());
  return awake(std::max(free, waiting_.front().readable_at));
}

MonoTime VirtualPolicy::next_publication() const {
  const auto first = std::ranges::min_element(in_flight_, {}, &InFlight::published);
  return first == in_flight_.end() ? MonoTime{} : first->published;
}

void VirtualPolicy::run_until(MonoTime now) {
  live_through_crash(now);
  while (true) {
    const MonoTime publication = next_publication(), ready = next_request();
    if (publication.is_set() && publication <= now && (!ready.is_set() || publication <= ready)) {
      publish_next();
    } else if (ready.is_set() && ready <= now) {
      const Waiting waiting = next(ready);
      if (responder_ && responder_->awaits(waiting.observation)) continue;
      ask(waiting, end_of(ready, waiting.callbacks));
    } else {
      return;
    }
  }
}

Duration VirtualPolicy::inference_time(Random& draw, MonoTime started) {
  const double mean = static_cast<double>(timing_.inference.ns);
  Duration time{std::llround(timing_.spread > 0 ? draw.lognormal(mean, timing_.spread) : mean)};
  if (const double factor = disturbance_.dose(Trouble::inference_mean_shift, started); factor > 0)
    time = scaled(time, factor);
  if (const double loads = disturbance_.dose(Trouble::gpu_contention, started); loads > 0)
    time = scaled(time, 1 + 2 * loads * draw.unit());
  if (const std::int64_t turn = disturbance_.turn(Trouble::inference_stall, started); turn > stalls_) {
    stalls_ = turn;
    time = time + disturbance_.delay(Trouble::inference_stall, started);
  }
  return time;
}

void VirtualPolicy::spoil(CommandChunk& chunk, Random& draw, MonoTime at) const {
  const policy_host::BadActions bad{
      .nan_share = disturbance_.dose(Trouble::bad_actions_nan, at),
      .range_share = disturbance_.dose(Trouble::bad_actions_range, at),
      .joint_shift = static_cast<std::size_t>(disturbance_.dose(Trouble::wrong_joint_order, at))};
  const std::size_t joint = draw.below(chunk.header.joint_count);
  const std::size_t step = draw.below(chunk.header.step_count);
  policy_host::spoil(chunk, bad, {joint, step, draw.unit()});
}

void VirtualPolicy::drift(policy_host::Request& request) const {
  if (timing_.modes < 2) return;
  Random draw(simulation::seed_for(seed_, kModeStream), request.observation.id);
  const double side = 2.0 * static_cast<double>(draw.below(timing_.modes)) / (timing_.modes - 1) - 1;
  const std::size_t steps = robot_.policy->steps, width = request.output.size() / steps;
  for (std::size_t i = 0; i < request.output.size(); ++i) {
    const std::size_t step = i / width + 1;
    const double share = static_cast<double>(step) / static_cast<double>(steps);
    request.output[i] += static_cast<float>(side * share * timing_.mode_spread);
  }
}

void VirtualPolicy::ask(const Waiting& waiting, MonoTime dequeued_at) {
  for (const std::size_t sensor : sensors_in_use_) {
    const auto& [sample, pixels] = feeds_[sensor].newest(dequeued_at);
    samples_[sensor] = sample;
    if (pixels) images_[sensor] = *pixels;
  }
  const MonoTime started = dequeued_at + kBuildInput;
  MonoTime& free_at = *std::ranges::min_element(free_at_);
  free_at = started;
  if (!policy_host::take_usable(robot_, sensors_in_use_, samples_, dequeued_at, used_).empty()) return;
  if (told_)
    for (const std::size_t sensor : sensors_in_use_) told_({sensor, samples_[sensor], images_[sensor]});
  Random draw(simulation::seed_for(seed_, kPolicyStream + 1), waiting.observation.id);
  const MonoTime ended = end_of(started, inference_time(draw, started));
  const MonoTime published = ended + timing_.publish;
  free_at = published;
  pacing_.asked(dequeued_at);
  InFlight& one = in_flight_.emplace_back(InFlight{{}, published, draw, nullptr});
  one.request.observation = waiting.observation;
  if (responder_)
    ask_network(one, dequeued_at, started, ended);
  else
    ask_program(one, dequeued_at, started, ended);
}

void VirtualPolicy::ask_network(InFlight& one, MonoTime dequeued_at, MonoTime started, MonoTime ended) {
  const Observation observation = one.request.observation;
  responder_->ask(observation, used_, dequeued_at, one.request, images_);
  t_script = {{started, ended}, 0};
  policy_host::Responder::infer(*answering_.network, one.request, scripted_clock);
  drift(one.request);
}

// What it says of when things happened is of another time than this one.
void VirtualPolicy::ask_program(InFlight& one, MonoTime dequeued_at, MonoTime started, MonoTime ended) {
  one.request.infer_started_at = started;
  one.request.infer_ended_at = ended;
  Observation& shown = one.request.observation;
  shown.overtaken = program_published_ >= shown.published_at ? 1 : 0;
  one.said = spare_ ? std::move(spare_) : std::make_unique<CommandChunk>();
  if (!answering_.program->answer(one.request.observation, used_, images_, *one.said)) return one.said.reset();
  CommandHeader& header = one.said->header;
  header.dequeued_at = dequeued_at;
  header.infer_started_at = started;
  header.infer_ended_at = ended;
  header.published_at = program_published_ = one.published;
}

const CommandChunk* VirtualPolicy::taken(InFlight& one) {
  if (!responder_) return one.said.get();
  t_script = {{one.published, one.published}, 0};
  return responder_->take(one.request, scripted_clock);
}

std::unique_ptr<CommandChunk> VirtualPolicy::copy_of(const CommandChunk& chunk) {
  std::unique_ptr<CommandChunk> copy = spare_ ? std::move(spare_) : std::make_unique<CommandChunk>();
  copy->header = chunk.header;
  std::copy_n(chunk.values, chunk.value_count(), copy->values);
  return copy;
}

void VirtualPolicy::publish_next() {
  const auto first = std::ranges::min_element(in_flight_, {}, &InFlight::published);
  InFlight one = std::move(*first);
  in_flight_.erase(first);
  const policy_host::Request& request = one.request;
  pacing_.took(request.infer_ended_at - request.infer_started_at);
  const CommandChunk* const chunk = taken(one);
  if (chunk == nullptr) return;
  ArrivedCommand command{request.observation.oldest_sensed_at, request.observation.published_at, one.published,
                         one.published + disturbance_.delay(Trouble::publish_delay, one.published), copy_of(*chunk)};
  spoil(*command.chunk, one.draw, one.published);
  // The way is one queue: what was published later does not arrive earlier.
  if (!sent_.empty()) command.arrives_at = std::max(command.arrives_at, sent_.back().arrives_at);
  sent_.push_back(std::move(command));
}

const ArrivedCommand* VirtualPolicy::read(MonoTime now) {
  bool fresh = false;
  while (!sent_.empty() && sent_.front().arrives_at <= now) {
    if (newest_.chunk) spare_ = std::move(newest_.chunk);
    newest_ = std::move(sent_.front());
    sent_.pop_front();
    fresh = true;
  }
  return fresh ? &newest_ : nullptr;
}

}  // namespace takt::evidence

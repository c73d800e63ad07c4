// SPDX-License-Identifier: Apache-2.0
#include "client/policy_session.hpp"

#include <sys/resource.h>

#include <algorithm>
#include <array>
#include <cmath>
#include <cstddef>
#include <cstring>
#include <filesystem>
#include <span>
#include <string_view>
#include <utility>

#include "client/stream_view.hpp"
#include "config/load.hpp"
#include "config/observation_shape.hpp"
#include "config/paths.hpp"
#include "executive/contract/mode.hpp"
#include "executive/contract/monotonic_clock.hpp"
#include "policy_host/pacing.hpp"
#include "policy_host/policy_fit.hpp"

namespace takt::client {
namespace {

constexpr Duration kAttachRetry = milliseconds(200);
constexpr Duration kLockstepLook = microseconds(20);
constexpr std::size_t kNoQueue = SIZE_MAX;

// Why such a chunk would be refused by the executive; null: it would not.
const char* wrong_with_dq(bool has_dq, config::Interpolation interpolation) {
  switch (interpolation) {
    case config::Interpolation::hold:
      return nullptr;
    case config::Interpolation::linear:
      return has_dq ? "a chunk with dq, but the robot file joins steps by lines: leave dq out, or say "
                      "policy.action.interpolation: cubic (or hold) there"
                    : nullptr;
    case config::Interpolation::cubic:
      return has_dq ? nullptr
                    : "a chunk without dq, but the robot file says policy.action.interpolation: cubic: give dq, or "
                      "say linear or hold there";
  }
  return nullptr;
}

std::size_t width(const config::RobotConfig& robot, const Term& term) {
  if (term.kind == TAKT_TERM_IMAGE || term.kind == TAKT_TERM_QUEUE) return 0;
  return term.kind == TAKT_TERM_STREAM ? term.values : robot.joints.size();
}

// Of a program that was compiled before there were assumptions.
constexpr std::size_t kSizeWithoutAssumption = offsetof(takt_chunk, assumes);

const takt_assumption* assumption_of(const takt_chunk& chunk) {
  return chunk.size == kSizeWithoutAssumption ? nullptr : chunk.assumes;
}

// Why the executive would refuse it; null: it would not, or for its age only.
const char* fault_in(const takt_assumption* assumption, const config::Policy& policy, std::int64_t published_ns) {
  if (assumption == nullptr) return nullptr;
  if (assumption->size != sizeof *assumption || assumption->reserved != 0)
    return "takt_assumption has another size: set `size`, and compile with the header of this library";
  if (!policy.speculation)
    return "a chunk that assumes something, but the robot file takes none: add policy.speculation there";
  if (assumption->q == nullptr) return "an assumption without q: where the joints will be is what it is about";
  if (assumption->at_ns <= published_ns)
    return "an assumption about an instant not after the observation's: leave it out, the chunk is no speculation";
  return nullptr;
}

// What went wrong on the way to the executive, and not what it answered (executive/ipc/rendezvous_client.cpp).
bool is_no_answer(const std::string& sentence) {
  return sentence.starts_with("rendezvous: ");
}

}  // namespace

std::expected<std::unique_ptr<PolicySession>, Refusal> PolicySession::open(const PolicySpec& spec) {
  auto robot = config::load(spec.robot_file);
  if (!robot) return refuse(robot.error().substr(0, robot.error().find('\n')));
  if (const auto fine = policy_host::check_policy_section(*robot); !fine) return refuse(fine.error());
  if (auto fine = check_spec(*robot, spec); !fine) return std::unexpected(fine.error());
  if (!spec.candidate_file.empty()) robot->policy->file = std::filesystem::absolute(spec.candidate_file).string();
  const auto hash = config::policy_hash(robot->policy->file);
  if (!hash) return refuse(hash.error());
  const std::string directory =
      spec.runtime_directory.empty() ? config::default_runtime_directory(robot->robot) : spec.runtime_directory;
  // Where it is not granted, the policy runs at the level it has.
  (void)setpriority(PRIO_PROCESS, 0, robot->policy->nice);
  return std::unique_ptr<PolicySession>(new PolicySession(std::move(*robot), spec, *hash, directory));
}

PolicySession::PolicySession(config::RobotConfig robot, const PolicySpec& spec, std::uint64_t policy_hash,
                             const std::string& runtime_directory)
    : robot_(std::move(robot)),
      socket_(config::executive_socket(runtime_directory)),
      hello_(policy_host::hello_of(robot_, policy_hash,
                                   spec.candidate_file.empty() ? Role::policy : Role::candidate_policy,
                                   spec.program.c_str())),
      sensors_in_use_(policy_host::sensors_in_use(robot_)),
      samples_(robot_.sensors.size()),
      used_(robot_.sensors.size()),
      largest_input_(config::largest_policy_input(robot_)),
      promised_(robot_),
      alternatives_(robot_),
      mixer_(robot_, spec.candidate_file.empty() ? policy_host::PathOwner::policy : policy_host::PathOwner::candidate) {
  if (largest_input_ != 0) evidence_.emplace(robot_, policy_hash);
  for (const std::size_t sensor : sensors_in_use_) {
    sensors_.emplace_back(config::sensor_socket(runtime_directory, robot_.sensors[sensor].name),
                          policy_host::hello_of(robot_, policy_hash, Role::sensor_reader, spec.program.c_str()),
                          policy_host::mailbox_of(robot_.sensors[sensor]));
    payloads_.emplace_back(policy_host::image_bytes(robot_.sensors[sensor]));
  }
  queued_.assign(sensors_.size(), kNoQueue);
  for (const config::Sensor& sensor : robot_.sensors) streams_.push_back(view_of(sensor));
  std::size_t count = 0;
  for (const Term& term : spec.terms) {
    const auto sensor = std::ranges::find(robot_.sensors, term.stream, &config::Sensor::name);
    blocks_.push_back({term.kind, static_cast<std::size_t>(sensor - robot_.sensors.begin()), width(robot_, term)});
    count += blocks_.back().values;
    const auto used =
        static_cast<std::size_t>(std::ranges::find(sensors_in_use_, blocks_.back().sensor) - sensors_in_use_.begin());
    if (term.kind == TAKT_TERM_QUEUE) {
      queued_[used] = queues_.size();
      queues_.emplace_back(*sensor);
    }
    if (term.kind == TAKT_TERM_IMAGE)
      images_.push_back(reinterpret_cast<const std::uint8_t*>(payloads_[used].data() + sizeof(ImageHeader)));
  }
  add_evidence();
  values_.resize(count);
  for (const config::Joint& joint : robot_.joints) {
    joint_names_.push_back(joint.name.c_str());
    home_.push_back(static_cast<float>(joint.home));
  }
  robot_view_ = {.name = robot_.robot.c_str(),
                 .policy_file = robot_.policy->file.c_str(),
                 .policy_hash = policy_hash,
                 .joint_count = static_cast<std::uint32_t>(robot_.joints.size()),
                 .steps = robot_.policy->steps,
                 .joints = joint_names_.data(),
                 .home = home_.data(),
                 .period_ns = robot_.policy->period.ns,
                 .step_ns = robot_.policy->step_period.ns};
  view_.values = values_.data();
  view_.images = images_.data();
  view_.image_count = static_cast<std::uint32_t>(images_.size());
  view_.value_count = static_cast<std::uint32_t>(count);
  queue_views_.resize(queues_.size());
  for (std::size_t i = 0; i < queues_.size(); ++i) queues_[i].show(queue_views_[i]);
  view_.queues = queue_views_.data();
  view_.queue_count = static_cast<std::uint32_t>(queues_.size());
  view_.mode = name(Mode::standby).data();
  chunk_.header.policy_hash = policy_hash;
  chunk_.header.step_period = robot_.policy->step_period;
  chunk_.header.step_count = static_cast<std::uint16_t>(robot_.policy->steps);
  chunk_.header.joint_count = static_cast<std::uint16_t>(robot_.joints.size());
}

void PolicySession::add_evidence() {
  if (!evidence_) return;
  std::size_t queue = 0;
  for (const Block& block : blocks_)
    evidence_->add_term(block.kind, block.sensor, block.kind == TAKT_TERM_QUEUE ? &queues_[queue++] : nullptr);
}

int PolicySession::misused(const char* sentence) {
  sentence_ = sentence;
  return TAKT_USAGE;
}

int PolicySession::try_to_attach(MonoTime now) {
  next_attempt_ = now + kAttachRetry;
  auto link = policy_host::ExecutiveLink::attach(socket_, hello_, largest_input_,
                                                 policy_host::ExecutiveLink::Time::clock_or_lockstep);
  if (!link) {
    sentence_ = link.error();
    if (!is_no_answer(sentence_)) return TAKT_REFUSED;
    sentence_.insert(0, "waiting for the executive: ");
    return TAKT_NOTHING;
  }
  executive_.emplace(std::move(*link));
  continuity_.start_session();
  forget_ = true;
  sequence_ = answered_id_ = 0;
  stated_source_.clear();
  seen_published_at_ = {};
  dequeued_at_ = {};
  for (SampleQueue& queue : queues_) queue.forget();
  promised_.start_session();
  alternatives_.drop_all();
  mixer_.forget();
  view_.id = 0;
  sentence_.clear();
  return TAKT_OK;
}

int PolicySession::attach(Duration timeout) {
  const MonoTime deadline = monotonic_now() + timeout;
  while (!executive_) {
    sleep_until(std::min(next_attempt_, deadline));
    const int result = try_to_attach(monotonic_now());
    if (result == TAKT_REFUSED || (result == TAKT_NOTHING && monotonic_now() >= deadline)) return result;
  }
  return TAKT_OK;
}

int PolicySession::next(Duration timeout) {
  const MonoTime deadline = monotonic_now() + timeout;
  do {
    if (!executive_) {
      const int result = attach(std::max(Duration{}, deadline - monotonic_now()));
      if (result != TAKT_OK) return result;
    }
    if (executive_->is_lockstep()) pass(view_.id);
    sleep_until(std::min(next_look(), deadline));
    if (const int result = look(monotonic_now()); result == TAKT_OK) return result;
  } while (monotonic_now() < deadline);
  return TAKT_NOTHING;
}

MonoTime PolicySession::next_look() const {
  const MonoTime now = monotonic_now();
  if (executive_->is_lockstep()) return now + kLockstepLook;
  return policy_host::next_look(now, seen_published_at_, robot_.policy->period, looked_since_due_);
}

void PolicySession::pass(std::uint64_t observation_id) {
  if (observation_id <= answered_id_) return;
  if (observation_id == view_.id) send_alternative();
  if (observation_id <= answered_id_) return;
  answered_id_ = observation_id;
  const CommandHeader kept = std::exchange(chunk_.header, {});
  chunk_.header.observation_id = observation_id;
  executive_->publish(chunk_);
  chunk_.header = kept;
}

int PolicySession::look(MonoTime now) {
  Observation newest;
  if (!executive_->read(newest) || newest.id == 0) {
    looked_since_due_ = true;
    if (executive_->is_over()) {
      sentence_ = "the executive ended the session";
      executive_.reset();
    }
    return TAKT_NOTHING;
  }
  looked_since_due_ = false;
  seen_published_at_ = newest.published_at;
  if (!has_usable_samples(newest, now)) {
    if (executive_->is_lockstep()) pass(newest.id);
    return TAKT_NOTHING;
  }
  observation_ = newest;
  show(now);
  if (view_.reset != 0) {
    alternatives_.drop_all();
    mixer_.forget();
  }
  if (!executive_->is_lockstep()) send_alternative();
  sentence_.clear();
  return TAKT_OK;
}

void PolicySession::update_sensor(std::size_t used, MonoTime now) {
  SensorSample& sample = samples_[sensors_in_use_[used]];
  if (queued_[used] != kNoQueue)
    return queues_[queued_[used]].take_all(sensors_[used], now, executive_->is_lockstep(), sample);
  std::vector<std::byte>& payload = payloads_[used];
  if (payload.empty()) return sensors_[used].update(now, sample);
  sensors_[used].update(now, sample, payload);
}

const takt_stream* PolicySession::stream(const char* name) const {
  const auto found = std::ranges::find(robot_.sensors, std::string_view(name), &config::Sensor::name);
  return found == robot_.sensors.end() ? nullptr : &streams_[static_cast<std::size_t>(found - robot_.sensors.begin())];
}

MonoTime PolicySession::instant_of(const Observation& newest) const {
  MonoTime instant = newest.published_at;
  for (const std::size_t sensor : sensors_in_use_) instant = std::max(instant, samples_[sensor].published_at);
  return instant;
}

bool PolicySession::has_usable_samples(const Observation& newest, MonoTime now) {
  for (std::size_t i = 0; i < sensors_.size(); ++i) update_sensor(i, now);
  const MonoTime judged_at = executive_->is_lockstep() ? instant_of(newest) : monotonic_now();
  std::string reason = policy_host::take_usable(robot_, sensors_in_use_, samples_, judged_at, used_);
  if (!reason.empty())
    for (const policy_host::SensorLink& sensor : sensors_)
      if (!sensor.problem().empty()) reason += "; " + sensor.problem();
  executive_->state_problem(now, reason.empty() ? problem_ : reason);
  if (reason.empty()) return true;
  sentence_ = "no observation is passed on: " + reason;
  return false;
}

void PolicySession::show(MonoTime now) {
  const auto step = continuity_.advance(observation_);
  dequeued_at_ = now;
  infer_started_at_ = {};
  infer_ended_at_ = {};
  MonoTime outside;
  for (const std::size_t sensor : sensors_in_use_) {
    const MonoTime sensed = used_[sensor].sensed_at;
    if (!outside.is_set() || sensed < outside) outside = sensed;
  }
  view_.id = observation_.id;
  view_.dropped = step.dropped;
  view_.published_ns = observation_.published_at.ns;
  view_.sensed_ns = observation_.oldest_sensed_at.ns;
  view_.outside_sensed_ns = outside.ns;
  view_.mode = name(static_cast<Mode>(observation_.mode)).data();
  show_promise();
  view_.reset = forget_ || !step.continues ? 1 : 0;
  forget_ = false;
  for (std::size_t i = 0; i < queues_.size(); ++i) queues_[i].show(queue_views_[i]);
  fill_values();
  if (evidence_) evidence_->show(observation_, view_, used_);
}

// Of a chunk that another policy published, or this one in an earlier session, it knows no step: the mailbox may still
// hold an observation from before.
void PolicySession::show_promise() {
  const bool is_ours = (observation_.of_candidate != 0) == (hello_.role == Role::candidate_policy) &&
                       observation_.command_sequence <= sequence_;
  view_.following = is_ours ? observation_.command_sequence : 0;
  view_.committed_from = is_ours ? observation_.committed_from : 0;
  view_.committed_count = is_ours ? std::min(observation_.committed_count, robot_view_.steps) : 0;
  view_.committed = is_ours ? promised_.show(observation_) : nullptr;
}

const float* PolicySession::values_of(const Block& block) const {
  switch (block.kind) {
    case TAKT_TERM_Q:
      return observation_.q.at.data();
    case TAKT_TERM_DQ:
      return observation_.dq.at.data();
    case TAKT_TERM_TAU:
      return observation_.tau.at.data();
    case TAKT_TERM_Q_SETPOINT:
      return observation_.q_setpoint.at.data();
    case TAKT_TERM_DQ_OF_DRIVE:
      return observation_.dq_of_drive.at.data();
    default:
      return std::data(used_[block.sensor].values);
  }
}

void PolicySession::fill_values() {
  auto out = values_.begin();
  for (const Block& block : blocks_) {
    if (block.values == 0) continue;  // lies elsewhere
    out = std::copy_n(values_of(block), block.values, out);
  }
}

int PolicySession::infer_begin() {
  if (!dequeued_at_.is_set()) return misused("infer_begin without an observation: call takt_policy_next first");
  infer_started_at_ = monotonic_now();
  infer_ended_at_ = {};
  return TAKT_OK;
}

int PolicySession::infer_end() {
  if (!infer_started_at_.is_set()) return misused("infer_end without infer_begin for this observation");
  infer_ended_at_ = monotonic_now();
  return TAKT_OK;
}

bool PolicySession::fill_chunk(const takt_chunk& given) {
  CommandHeader& header = chunk_.header;
  const std::array<std::pair<const float*, CommandField>, kCommandFieldCount> fields{
      {{given.q, CommandField::q},
       {given.dq, CommandField::dq},
       {given.kp, CommandField::kp},
       {given.kd, CommandField::kd},
       {given.tau_ff, CommandField::tau_ff}}};
  unsigned mask = 0;
  for (const auto& [values, field] : fields) mask |= values != nullptr ? static_cast<unsigned>(field) : 0U;
  header.fields = static_cast<std::uint8_t>(mask);
  if (chunk_.value_count() > kMaxChunkValues) return false;
  for (const auto& [values, field] : fields) {
    if (values == nullptr) continue;
    for (std::size_t step = 0; step < header.step_count; ++step)
      std::copy_n(values + step * header.joint_count, header.joint_count,
                  &chunk_.values[value_index(header, field, step, 0)]);
  }
  return true;
}

MonoTime PolicySession::oldest_sensed_at() const {
  const MonoTime outside{view_.outside_sensed_ns};
  return outside.is_set() ? std::min(outside, observation_.oldest_sensed_at) : observation_.oldest_sensed_at;
}

void PolicySession::send(MonoTime outside_sensed_at, MonoTime infer_started_at, MonoTime infer_ended_at) {
  CommandHeader& header = chunk_.header;
  header.observation_id = answered_id_ = view_.id;
  header.sequence = ++sequence_;
  header.outside_sensed_at = outside_sensed_at;
  header.dequeued_at = dequeued_at_;
  header.published_at = monotonic_now();
  header.infer_started_at = infer_started_at.is_set() ? infer_started_at : dequeued_at_;
  header.infer_ended_at = infer_ended_at.is_set() ? infer_ended_at : header.published_at;
  header.dropped_observations = static_cast<std::uint32_t>(std::min<std::uint64_t>(view_.dropped, UINT32_MAX));
  const bool is_lockstep = executive_->is_lockstep();
  mixer_.mix(observation_, is_lockstep ? observation_.published_at : header.published_at, chunk_);
  if (source_ != stated_source_) executive_->state_source(stated_source_ = source_, header.sequence);
  if (!problem_.empty()) state_problem("");
  executive_->publish(chunk_);
  // Behind the command: what the robot waits for goes first.
  promised_.remember({header.sequence, is_lockstep ? MonoTime{} : header.published_at, {view_.published_ns}}, chunk_);
}

int PolicySession::state_problem(std::string problem) {
  problem_ = std::move(problem);
  if (executive_) executive_->state_problem(monotonic_now(), problem_);
  return TAKT_OK;
}

int PolicySession::state_source(std::string source) {
  source_ = std::move(source);
  return TAKT_OK;
}

void PolicySession::send_alternative() {
  MonoTime sensed_at;
  if (!alternatives_.match(observation_, answered_id_, chunk_, sensed_at)) return;
  send(std::min(sensed_at, oldest_sensed_at()), {}, {});
}

int PolicySession::publish(const takt_chunk& given) {
  if ((given.size != sizeof given && given.size != kSizeWithoutAssumption) || given.reserved != 0)
    return misused("takt_chunk has another size: set `size`, and compile with the header of this library");
  if (given.q == nullptr) return misused("a chunk without q: position targets are mandatory");
  if (const char* const wrong = wrong_with_dq(given.dq != nullptr, robot_.policy->action.interpolation);
      wrong != nullptr)
    return misused(wrong);
  if (!executive_ || !dequeued_at_.is_set())
    return misused("publish without an observation to answer: call takt_policy_next first");
  const takt_assumption* const assumption = assumption_of(given);
  if (const char* const wrong = fault_in(assumption, *robot_.policy, view_.published_ns); wrong != nullptr)
    return misused(wrong);
  if (!fill_chunk(given))
    return misused(
        "a chunk of too many values: steps, joints and fields multiplied are more than 20480; leave out what "
        "the robot file's gains say, or lower policy.steps");
  // The executive refuses and names such a chunk; what must not happen is that it stays in the policy's memory.
  const std::span<const float> values(chunk_.values, chunk_.value_count());
  forget_ = forget_ || !std::ranges::all_of(values, [](float value) { return std::isfinite(value); });
  sentence_.clear();
  if (assumption != nullptr) {
    chunk_.header.observation_id = view_.id;
    alternatives_.keep(chunk_, oldest_sensed_at(), *assumption);
    return TAKT_OK;
  }
  send({view_.outside_sensed_ns}, infer_started_at_, infer_ended_at_);
  if (evidence_) executive_->publish_input(evidence_->answer(chunk_.header.sequence));
  return TAKT_OK;
}

}  // namespace takt::client

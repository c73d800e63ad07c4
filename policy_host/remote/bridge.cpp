// SPDX-License-Identifier: Apache-2.0
#include "policy_host/remote/bridge.hpp"

#include <fmt/format.h>
#include <spdlog/spdlog.h>

#include <algorithm>
#include <cmath>
#include <cstring>
#include <span>
#include <utility>

#include "config/paths.hpp"
#include "executive/contract/image_sample.hpp"
#include "executive/contract/monotonic_clock.hpp"
#include "policy_host/pacing.hpp"
#include "policy_host/remote/wire_messages.hpp"

namespace takt::policy_host::remote {
namespace {

constexpr char kProgram[] = "takt-policy-bridge";
// What is added to observations or to samples crosses as well: dds/policy_types.idl, send() and observation_of().
static_assert(sizeof(Observation) == 64 + 5 * sizeof(Positions) + sizeof(ImuSample));
static_assert(kMaxJoints == 64 && kMaxSensorValues == 256);
constexpr Duration kAttachRetry = milliseconds(200);
constexpr Duration kLongestWait = milliseconds(100);  // it may be told to end meanwhile
constexpr Duration kBridgeReportPeriod = seconds(10);

GateFacts facts_of(const config::RobotConfig& robot, std::uint64_t policy_hash) {
  return {.config_hash = robot.hash,
          .policy_hash = policy_hash,
          .step_count = robot.policy->steps,
          .joint_count = static_cast<std::uint32_t>(robot.joints.size()),
          .step_period = robot.policy->step_period,
          .max_age = robot.freshness.max_age};
}

}  // namespace

Bridge::Bridge(const config::RobotConfig& robot, const std::string& runtime_directory, std::uint64_t policy_hash,
               dds::Domain domain)
    : robot_(robot),
      socket_(config::executive_socket(runtime_directory)),
      hello_(hello_of(robot, policy_hash, Role::policy, kProgram)),
      domain_(std::move(domain)),
      in_use_(sensors_in_use(robot)),
      samples_(robot.sensors.size()),
      used_(robot.sensors.size()),
      gate_(facts_of(robot, policy_hash)),
      choice_(robot.policy->period * 3, Duration{robot.freshness.max_age.ns / 2}),
      probe_(robot.dds->interface) {
  for (const std::size_t sensor : in_use_) {
    const config::Sensor& declared = robot.sensors[sensor];
    sources_.push_back({.sensor = sensor,
                        .link = {config::sensor_socket(runtime_directory, declared.name),
                                 hello_of(robot, policy_hash, Role::sensor_reader, kProgram), mailbox_of(declared)},
                        .payload = std::vector<std::byte>(image_bytes(declared)),
                        .sequence = 0,
                        .sent_sequence = 0,
                        .sent_sensed_at = {}});
  }
}

std::expected<std::unique_ptr<Bridge>, std::string> Bridge::open(const config::RobotConfig& robot,
                                                                 const std::string& runtime_directory,
                                                                 std::uint64_t policy_hash) {
  auto domain = dds::Domain::open(robot, std::string(kProgram) + " " + robot.robot);
  if (!domain) return std::unexpected(domain.error());
  auto bridge = std::unique_ptr<Bridge>(new Bridge(robot, runtime_directory, policy_hash, std::move(*domain)));
  if (auto opened = bridge->open_endpoints(); !opened) return std::unexpected(opened.error());
  return bridge;
}

std::expected<void, std::string> Bridge::open_endpoints() {
  const auto observations = make_writer(domain_, robot_, Topic::observation);
  if (!observations) return std::unexpected(observations.error());
  const auto samples = make_writer(domain_, robot_, Topic::sample);
  if (!samples) return std::unexpected(samples.error());
  const auto commands = make_reader(domain_, robot_, Topic::command);
  if (!commands) return std::unexpected(commands.error());
  const auto status = make_reader(domain_, robot_, Topic::status);
  if (!status) return std::unexpected(status.error());
  status_ = *status;
  observations_ = *observations;
  samples_writer_ = *samples;
  commands_ = *commands;
  wait_set_ = dds_create_waitset(domain_.participant());
  dds_waitset_attach(wait_set_, dds_create_readcondition(commands_, DDS_ANY_STATE), 0);
  return {};
}

void Bridge::run(const std::atomic<bool>& stop) {
  reported_ = monotonic_now();
  while (!stop) {
    const MonoTime now = monotonic_now();
    if (!executive_ && now >= next_attempt_) attach(now);
    const MonoTime due =
        executive_ ? next_look(now, observed_, robot_.policy->period, looked_since_due_) : next_attempt_;
    const Duration patience = std::clamp(due - now, Duration{}, kLongestWait);
    if (patience > Duration{}) dds_waitset_wait(wait_set_, nullptr, 0, patience.ns);
    take_answers();
    if (executive_ && monotonic_now() >= due) look(monotonic_now());
    state_problem(monotonic_now());
    report(monotonic_now());
  }
}

void Bridge::attach(MonoTime now) {
  next_attempt_ = now + kAttachRetry;
  auto link = ExecutiveLink::attach(socket_, hello_);
  if (!link) {
    no_executive_.say(now, "waiting for the executive: " + link.error());
    return;
  }
  executive_.emplace(std::move(*link));
  gate_.begin(drawn_number());
  for (Source& source : sources_) source.sequence = source.sent_sequence = 0;
  observed_ = {};
  played_at_ = now;
  source_of_session_ = {};
  no_executive_.clear();
  spdlog::info("attached to {}", socket_);
}

void Bridge::look(MonoTime now) {
  Observation observation;
  if (executive_->read(observation)) {
    looked_since_due_ = false;
    observed_ = observation.published_at;
    show(observation, now);
    return;
  }
  looked_since_due_ = true;
  if (!executive_->is_over()) return;
  spdlog::warn("the executive ended the session");
  executive_.reset();
  gate_.begin(0);
}

void Bridge::update(Source& source, MonoTime now) {
  SensorSample& sample = samples_[source.sensor];
  if (source.payload.empty()) return source.link.update(now, sample);
  source.link.update(now, sample, source.payload);
}

void Bridge::show(const Observation& observation, MonoTime dequeued_at) {
  for (Source& source : sources_) update(source, dequeued_at);
  std::string reason = take_usable(robot_, in_use_, samples_, monotonic_now(), used_);
  lacks_ = reason;
  if (!reason.empty()) {
    for (const Source& source : sources_)
      if (!source.link.problem().empty()) reason += "; " + source.link.problem();
    lacks_ = reason;
    no_sensor_.say(dequeued_at, "no observation is passed on: " + reason);
    return;
  }
  no_sensor_.clear();
  Shown shown{observation.id, observation.published_at, dequeued_at, {}, observation.oldest_sensed_at};
  for (Source& source : sources_) {
    const MonoTime sensed = used_[source.sensor].sensed_at;
    if (!shown.outside_sensed_at.is_set() || sensed < shown.outside_sensed_at) shown.outside_sensed_at = sensed;
    // A sample that could not be sent now: the next observation will bring it.
    if (used_[source.sensor].sequence != kAbsentSequence && !send_sample(source)) return;
  }
  gate_.show(shown);
  send(observation, shown);
}

bool Bridge::send_sample(Source& source) {
  const SensorSample& sample = used_[source.sensor];
  if (source.sequence != 0 && sample.sequence == source.sent_sequence && sample.sensed_at == source.sent_sensed_at)
    return true;
  takt_remote_Sample message{};
  message.sensor = static_cast<std::uint32_t>(source.sensor);
  message.epoch = gate_.epoch();
  message.number = source.sequence + 1;
  if (source.payload.empty()) {
    refer(message.values, sample.values, robot_.sensors[source.sensor].values);
  } else {
    const auto image = std::span(source.payload).subspan(sizeof(ImageHeader));
    refer(message.image, reinterpret_cast<const std::uint8_t*>(image.data()), image.size());
  }
  if (dds_write(samples_writer_, &message) != DDS_RETCODE_OK) return false;
  ++source.sequence;
  source.sent_sequence = sample.sequence;
  source.sent_sensed_at = sample.sensed_at;
  return true;
}

void Bridge::send(const Observation& observation, const Shown& shown) {
  const MonoTime now = monotonic_now();
  const AnswerGate::Followed following = gate_.followed(observation);
  std::vector<takt_remote_SampleReference> references;
  for (const Source& source : sources_)
    if (used_[source.sensor].sequence != kAbsentSequence)
      references.push_back(
          {static_cast<std::uint32_t>(source.sensor), source.sequence, (now - used_[source.sensor].sensed_at).ns});
  std::array<float, kImuValues> imu{};
  std::copy_n(observation.imu.rotation, 4, imu.begin());
  std::copy_n(observation.imu.angular_velocity, 3, imu.begin() + 4);
  std::copy_n(observation.imu.acceleration, 3, imu.begin() + 7);
  const bool has_imu = observation.imu.sequence != 0;
  takt_remote_Observation message{};
  message.epoch = gate_.epoch();
  message.config_hash = robot_.hash;
  message.policy_hash = hello_.policy_hash;
  message.id = shown.id;
  message.tick = observation.tick;
  message.age_ns = (now - shown.published_at).ns;
  message.oldest_age_ns = (now - observation.oldest_sensed_at).ns;
  message.period_ns = observation.period.ns;
  message.mode = observation.mode;
  message.following_server = following.chunk.server;
  message.following_number = following.chunk.sequence;
  message.committed_from = following.committed_from;
  message.committed_count = following.committed_count;
  const std::size_t joints = std::min<std::size_t>(observation.joint_count, kMaxJoints);
  refer(message.q, observation.q.at.data(), joints);
  refer(message.dq, observation.dq.at.data(), joints);
  refer(message.tau, observation.tau.at.data(), joints);
  refer(message.q_setpoint, observation.q_setpoint.at.data(), joints);
  refer(message.dq_of_drive, observation.dq_of_drive.at.data(), joints);
  message.imu_sequence = observation.imu.sequence;
  message.imu_age_ns = has_imu ? (now - observation.imu.sensed_at).ns : 0;
  refer(message.imu, imu.data(), has_imu ? imu.size() : 0);
  refer(message.samples, references.data(), references.size());
  if (dds_write(observations_, &message) == DDS_RETCODE_OK) ++shown_;
}

void Bridge::take_answers() {
  take_all<takt_remote_Command>(
      commands_, [this](const takt_remote_Command& message, const PeerId& sender) { take(message, sender); });
  take_all<takt_remote_ServerStatus>(
      status_, [this](const takt_remote_ServerStatus& message, const PeerId& sender) { take(message, sender); });
}

void Bridge::take(const takt_remote_Command& message, const PeerId& sender) {
  if (!executive_) return;
  const MonoTime now = monotonic_now();
  const Answer answer = answer_of(message, sender);
  const std::span values(message.values._buffer, message.values._length);
  const bool finite = std::ranges::all_of(values, [](float value) { return std::isfinite(value); });
  const AnswerVerdict verdict = gate_.judge(answer, finite, now);
  ++verdicts_[static_cast<std::size_t>(verdict)];
  if (verdict != AnswerVerdict::usable) return silence_.refused(verdict);
  const std::uint64_t changes = choice_.changes();
  if (!choice_.take(sender, now)) return;
  if (choice_.changes() != changes) {
    const std::string name = server_name_of(message);
    if (leader_name_.empty())
      spdlog::info("policy server {} answers ({})", name, text_of(sender));
    else
      spdlog::warn("policy server {} is silent: {} takes over ({})", leader_name_, name, text_of(sender));
    leader_name_ = name;
  }
  const std::string source = source_of(message);
  if (sender != source_of_session_.server || source != source_of_session_.said) {
    executive_->state_source(fmt::format("policy server {} ({}){}{}", server_name_of(message), text_of(sender),
                                         source.empty() ? "" : ": ", source),
                             gate_.next_sequence());
    source_of_session_ = {sender, source};
  }
  chunk_.header = gate_.play(answer, now);
  std::ranges::copy(values, chunk_.values);
  executive_->publish(chunk_);
  ++played_;
  played_at_ = now;
  silence_.played();
  longest_answer_ = std::max(longest_answer_, now - chunk_.header.dequeued_at);
}

void Bridge::take(const takt_remote_ServerStatus& message, const PeerId& sender) {
  silence_.heard(state_of(message, sender, monotonic_now()));
}

// Before the robot is stopped for want of commands the reason is there.
void Bridge::state_problem(MonoTime now) {
  if (!executive_) return;
  const PeerId& leader = choice_.leader();
  if (leader.is_known()) probe_.aim(silence_.address_of(leader));
  const bool is_missed = now - played_at_ > Duration{robot_.freshness.max_age.ns / 2};
  probe_.ask(now, is_missed ? played_at_ : MonoTime{});
  std::string reason = lacks_;
  if (reason.empty() && now - played_at_ > Silence::patience(robot_.freshness.max_age)) {
    dds_publication_matched_status_t matched{};
    dds_get_publication_matched_status(observations_, &matched);
    reason = silence_.reason(leader, gate_.epoch(), matched.current_count, robot_.freshness.max_age, now,
                             probe_.verdict(played_at_));
  }
  executive_->state_problem(now, reason);
}

void Bridge::report(MonoTime now) {
  if (now - reported_ < kBridgeReportPeriod) return;
  reported_ = now;
  dds_publication_matched_status_t matched{};
  dds_get_publication_matched_status(observations_, &matched);
  dds_requested_deadline_missed_status_t silent{};
  dds_get_requested_deadline_missed_status(commands_, &silent);
  std::string refused;
  for (std::size_t i = 1; i < kAnswerVerdictCount; ++i)
    if (verdicts_[i] != 0)
      refused += fmt::format("{}{} {}", refused.empty() ? "; not played: " : ", ", verdicts_[i],
                             name(static_cast<AnswerVerdict>(i)));
  if (silent.total_count_change > 0)
    refused += fmt::format("; {} times a server was silent for max_age", silent.total_count_change);
  spdlog::info("{} servers listen; {} observations sent, {} answers played of {}, at most {:.1f} ms after{}",
               matched.current_count, shown_, played_, verdicts_[0], longest_answer_.milliseconds(), refused);
  shown_ = played_ = 0;
  longest_answer_ = {};
  verdicts_ = {};
}

}  // namespace takt::policy_host::remote

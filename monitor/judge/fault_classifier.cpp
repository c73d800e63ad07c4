// SPDX-License-Identifier: Apache-2.0
#include "monitor/judge/fault_classifier.hpp"

#include <algorithm>
#include <cstring>
#include <numeric>

namespace takt::monitor {
namespace {

constexpr Duration kQuiet = milliseconds(100);       // ends a stretch of trouble
constexpr Duration kAftermath = milliseconds(1000);  // the same, of wrong samples: what comes of them comes later
constexpr Duration kPatience = milliseconds(1000);   // for the command that may explain it
constexpr std::size_t kRememberedObservations = 4096;
constexpr std::size_t kEnoughCommands = 20;
constexpr int kOldPeriods = 5;  // feedback of a joint that was not heard for so many is old

bool relied_on_policy(Mode mode) {
  return mode == Mode::tracking || mode == Mode::degraded;
}

bool is_about(Cause cause, About whom) {
  const auto index = static_cast<std::size_t>(cause);
  return index < kCauseFacts.size() && kCauseFacts[index].about == whom;
}

// Refused for what it says or when it was numbered, not for its age.
bool is_refused_for_content(Arrival arrival) {
  switch (arrival) {
    case Arrival::corrupt:
    case Arrival::wrong_shape:
    case Arrival::wrong_policy:
    case Arrival::repeated_sequence:
    case Arrival::unknown_observation:
    case Arrival::future_observation:
    case Arrival::not_finite:
    case Arrival::out_of_range:
    case Arrival::missing_stamp:
      return true;
    case Arrival::none:
    case Arrival::accepted:
    case Arrival::contended:
    case Arrival::expired_observation:
    case Arrival::overtaken:
      return false;
  }
  return false;
}

bool enters_trouble(const TickRecordHeader& header) {
  if (header.mode == header.previous_mode || is_about(header.cause, About::person)) return false;
  return header.mode == Mode::degraded || header.mode == Mode::damped_stop || header.mode == Mode::fault_latched;
}

std::array<Duration, 4> array_of(const AgeParts& parts) {
  return {parts.sense, parts.queue, parts.infer, parts.publish};
}

void merge_neighbours(std::vector<FaultEvidence>& segments) {
  std::size_t kept = 0;
  for (std::size_t at = 0; at < segments.size(); at += 2, ++kept) {
    FaultEvidence merged = std::move(segments[at]);
    if (at + 1 < segments.size()) merged.take(segments[at + 1]);
    segments[kept] = std::move(merged);
  }
  segments.resize(kept);
}

Duration median(std::vector<std::int64_t> samples) {
  if (samples.empty()) return {};
  const auto middle = samples.begin() + static_cast<std::ptrdiff_t>(samples.size() / 2);
  std::nth_element(samples.begin(), middle, samples.end());
  return {*middle};
}

}  // namespace

FaultRules fault_rules_of(const config::RobotConfig& robot) {
  FaultRules rules{.max_age = robot.freshness.max_age,
                   .period = robot.control.period,
                   .joints = {},
                   .content = watched_content_of(robot)};
  for (const auto& joint : robot.joints) rules.joints.push_back(joint.name);
  return rules;
}

std::uint64_t FaultSummary::total() const {
  return std::accumulate(counts.begin(), counts.end(), std::uint64_t{0});
}

double FaultSummary::share(Fault fault) const {
  std::uint64_t all = 0;
  for (const FaultCost& cost : costs) all += cost.troubled_ticks;
  if (all == 0) return 0;
  return static_cast<double>(costs[static_cast<std::size_t>(fault)].troubled_ticks) / static_cast<double>(all);
}

void FaultEvidence::take(const FaultClue& clue) {
  const bool was_stopped = gravity == Gravity::stopped;  // no command counts any more
  if (clue.is_trouble) {
    last_tick = clue.tick;
    last_trouble = clue.now;
    gravity = std::max(gravity, clue.gravity);
  }
  if (at.is_set()) {
    ++troubled_ticks;
  } else if (clue.is_trouble) {
    at = clue.now;
    first_tick = clue.tick;
    ++troubled_ticks;
  }
  troubled_ticks += at.is_set() ? clue.skipped : 0;
  missed_ticks += clue.is_miss ? 1 : 0;
  clamped_ticks += clue.target_clamped ? 1 : 0;
  has_miss = has_miss || clue.is_miss || clue.arrival == Arrival::expired_observation;
  worst_lateness = std::max(worst_lateness, clue.lateness);
  skipped += clue.skipped;
  slept_ms = std::max(slept_ms, clue.slept_ms);
  if (clue.overrun != OverrunCause::none && overruns++ == 0) overrun = clue.overrun;
  if (is_refused_for_content(clue.arrival)) ++refusals[clue.arrival];
  ran_backwards += clue.ran_backwards;
  if (clue.command_parts) {
    const auto parts = array_of(*clue.command_parts);
    for (std::size_t part = 0; part < parts.size(); ++part)
      worst_parts[part] = std::max(worst_parts[part], parts[part]);
  }
  if (clue.command_before.is_set() && !was_stopped) silence = std::max(silence, clue.now - clue.command_before);
  command_came = command_came || clue.arrival != Arrival::none;
  if (clue.feedback_age > feedback_age) {
    feedback_age = clue.feedback_age;
    feedback_joint = clue.feedback_joint;
  }
  old_ticks += clue.is_old ? 1 : 0;
  old_replied_ticks += clue.is_old_and_replied ? 1 : 0;
  content.take(clue.content);
  replies += clue.replies;
  replies_due += clue.replies_due;
  bus_was_bad = bus_was_bad || clue.bus_is_bad;
  bad_commands = bad_commands || clue.cause == Cause::bad_commands;
  imu_lost = imu_lost || clue.cause == Cause::imu_lost;
  other_session = other_session || clue.is_other_session;
  if (is_about(clue.cause, About::hardware) && fault_cause == Cause::none) fault_cause = clue.cause;
}

void FaultEvidence::take(const FaultEvidence& other) {
  if (other.at.is_set() && (!at.is_set() || other.at < at)) {
    at = other.at;
    first_tick = other.first_tick;
  }
  last_tick = std::max(last_tick, other.last_tick);
  last_trouble = std::max(last_trouble, other.last_trouble);
  troubled_ticks += other.troubled_ticks;
  has_miss = has_miss || other.has_miss;
  command_came = command_came || other.command_came;
  gravity = std::max(gravity, other.gravity);
  for (std::size_t part = 0; part < worst_parts.size(); ++part)
    worst_parts[part] = std::max(worst_parts[part], other.worst_parts[part]);
  worst_lateness = std::max(worst_lateness, other.worst_lateness);
  if (overruns == 0) overrun = other.overrun;
  overruns += other.overruns;
  skipped += other.skipped;
  slept_ms = std::max(slept_ms, other.slept_ms);
  for (const auto& [arrival, count] : other.refusals) refusals[arrival] += count;
  ran_backwards += other.ran_backwards;
  if (other.feedback_age > feedback_age) {
    feedback_age = other.feedback_age;
    feedback_joint = other.feedback_joint;
  }
  old_ticks += other.old_ticks;
  old_replied_ticks += other.old_replied_ticks;
  content.take(other.content);
  replies += other.replies;
  replies_due += other.replies_due;
  bus_was_bad = bus_was_bad || other.bus_was_bad;
  if (fault_cause == Cause::none) fault_cause = other.fault_cause;
  bad_commands = bad_commands || other.bad_commands;
  imu_lost = imu_lost || other.imu_lost;
  other_session = other_session || other.other_session;
  missed_ticks += other.missed_ticks;
  clamped_ticks += other.clamped_ticks;
  silence = std::max(silence, other.silence);
  sense_before = std::max(sense_before, other.sense_before);
}

// What a tick cost is recorded in the next one, which belongs to the same segment therefore. A stop ends what could be
// told apart.
void FaultStretch::take(const FaultClue& clue) {
  whole.take(clue);
  if (has_ended_segment && clue.overrun == OverrunCause::none) {
    if (segments.size() == kMostSegments) merge_neighbours(segments);
    segments.emplace_back();
    segments.back().sense_before = sense;
    has_ended_segment = false;
  }
  segments.back().take(clue);
  if (!clue.command_parts) return;
  sense = clue.command_parts->sense;
  has_ended_segment = segments.back().gravity != Gravity::stopped;
}

void FaultClassifier::command(const CommandChunk& chunk) {
  command_ = chunk.header;
  content_.command(chunk.header, {chunk.values, chunk.value_count()});
}

void FaultClassifier::command(const RecordedCommand& command) {
  const auto header = policy_header_of(command);
  if (!header) return;
  command_ = *header;
  std::vector<float> values((command.payload.size() - sizeof *header) / sizeof(float));
  std::memcpy(values.data(), command.payload.data() + sizeof *header, values.size() * sizeof(float));
  content_.command(*header, values);
}

void FaultClassifier::input(const RecordedPolicyInput& recorded) {
  if (recorded.sender != Player::policy) return;
  const std::span<const float> values = recorded.input.sample_values;
  std::size_t at = 0;
  for (const PolicyInputSample& sample : recorded.input.samples) {
    const std::size_t count = std::min<std::size_t>(sample.value_count, values.size() - at);
    if (count != 0) content_.sample(sample.sensor, sample.sequence, sample.sensed_at, values.subspan(at, count));
    at += count;
  }
}

std::optional<AgeParts> FaultClassifier::parts_of_arrival(const TickRecordHeader& header) const {
  if (is_first_use(header)) {
    AgeParts parts = header.age;
    parts.hold = {};
    return parts;
  }
  if (!is_refused_for_age(header.seats[Seat::policy].arrival) || !command_) return {};
  const auto known = observations_.find(command_->observation_id);
  if (known == observations_.end()) return {};
  const Published& observation = known->second;
  MonoTime sensed = observation.oldest_feedback;
  if (command_->outside_sensed_at.is_set()) sensed = std::min(sensed, command_->outside_sensed_at);
  const MonoTime started = std::clamp(command_->infer_started_at, observation.at, std::max(observation.at, header.now));
  const MonoTime ended = std::clamp(command_->infer_ended_at, started, std::max(started, header.now));
  return AgeParts{.sense = observation.at - sensed,
                  .queue = started - observation.at,
                  .infer = ended - started,
                  .publish = header.now - ended,
                  .hold = {}};
}

void FaultClassifier::remember_observation(const TickRecord& record, MonoTime oldest_feedback) {
  if (record.header.observation_published == 0) return;
  observations_[record.header.observation_published] = {record.header.now, oldest_feedback};
  if (observations_.size() > kRememberedObservations) observations_.erase(observations_.begin());
}

FaultClue FaultClassifier::clue_of(const TickRecord& record) {
  const TickRecordHeader& header = record.header;
  FaultClue clue;
  clue.tick = header.tick;
  clue.now = header.now;
  clue.lateness = header.lateness;
  MonoTime oldest = header.now;
  bool oldest_replied = false;
  replies_before_.resize(header.joint_count);
  for (std::size_t joint = 0; joint < header.joint_count; ++joint) {
    const JointFeedback& feedback = record.joints[joint].feedback;
    const auto came = static_cast<std::uint8_t>(feedback.replies - replies_before_[joint]);
    if (feedback.received_at.is_set() && feedback.received_at < oldest) {
      oldest = feedback.received_at;
      clue.feedback_joint = joint;
      oldest_replied = came != 0;
    }
    clue.replies += came;
    clue.target_clamped |= (record.joints[joint].interventions & bit(Intervention::target_range)) != 0;
    replies_before_[joint] = feedback.replies;
  }
  clue.feedback_age = header.now - oldest;
  clue.is_old = clue.feedback_age > rules_.period * kOldPeriods;
  clue.is_old_and_replied = clue.is_old && oldest_replied;
  clue.replies_due = header.joint_count;
  if (before_) {
    clue.skipped = header.skipped_periods - before_->skipped_periods;
    clue.ran_backwards = header.integration_errors - before_->integration_errors;
    const std::uint8_t session_before = before_->seats[Seat::policy].session;
    clue.is_other_session = header.seats[Seat::policy].session != session_before && session_before != 0;
  } else {
    clue.replies = clue.replies_due;  // counters run since start, not since this tick
  }
  clue.slept_ms = header.slept_ms;
  clue.overrun = header.overrun_cause;
  clue.arrival = header.seats[Seat::policy].arrival;
  clue.command_parts = parts_of_arrival(header);
  for (std::size_t bus = 0; bus < header.bus_count; ++bus) {
    const BusState state = header.buses[bus].state;
    clue.bus_is_bad = clue.bus_is_bad || state == BusState::bus_off || state == BusState::down;
  }
  if (header.mode != header.previous_mode) clue.cause = header.cause;
  clue.command_before = last_command_;
  const bool relied = relied_on_policy(header.previous_mode);
  clue.target_clamped = clue.target_clamped && relied && header.player == Player::policy;
  const WrongContent content = content_.tick(record);
  if (relied) clue.content = content;
  clue.is_miss = relied && !is_usable(header.seats[Seat::policy].freshness);
  const bool refused = is_refused_for_age(header.seats[Seat::policy].arrival) ||
                       is_refused_for_content(header.seats[Seat::policy].arrival);
  const bool lost_period = clue.overrun != OverrunCause::none || clue.skipped != 0;
  const bool is_wrong = refused || clue.ran_backwards != 0 || clue.target_clamped || clue.content.is_trouble;
  clue.is_trouble = enters_trouble(header) || (relied && (clue.is_miss || is_wrong || lost_period));
  if (enters_trouble(header) && header.mode != Mode::degraded) {
    clue.gravity = Gravity::stopped;
  } else if (enters_trouble(header) || clue.is_miss || is_wrong) {
    clue.gravity = Gravity::missed;
  }
  remember_observation(record, oldest);
  return clue;
}

void FaultClassifier::note_baseline(const FaultClue& clue) {
  if (clue.command_parts && clue.arrival == Arrival::accepted) {
    const auto parts = array_of(*clue.command_parts);
    for (std::size_t part = 0; part < parts.size(); ++part) {
      all_parts_[part].push_back(parts[part].ns);
      if (!open_) calm_parts_[part].push_back(parts[part].ns);
    }
  }
  if (!open_) calm_feedback_.push_back(clue.feedback_age.ns);
}

void FaultClassifier::open(const FaultClue& clue) {
  FaultStretch& stretch = open_.emplace();
  for (const FaultClue& earlier : recent_) {
    stretch.whole.take(earlier);
    stretch.segments.back().take(earlier);
  }
  stretch.whole.command_came = false;  // one that came before explains nothing yet
  stretch.take(clue);
}

void FaultClassifier::follow(const FaultClue& clue) {
  if (!open_) {
    if (clue.is_trouble) open(clue);
    return;
  }
  open_->take(clue);
  const Duration quiet = clue.now - open_->whole.last_trouble;
  const bool is_over = quiet >= (met_wrong_sensing(open_->whole) ? kAftermath : kQuiet);
  if (is_over && (open_->whole.command_came || quiet >= kPatience)) {
    closed_.push_back(std::move(*open_));
    open_.reset();
    recent_.clear();
  }
}

// Until the robot relies on the policy again.
void FaultClassifier::note_standstill(const TickRecordHeader& header) {
  if (relied_on_policy(header.mode)) is_standing_ = false;
  if (!is_standing_) return;
  std::vector<FaultEvidence>& segments = (open_ ? *open_ : closed_.back()).segments;
  const auto stopped = std::find_if(segments.rbegin(), segments.rend(),
                                    [](const FaultEvidence& segment) { return segment.gravity == Gravity::stopped; });
  const bool counts_itself = open_ && stopped == segments.rbegin();
  if (stopped != segments.rend() && !counts_itself) ++stopped->troubled_ticks;
}

void FaultClassifier::tick(const TickRecord& record) {
  const FaultClue clue = clue_of(record);
  note_standstill(record.header);
  follow(clue);
  is_standing_ = is_standing_ || (clue.is_trouble && clue.gravity == Gravity::stopped);
  note_baseline(clue);
  if (!open_) recent_.push_back(clue);
  while (!recent_.empty() && clue.now - recent_.front().now > rules_.max_age) recent_.pop_front();
  if (clue.arrival != Arrival::none) last_command_ = clue.now;
  before_ = record.header;
  command_.reset();
}

FaultBaseline FaultClassifier::baseline() const {
  FaultBaseline baseline;
  const auto& parts = calm_parts_[0].size() >= kEnoughCommands ? calm_parts_ : all_parts_;
  for (std::size_t part = 0; part < parts.size(); ++part) baseline.parts[part] = median(parts[part]);
  baseline.feedback_age = median(calm_feedback_);
  return baseline;
}

FaultSummary FaultClassifier::finish() {
  if (open_) closed_.push_back(std::move(*open_));
  open_.reset();
  const FaultBaseline usual = baseline();
  FaultSummary summary;
  for (const FaultStretch& stretch : closed_) {
    for (FaultVerdict& verdict : judge(stretch, usual, rules_)) {
      ++summary.counts[static_cast<std::size_t>(verdict.fault)];
      FaultCost& cost = summary.costs[static_cast<std::size_t>(verdict.fault)];
      ++cost.stretches;
      cost.missed_ticks += verdict.missed_ticks;
      cost.troubled_ticks += verdict.troubled_ticks;
      cost.stops += verdict.gravity == Gravity::stopped ? 1 : 0;
      summary.verdicts.push_back(std::move(verdict));
    }
  }
  if (summary.verdicts.size() > kListedVerdicts) {
    summary.verdicts = by_gravity(std::move(summary.verdicts));
    summary.verdicts.resize(kListedVerdicts);
    std::ranges::sort(summary.verdicts, {}, &FaultVerdict::first_tick);
  }
  return summary;
}

std::vector<FaultVerdict> by_gravity(std::vector<FaultVerdict> verdicts) {
  std::ranges::stable_sort(verdicts, std::greater{}, &FaultVerdict::gravity);
  return verdicts;
}

std::expected<FaultSummary, std::string> classify_run(const RecordedRun& run) {
  FaultClassifier classifier(fault_rules_of(run.robot));
  const auto scan = scan_run(run, {.tick = [&](const RecordedTick& tick) { classifier.tick(tick.record); },
                                   .command = [&](const RecordedCommand& command) { classifier.command(command); },
                                   .keyframe = {},
                                   .loss = {},
                                   .policy_input = [&](const RecordedPolicyInput& input) { classifier.input(input); },
                                   .image = [&](const ShownImage& image) { classifier.image(image); }});
  if (!scan) return std::unexpected(scan.error());
  return classifier.finish();
}

}  // namespace takt::monitor

// SPDX-License-Identifier: Apache-2.0
#include "monitor/judge/metrics_collector.hpp"

#include <algorithm>
#include <limits>

#include "executive/contract/tick_facts.hpp"

namespace takt::monitor {
namespace {

// Older than any contract allows.
constexpr std::int64_t kMissed = std::numeric_limits<std::int64_t>::max();

using Samples = std::array<std::vector<std::int64_t>, kAgePartCount>;

std::array<std::int64_t, kAgePartCount> parts_of(const AgeParts& age) {
  return {age.sense.ns, age.queue.ns, age.infer.ns, age.publish.ns, age.hold.ns, age.total().ns};
}

template <std::size_t size, class Enum>
void count(std::array<std::uint64_t, size>& counts, Enum value) {
  if (const auto index = static_cast<std::size_t>(value); index < size) ++counts[index];
}

void add(Samples& samples, const AgeParts& age) {
  const auto parts = parts_of(age);
  for (std::size_t part = 0; part < kAgePartCount; ++part) samples[part].push_back(parts[part]);
}

}  // namespace

void MetricsCollector::tick(const TickRecord& record) {
  const TickRecordHeader& header = record.header;
  if (metrics_.ticks == 0) {
    metrics_.first_tick = header.tick;
    first_ = header;
  } else if (header.tick > last_.tick + 1) {
    const std::uint64_t gap = header.tick - last_.tick - 1;
    metrics_.missing_ticks += gap;
    if (last_.mode == Mode::standby && header.previous_mode == Mode::standby) standby_gaps_ += gap;
  }
  ++metrics_.ticks;
  lateness_.push_back(header.lateness.ns);
  work_.push_back(header.last_duration.ns);
  on_wire(header);
  count(metrics_.ticks_in_mode, header.mode);
  count(metrics_.ticks_of_player, header.player);
  if (header.player == Player::policy) ++metrics_.ticks_of_policy[header.command_policy];
  if (header.candidate.policy_hash != 0) candidate(header);
  count(metrics_.arrivals, header.seats[Seat::policy].arrival);
  count(metrics_.overruns, header.overrun_cause);
  for (std::size_t joint = 0; joint < header.joint_count; ++joint) interventions(record.joints[joint].interventions);
  if (header.mode != header.previous_mode) transition(header);
  if (header.operator_request == OperatorRequest::mark) mark(header);
  const bool relies = relies_on_policy(header);
  if (relies) relied(header);
  const bool has_fallback = header.seats[Seat::fallback].session != 0;  // attached once: arming waits for it
  if (relies && has_fallback && !is_usable(header.seats[Seat::fallback].freshness)) ++metrics_.ticks_without_fallback;
  last_ = header;
}

void MetricsCollector::loss(const Loss& loss) {
  if (loss.reason != kStoodBy)
    metrics_.losses[loss.ring + " " + loss.reason] += loss.count;
  else if (loss.ring == "tick")
    metrics_.stood_by_ticks += loss.count;
}

void MetricsCollector::finish(double epsilon, double confidence) {
  metrics_.missing_ticks -= std::min(standby_gaps_, metrics_.stood_by_ticks);
  if (metrics_.ticks == 0) return;
  metrics_.last_tick = last_.tick;
  metrics_.start = first_.now;
  metrics_.span = last_.now - first_.now;
  metrics_.last_mode = last_.mode;
  metrics_.skipped_periods = last_.skipped_periods - first_.skipped_periods;
  metrics_.integration_errors = last_.integration_errors - first_.integration_errors;
  for (std::size_t part = 0; part < kAgePartCount; ++part) {
    metrics_.age_per_tick[part] = quantiles_of(per_tick_[part]);
    metrics_.age_per_command[part] = quantiles_of(per_command_[part]);
  }
  metrics_.lateness = quantiles_of(lateness_);
  metrics_.work = quantiles_of(work_);
  for (std::size_t bus = 0; bus < kMaxBuses; ++bus) metrics_.tick_to_wire[bus] = quantiles_of(tick_to_wire_[bus]);
  metrics_.age_on_wire = quantiles_of(age_on_wire_);
  if (metrics_.candidate) {
    metrics_.candidate->age = quantiles_of(candidate_age_);
    metrics_.candidate->distance = quantiles_of(candidate_distance_);
  }
  metrics_.misses_per_tick = miss_rate(tick_misses_, metrics_.relied_ticks, epsilon, confidence);
  const auto missed = static_cast<std::uint64_t>(std::ranges::count(commands_, kMissed));
  metrics_.misses_per_command =
      miss_rate(missed, commands_.size(), effective_count(commands_, kMissed - 1), epsilon, confidence);
}

void MetricsCollector::on_wire(const TickRecordHeader& header) {
  const WireWatch::PerBus buses = wire_.take(header);
  for (std::size_t bus = 0; bus < buses.size(); ++bus) {
    if (!buses[bus]) continue;
    tick_to_wire_[bus].push_back(buses[bus]->since_tick.ns);
    if (buses[bus]->age) age_on_wire_.push_back(buses[bus]->age->ns);
  }
}

void MetricsCollector::interventions(InterventionMask mask) {
  for (std::size_t index = 0; mask != 0 && index < kInterventionCount; ++index) {
    if ((mask & (1U << index)) != 0) ++metrics_.interventions[index];
  }
}

void MetricsCollector::transition(const TickRecordHeader& header) {
  ++metrics_.transition_count;
  if (metrics_.transitions.size() < kListedTransitions) {
    metrics_.transitions.push_back({header.tick, header.now, header.previous_mode, header.mode, header.cause});
  }
}

void MetricsCollector::mark(const TickRecordHeader& header) {
  ++metrics_.mark_count;
  if (metrics_.marks.size() < kListedMarks) metrics_.marks.push_back({header.tick, header.now});
}

void MetricsCollector::candidate(const TickRecordHeader& header) {
  const CandidateRecord& record = header.candidate;
  if (record.change != PolicyChange::none) {
    ++metrics_.policy_change_count;
    if (metrics_.policy_changes.size() < kListedPolicyChanges)
      metrics_.policy_changes.push_back(
          {header.tick, header.now, record.change, record.in_charge != 0, record.policy_hash});
  }
  if (!metrics_.candidate) metrics_.candidate.emplace();
  CandidateMetrics& metrics = *metrics_.candidate;
  const SeatRecord& seat = header.seats[Seat::candidate];
  count(metrics.arrivals, seat.arrival);
  if (header.mode != Mode::tracking) return;
  ++metrics.ticks;
  if (!is_usable(seat.freshness)) return;
  ++metrics.fresh_ticks;
  if (record.beyond_range != 0) ++metrics.ticks_beyond_range;
  if (record.beyond_limits != 0) ++metrics.ticks_beyond_limits;
  candidate_age_.push_back(seat.age.ns);
  if (header.player == Player::policy)
    candidate_distance_.push_back(static_cast<std::int64_t>(static_cast<double>(record.distance) * 1e9));
}

void MetricsCollector::relied(const TickRecordHeader& header) {
  ++metrics_.relied_ticks;
  if (!is_usable(header.seats[Seat::policy].freshness)) ++tick_misses_;
  if (header.seats[Seat::policy].freshness != Freshness::missing) add(per_tick_, header.age);
  if (is_first_use(header)) add(per_command_, header.age);
  command(header);
}

void MetricsCollector::command(const TickRecordHeader& header) {
  const std::pair in_use{header.seats[Seat::policy].session, header.seats[Seat::policy].command_sequence};
  if (header.seats[Seat::policy].command_sequence != 0) {
    if (in_use != in_use_) {
      in_use_ = in_use;
      in_use_at_ = commands_.size();
      commands_.push_back(header.age.total().ns);
    }
    if (!is_usable(header.seats[Seat::policy].freshness)) commands_[in_use_at_] = kMissed;
  }
  if (header.seats[Seat::policy].arrival == Arrival::expired_observation) commands_.push_back(kMissed);
}

}  // namespace takt::monitor

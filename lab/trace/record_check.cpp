// SPDX-License-Identifier: Apache-2.0
#include "lab/trace/record_check.hpp"

#include <algorithm>
#include <cstdlib>
#include <unordered_map>

namespace takt::lab {
namespace {

const TickFacts* record_of(const std::vector<TickFacts>& records, std::uint64_t tick) {
  const auto found = std::ranges::lower_bound(records, tick, {}, &TickFacts::tick);
  return found != records.end() && found->tick == tick ? &*found : nullptr;
}

class Comparison {
 public:
  explicit Comparison(RecordCheck& check) : check_(check) {}

  void age(std::uint64_t tick, std::string_view what, Duration traced, Duration recorded) {
    const Duration difference{std::abs((traced - recorded).ns)};
    check_.largest = std::max(check_.largest, difference);
    if (difference > kAgreement) note({tick, what, traced.ns, recorded.ns});
  }
  void parts(std::uint64_t tick, const AgeParts& traced, const AgeParts& recorded) {
    age(tick, "sense", traced.sense, recorded.sense);
    age(tick, "queue", traced.queue, recorded.queue);
    age(tick, "infer", traced.infer, recorded.infer);
    age(tick, "publish", traced.publish, recorded.publish);
    age(tick, "hold", traced.hold, recorded.hold);
  }
  void equal(std::uint64_t tick, std::string_view what, std::uint64_t traced, std::uint64_t recorded) {
    if (traced != recorded) note({tick, what, static_cast<std::int64_t>(traced), static_cast<std::int64_t>(recorded)});
  }

 private:
  void note(const Disagreement& disagreement) {
    ++check_.disagreement_count;
    if (check_.disagreements.size() < RecordCheck::kListed) check_.disagreements.push_back(disagreement);
  }
  RecordCheck& check_;
};

// The parts at first use, from the trace's instants, with claims limited as the executive limits them.
AgeParts parts_of(const CommandChain& chain) {
  const MonoTime from = std::clamp(chain.inferred_from, chain.observed, chain.consumed);
  const MonoTime to = std::clamp(chain.inferred_to, from, chain.consumed);
  return {chain.observed - chain.sensed, from - chain.observed, to - from, chain.consumed - to, {}};
}

void check_commands(const Chains& chains, const std::vector<TickFacts>& records, Comparison& compare,
                    RecordCheck& check) {
  for (const CommandChain& chain : chains.accepted) {
    const TickFacts* const record = record_of(records, chain.tick);
    if (record == nullptr || record->sequence != chain.sequence) continue;  // unrecorded, or told by check_ticks
    compare.parts(chain.tick, chain.told, record->age);
    if (!chain.is_whole()) continue;
    compare.parts(chain.tick, parts_of(chain), record->age);
    ++check.commands;
  }
}

// The chain of the command that a tick has in use; sequences begin anew with another policy, so the latest one counts.
class InUse {
 public:
  explicit InUse(const Chains& chains) : chains_(chains) {}
  // For ascending ticks.
  const CommandChain* at(const TracedTick& tick) {
    while (next_ < chains_.accepted.size() && chains_.accepted[next_].tick <= tick.tick) ++next_;
    if (next_ == 0) return nullptr;
    const CommandChain& latest = chains_.accepted[next_ - 1];
    return latest.sequence == tick.sequence ? &latest : nullptr;
  }

 private:
  const Chains& chains_;
  std::size_t next_ = 0;
};

bool is_derivable(const CommandChain* chain, const TracedTick& tick) {
  // Without the answer's events it is unknown whether an outside sensor made the command older.
  return chain != nullptr && chain->sensed.is_set() && chain->host_pid != 0 && tick.now.is_set();
}

void check_tick(const TracedTick& tick, const TickFacts& record, const CommandChain* chain, Comparison& compare,
                RecordCheck& check) {
  ++check.ticks;
  if (tick.now.is_set()) compare.age(tick.tick, "now", Duration{tick.now.ns}, Duration{record.now.ns});
  if (!tick.end_at.is_set()) return;
  compare.age(tick.tick, "age", tick.age, record.age.total());
  compare.equal(tick.tick, "sequence", tick.sequence, record.sequence);
  compare.equal(tick.tick, "mode", tick.mode, static_cast<std::uint64_t>(record.mode));
  compare.equal(tick.tick, "freshness", tick.freshness, static_cast<std::uint64_t>(record.freshness));
  if (tick.sequence == 0 || record.freshness == Freshness::missing) return;
  if (!is_derivable(chain, tick)) {
    ++check.underivable;
    return;
  }
  ++check.ages;
  compare.age(tick.tick, "age", tick.now - chain->sensed, record.age.total());
}

Duration median_delay(const std::vector<TracedTick>& ticks) {
  std::vector<Duration> delays;
  for (const TracedTick& tick : ticks) {
    if (tick.now.is_set()) delays.push_back(tick.begin_at - tick.now);
  }
  if (delays.empty()) return {};
  const auto middle = delays.begin() + static_cast<std::ptrdiff_t>(delays.size() / 2);
  std::ranges::nth_element(delays, middle);
  return *middle;
}

}  // namespace

RecordCheck check_records(const TracedExecutive& executive, const Chains& chains,
                          const std::vector<TickFacts>& records) {
  RecordCheck check;
  Comparison compare(check);
  InUse in_use(chains);
  for (const TracedTick& tick : executive.ticks) {
    const CommandChain* const chain = in_use.at(tick);
    if (const TickFacts* const record = record_of(records, tick.tick))
      check_tick(tick, *record, chain, compare, check);
    else
      ++check.unrecorded;
  }
  check_commands(chains, records, compare, check);
  check.tracer_delay = median_delay(executive.ticks);
  return check;
}

std::expected<std::int64_t, std::string> executive_of(const Timeline& timeline, const std::vector<TickFacts>& records) {
  for (const auto& [pid, executive] : timeline.executives) {
    for (const TracedTick& tick : executive.ticks) {
      const TickFacts* const record = tick.now.is_set() ? record_of(records, tick.tick) : nullptr;
      if (record != nullptr && record->now == tick.now) return pid;
    }
  }
  return std::unexpected(
      "no tick of the trace is in this run: they are not of the same session, or do not overlap in time");
}

}  // namespace takt::lab

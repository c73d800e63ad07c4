// SPDX-License-Identifier: Apache-2.0
#include "lab/trace/review.hpp"

#include <fmt/format.h>

#include <algorithm>

#include "lab/trace/command_context.hpp"

namespace takt::lab {
namespace {

std::expected<std::int64_t, std::string> only_executive(const Timeline& timeline) {
  if (timeline.executives.size() == 1) return timeline.executives.begin()->first;
  if (timeline.executives.empty()) return std::unexpected("no tick of an executive is in the trace");
  std::string pids;
  for (const auto& [pid, executive] : timeline.executives)
    pids += fmt::format("{}{} ({} ticks)", pids.empty() ? "" : ", ", pid, executive.ticks.size());
  return std::unexpected(fmt::format("executives {} are in the trace; say whose with --run RUN_FOLDER", pids));
}

Duration period_of(const std::vector<TracedTick>& ticks) {
  std::vector<Duration> distances;
  for (std::size_t i = 1; i < ticks.size(); ++i) {
    const bool follows = ticks[i].tick == ticks[i - 1].tick + 1;
    if (follows && ticks[i].now.is_set() && ticks[i - 1].now.is_set())
      distances.push_back((ticks[i].now - ticks[i].lateness) - (ticks[i - 1].now - ticks[i - 1].lateness));
  }
  if (distances.empty()) return {};
  const auto middle = distances.begin() + static_cast<std::ptrdiff_t>(distances.size() / 2);
  std::ranges::nth_element(distances, middle);
  return *middle;
}

monitor::Quantiles stage_quantiles(const std::vector<CommandChain>& chains, Stage stage) {
  std::vector<std::int64_t> samples;
  for (const CommandChain& chain : chains) {
    if (const auto spent = stage_of(chain, stage)) samples.push_back(spent->ns);
  }
  return monitor::quantiles_of(samples);
}

monitor::Quantiles span_quantiles(const std::vector<TracedSpan>& spans) {
  std::vector<std::int64_t> samples;
  for (const TracedSpan& span : spans) {
    if (span.begin_at.is_set() && span.end_at.is_set()) samples.push_back((span.end_at - span.begin_at).ns);
  }
  return monitor::quantiles_of(samples);
}

void review_ticks(const std::vector<TracedTick>& ticks, TraceReview& review) {
  std::vector<std::int64_t> lateness, work;
  for (std::size_t i = 0; i < ticks.size(); ++i) {
    const TracedTick& tick = ticks[i];
    if (tick.now.is_set()) lateness.push_back(tick.lateness.ns);
    if (tick.begin_at.is_set() && tick.end_at.is_set()) work.push_back((tick.end_at - tick.begin_at).ns);
    if (is_late(tick, review.period)) ++review.late_wakeups;
    if (i != 0) review.skipped_periods += skipped_between(ticks[i - 1], tick, review.period);
  }
  review.ticks = ticks.size();
  review.lateness = monitor::quantiles_of(lateness);
  review.tick_work = monitor::quantiles_of(work);
}

Stage longest_stage(const CommandChain& chain) {
  Stage longest = Stage::sense;
  Duration most{-1};
  for (std::size_t i = 0; i < static_cast<std::size_t>(Stage::total); ++i) {
    const auto spent = stage_of(chain, static_cast<Stage>(i));
    if (!spent || *spent <= most) continue;
    most = *spent;
    longest = static_cast<Stage>(i);
  }
  return longest;
}

// What a chain without observation took is unknown: it ranks last.
std::int64_t total_ns(const CommandChain& chain) {
  const auto total = stage_of(chain, Stage::total);
  return total ? total->ns : -1;
}

std::vector<WorstCommand> worst_of(const TraceReview& review, const TracedExecutive& executive,
                                   const std::vector<TickFacts>* records) {
  std::vector<CommandChain> chains = review.chains.accepted;
  const std::size_t count = std::min(chains.size(), kWorstCommands);
  std::ranges::partial_sort(chains, chains.begin() + static_cast<std::ptrdiff_t>(count), std::ranges::greater{},
                            total_ns);
  chains.resize(count);
  std::vector<WorstCommand> worst;
  for (const CommandChain& chain : chains) {
    if (total_ns(chain) >= 0)
      worst.push_back({chain, longest_stage(chain), context_of(chain, executive, review.period, records)});
  }
  return worst;
}

}  // namespace

std::expected<TraceReview, std::string> review_trace(const Timeline& timeline, const std::vector<TickFacts>* records) {
  const auto pid = records != nullptr ? executive_of(timeline, *records) : only_executive(timeline);
  if (!pid) return std::unexpected(pid.error());
  const TracedExecutive& executive = timeline.executives.at(*pid);
  TraceReview review;
  review.executive_pid = *pid;
  review.chains = chains_of(timeline, *pid);
  review.period = period_of(executive.ticks);
  for (std::size_t stage = 0; stage < review.stages.size(); ++stage)
    review.stages[stage] = stage_quantiles(review.chains.accepted, static_cast<Stage>(stage));
  review_ticks(executive.ticks, review);
  review.looks = span_quantiles(timeline.dequeues);
  review.drains = span_quantiles(timeline.drains);
  review.worst = worst_of(review, executive, records);
  if (records != nullptr) review.records = check_records(executive, review.chains, *records);
  return review;
}

}  // namespace takt::lab

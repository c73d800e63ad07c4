// SPDX-License-Identifier: Apache-2.0
// What `takt trace review` finds out about one executive's part of a trace: latency of every stage, the commands that
// took longest and what happened meanwhile, and whether trace and records agree. Pure; review_text and to_json show it.
#pragma once

#include <array>
#include <cstdint>
#include <expected>
#include <nlohmann/json.hpp>
#include <optional>
#include <string>
#include <vector>

#include "lab/trace/command_chain.hpp"
#include "lab/trace/record_check.hpp"
#include "lab/trace/trace_reader.hpp"
#include "monitor/judge/freshness_statistics.hpp"

namespace takt::lab {

inline constexpr std::size_t kWorstCommands = 10;

// Between the sensing behind a command and its use.
struct CommandContext {
  std::uint64_t first_tick = 0, last_tick = 0;
  std::uint64_t untraced_ticks = 0;  // in between, but not in the trace
  std::vector<Mode> modes;           // in order, without repetition
  std::uint64_t late_wakeups = 0;
  Duration worst_lateness{}, longest_tick{};
  std::uint64_t skipped_periods = 0;                         // instants between ticks further apart than a period
  std::array<std::uint64_t, kOverrunCauseCount> overruns{};  // by cause, from the records
  std::uint64_t refused_messages = 0;
};

struct WorstCommand {
  CommandChain chain;
  Stage longest = Stage::sense;
  CommandContext context;
};

struct TraceReview {
  std::int64_t executive_pid = 0;
  Chains chains;
  std::array<monitor::Quantiles, kStageNames.size()> stages;  // ns, by Stage
  monitor::Quantiles lateness, tick_work, looks, drains;      // ns: wake-up, tick, policy host's and monitor's looks
  std::uint64_t ticks = 0, late_wakeups = 0, skipped_periods = 0;
  Duration period{};                // median distance of ticks
  std::vector<WorstCommand> worst;  // by total, longest first
  std::optional<RecordCheck> records;
};

// Later than this share of a period is a late wake-up.
inline constexpr std::int64_t kLateShare = 10;

// `records` (ascending by tick): of the run that was traced, or null. The error is one sentence.
std::expected<TraceReview, std::string> review_trace(const Timeline& timeline, const std::vector<TickFacts>* records);

std::string review_text(const TraceReview& review, const TraceReading& reading, const Timeline& timeline);
nlohmann::ordered_json to_json(const TraceReview& review, const TraceReading& reading, const Timeline& timeline);

}  // namespace takt::lab

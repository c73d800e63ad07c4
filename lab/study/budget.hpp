// SPDX-License-Identifier: Apache-2.0
// The control-rate budget: which loop rates a chain of stages can serve, where the slack is, and how old the commands
// then are. Pure arithmetic; what the stages take comes from the caller. Source: Figure 55.2A, whose times are
// figure_stages().
//
//   serial      one cycle after the other: a rate fits when the sum of all stages is within its period
//   pipelined   stages overlap, each at work on a cycle of its own: a rate fits when the slowest stage is within it;
//               waiting (for a camera frame, for the next tick) overlaps with itself and does not count
// Overlapping buys rate, never age: a command is as old as the sum of its stages when it takes effect, and grows until
// the next one replaces it, one interval later. A loop that does not fit runs at the interval that it reaches.
// Unit: ms, Hz. Thread rule: none, values in and values out.
#pragma once

#include <cstdint>
#include <nlohmann/json.hpp>
#include <optional>
#include <span>
#include <string>
#include <string_view>
#include <vector>

namespace takt::study {

struct StageTime {
  std::string name;
  double typical_ms = 0;  // p50, >= 0
  double worst_ms = 0;    // p99, >= typical_ms; equal where only one figure is known
  std::string source;     // who says so
  bool waits = false;     // delays the command but keeps no processor busy: limits the serial loop only
};

// Perception 30, inference 15, planning 5, actuation 1 ms.
std::vector<StageTime> figure_stages();
// 5, 10, 15, 20, 30, 50, 100, 200, 500, 1000 Hz.
std::span<const double> usual_rates_Hz();

enum class Fit : std::uint8_t {
  fits,  // in the worst case too
  tail,  // typically, but not in the worst case: deadlines are missed now and then
  never
};
std::string_view name(Fit fit);

// How one rate goes under one way of execution.
struct Execution {
  Fit fit = Fit::never;
  double typical_slack_ms = 0, worst_slack_ms = 0;  // period minus what has to be within it; negative: too long
  double interval_ms = 0;                           // between commands: the period where it fits, else what is reached
  double oldest_ms = 0;                             // worst-case age of a command just before the next replaces it
  bool is_fresh = true;                             // that age is within max_age, where one is given
};

struct RateBudget {
  double rate_Hz = 0, period_ms = 0;
  Execution serial, pipelined;
  std::vector<double> stage_slack_ms;  // per stage: period minus its worst case
};

struct Budget {
  std::vector<StageTime> stages;
  StageTime total;          // age at first use: the sum, or what was measured end to end
  std::size_t slowest = 0;  // working stage with the longest worst case
  std::optional<double> max_age_ms;
  double serial_Hz = 0, pipelined_Hz = 0;  // highest rates that fit in the worst case
  std::vector<RateBudget> rates;           // ascending, each once
};

struct Question {
  std::vector<StageTime> stages;            // at least one of them works, for longer than 0
  std::optional<StageTime> measured_total;  // end to end, where it is known better than by the sum
  std::vector<double> rates_Hz;             // each > 0
  std::optional<double> max_age_ms;
};
Budget budget_of(Question question);

// `focus_Hz`: the rate whose periods are drawn beside the stages.
std::string budget_text(const Budget& budget, double focus_Hz);  // at most 80 columns, UTF-8
std::string budget_svg(const Budget& budget, double focus_Hz);   // one picture, no script, no request
nlohmann::ordered_json to_json(const Budget& budget);

}  // namespace takt::study

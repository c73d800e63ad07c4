// SPDX-License-Identifier: Apache-2.0
// The budget for a terminal: stages on a timeline, serial and pipelined, and one line per rate. 80 columns, UTF-8.
#include <fmt/format.h>

#include <algorithm>
#include <array>
#include <cmath>

#include "lab/study/budget.hpp"

namespace takt::study {
namespace {

constexpr std::size_t kLabel = 12, kBar = 66;
constexpr std::size_t kGauge = 18, kPeriodMark = 9;  // columns of a rate's gauge; where its period ends
constexpr int kCycles = 3;                           // drawn of a pipelined loop
constexpr std::array<std::string_view, 8> kEighths{"", "▏", "▎", "▍", "▌", "▋", "▊", "▉"};

// A row of cells, each one column wide.
class Row {
 public:
  explicit Row(double span_ms) : per_ms_(kBar / span_ms), cells_(kBar, " ") {}
  // What takes any time at all is seen.
  void bar(double from_ms, double length_ms, std::string_view full) {
    if (length_ms <= 0) return;
    const double begin = std::floor(from_ms * per_ms_), end = (from_ms + length_ms) * per_ms_;
    for (auto at = static_cast<std::size_t>(begin); at < kBar && static_cast<double>(at) < end; ++at) {
      const double covered = end - static_cast<double>(at);
      const auto eighths = static_cast<std::size_t>(std::clamp(covered * 8, 1.0, 8.0));
      cells_[at] = eighths == 8 ? full : kEighths[eighths];
    }
  }
  void mark(double at_ms, std::string_view what) {
    const auto at = static_cast<std::size_t>(std::llround(at_ms * per_ms_));
    if (at < kBar) cells_[at] = what;
  }
  [[nodiscard]] std::string text(std::string_view label) const {
    std::string line = fmt::format("{:<{}} ", label.substr(0, kLabel), kLabel);
    for (const std::string_view cell : cells_) line += cell;
    return line.substr(0, line.find_last_not_of(' ') + 1) + "\n";
  }

 private:
  double per_ms_;
  std::vector<std::string_view> cells_;
};

// Ends of the focus rate's periods; nothing where they would touch.
std::string ruler(double focus_Hz, double span_ms) {
  const double period_ms = 1000 / focus_Hz;
  if (period_ms / span_ms * kBar < 3) return {};
  Row row(span_ms);
  row.bar(0, span_ms, "·");
  for (double at = 0; at <= span_ms; at += period_ms) row.mark(at, "│");
  return row.text(fmt::format("{:g} Hz", focus_Hz));
}

std::string stage_table(const Budget& budget) {
  std::string text = fmt::format("{:<{}} {:>12} {:>12}  {}\n", "stage", kLabel, "typical", "worst", "source");
  const auto line = [&](const StageTime& stage) {
    text += fmt::format("{:<{}} {:>9.4g} ms {:>9.4g} ms  {}{}\n", stage.name.substr(0, kLabel), kLabel,
                        stage.typical_ms, stage.worst_ms, stage.source, stage.waits ? ", waiting" : "");
  };
  for (const StageTime& stage : budget.stages) line(stage);
  line(budget.total);
  return text;
}

std::string timeline(const Budget& budget, double focus_Hz, int cycles, double interval_ms) {
  double sum_ms = 0;
  for (const StageTime& stage : budget.stages) sum_ms += stage.worst_ms;
  const double span_ms = sum_ms + (cycles - 1) * interval_ms;
  std::string text = fmt::format("{:<{}} {:<{}}{:>10.4g} ms\n", "", kLabel, "0 ms", kBar - 13, span_ms);
  double offset_ms = 0;
  for (const StageTime& stage : budget.stages) {
    Row row(span_ms);
    for (int cycle = 0; cycle < cycles; ++cycle)
      row.bar(offset_ms + cycle * interval_ms, stage.worst_ms, cycle % 2 == 0 ? "█" : "▒");
    text += row.text(stage.name);
    offset_ms += stage.worst_ms;
  }
  return text + ruler(focus_Hz, span_ms);
}

// How much of a period the slowest stage (█) and all of them (▒) take; ┃ where the period ends.
std::string gauge(const RateBudget& rate) {
  const double columns_per_ms = kPeriodMark / rate.period_ms;
  const auto columns = [&](const Execution& execution) {
    const double used = (rate.period_ms - execution.worst_slack_ms) * columns_per_ms;
    return static_cast<std::size_t>(std::clamp(std::ceil(used - 1e-9), 0.0, 1e6));
  };
  const std::size_t busy = columns(rate.pipelined), all = columns(rate.serial);
  std::string text;
  for (std::size_t i = 0; i < kGauge; ++i) {
    if (i == kPeriodMark) text += "┃";
    text += i < busy ? "█" : i < all ? "▒" : i < kPeriodMark ? "·" : " ";
  }
  return text.substr(0, text.find_last_not_of(' ') + 1) + (all > kGauge ? "▸" : "");
}

std::string slack(const Execution& execution) {
  return fmt::format("{:<4} {:>+9.2f}", name(execution.fit), execution.worst_slack_ms);
}

std::string age(const Execution& execution) {
  return fmt::format("{:>8.1f}{}", execution.oldest_ms, execution.is_fresh ? " " : "!");
}

std::string rate_table(const Budget& budget) {
  std::string text = fmt::format("{:>8} {:<14} {:<14} {:>8}  {:>8}   {}\n", "", "serial", "pipelined", "oldest",
                                 "oldest", "share of the period");
  text += fmt::format("{:>8} {:<14} {:<14} {:>8}  {:>8}   {}\n", "rate", "     slack ms", "     slack ms", "serial",
                      "pipel.", "█ slowest ▒ all ┃");
  for (const RateBudget& rate : budget.rates) {
    text += fmt::format("{:>5.4g} Hz {} {} {} {}  {}\n", rate.rate_Hz, slack(rate.serial), slack(rate.pipelined),
                        age(rate.serial), age(rate.pipelined), gauge(rate));
  }
  return text;
}

std::string verdict(const Budget& budget, double focus_Hz) {
  const StageTime& slowest = budget.stages[budget.slowest];
  std::string text = fmt::format(
      "serial: {:.4g} ms in a row, up to {:.4g} Hz\npipelined: the slowest stage is {} with {:.4g} ms, up to {:.4g} "
      "Hz\n",
      budget.total.worst_ms, budget.serial_Hz, slowest.name, slowest.worst_ms, budget.pipelined_Hz);
  const auto rate = std::ranges::find(budget.rates, focus_Hz, &RateBudget::rate_Hz);
  if (rate != budget.rates.end()) {
    const auto says = [&](std::string_view how, const Execution& one) {
      const char* const verdict_text = one.fit == Fit::fits   ? "fits, slack"
                                       : one.fit == Fit::tail ? "fits typically; its worst case is too long by"
                                                              : "does not fit, too long by";
      text += fmt::format("{:g} Hz, {:.4g} ms, {}: {} {:.4g} ms\n", rate->rate_Hz, rate->period_ms, how, verdict_text,
                          std::abs(one.worst_slack_ms));
    };
    says("serial", rate->serial);
    says("pipelined", rate->pipelined);
  }
  if (budget.max_age_ms) text += fmt::format("max_age {:.4g} ms: an older command is marked !\n", *budget.max_age_ms);
  return text;
}

}  // namespace

std::string budget_text(const Budget& budget, double focus_Hz) {
  return stage_table(budget) + "\nserial, one cycle\n" + timeline(budget, focus_Hz, 1, 0) +
         fmt::format("\npipelined, {} cycles as close as they go\n", kCycles) +
         timeline(budget, focus_Hz, kCycles, budget.stages[budget.slowest].worst_ms) + "\n" + rate_table(budget) +
         "\n" + verdict(budget, focus_Hz);
}

}  // namespace takt::study

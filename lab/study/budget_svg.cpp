// SPDX-License-Identifier: Apache-2.0
// The budget as a picture: the stages in a row and overlapped, against the periods of one rate, and every rate's
// verdict.
#include <fmt/format.h>

#include <algorithm>
#include <array>
#include <cmath>

#include "evidence/review/svg.hpp"
#include "lab/study/budget.hpp"

namespace takt::study {
namespace {

constexpr int kDrawnCycles = 3;
constexpr double kLeft = 130, kWidth = 620, kRow = 26, kBarHeight = 18;
constexpr std::array<std::string_view, 6> kColours{"#4477aa", "#66ccee", "#228833", "#ccbb44", "#ee6677", "#aa3377"};

std::string_view colour(Fit fit) {
  switch (fit) {
    case Fit::fits:
      return "#228833";
    case Fit::tail:
      return "#b58900";
    case Fit::never:
      return "#cc3311";
  }
  return "#888888";
}

// One timeline; returns where the next thing may begin.
double draw_timeline(const Budget& budget, double focus_Hz, int cycles, double top, std::string& out) {
  const double interval_ms = budget.stages[budget.slowest].worst_ms;
  double sum_ms = 0;
  for (const StageTime& stage : budget.stages) sum_ms += stage.worst_ms;
  const double span_ms = sum_ms + (cycles - 1) * interval_ms, per_ms = kWidth / span_ms;
  const double bottom = top + kRow * static_cast<double>(budget.stages.size());
  const double period_ms = 1000 / focus_Hz;
  if (period_ms * per_ms > 4) {
    for (double at = 0; at <= span_ms; at += period_ms)
      out += evidence::svg_line(kLeft + at * per_ms, top - 4, kLeft + at * per_ms, bottom + 4, "#cc3311");
    out += evidence::svg_text(kLeft + kWidth, bottom + 18,
                              fmt::format("red: every {:.4g} ms, {:g} Hz", period_ms, focus_Hz), "end");
  }
  double offset_ms = 0, y = top;
  for (std::size_t i = 0; i < budget.stages.size(); ++i) {
    const StageTime& stage = budget.stages[i];
    out += evidence::svg_text(kLeft - 8, y + 13, stage.name, "end");
    for (int cycle = 0; cycle < cycles; ++cycle) {
      const double from = kLeft + (offset_ms + cycle * interval_ms) * per_ms;
      out += evidence::svg_rectangle({from, y, std::max(1.0, stage.worst_ms * per_ms), kBarHeight},
                                     kColours[i % kColours.size()], cycle % 2 == 0 ? 1 : 0.55,
                                     fmt::format("{}: {:.4g} ms", stage.name, stage.worst_ms));
    }
    offset_ms += stage.worst_ms;
    y += kRow;
  }
  out += evidence::svg_text(kLeft, bottom + 18, fmt::format("0 to {:.4g} ms", span_ms), "start");
  return bottom + 40;
}

double draw_rates(const Budget& budget, double top, std::string& out) {
  const auto cell = [&](double x, double y, const Execution& execution) {
    out += evidence::svg_rectangle({x, y - 12, 12, 12}, colour(execution.fit), 1, name(execution.fit));
    out += evidence::svg_text(
        x + 18, y - 1, fmt::format("{}, slack {:+.4g} ms", name(execution.fit), execution.worst_slack_ms), "start");
    out += evidence::svg_text(
        x + 300, y - 1, fmt::format("{:.4g} ms{}", execution.oldest_ms, execution.is_fresh ? "" : " too old"), "end");
  };
  double y = top;
  out += evidence::svg_text(kLeft - 8, y, "rate", "end") + evidence::svg_text(kLeft, y, "serial", "start") +
         evidence::svg_text(kLeft + 300, y, "oldest command", "end") +
         evidence::svg_text(kLeft + 320, y, "pipelined", "start") +
         evidence::svg_text(kLeft + 620, y, "oldest command", "end");
  for (const RateBudget& rate : budget.rates) {
    y += 20;
    out += evidence::svg_text(kLeft - 8, y, fmt::format("{:g} Hz", rate.rate_Hz), "end");
    cell(kLeft, y, rate.serial);
    cell(kLeft + 320, y, rate.pipelined);
  }
  return y + 20;
}

}  // namespace

std::string budget_svg(const Budget& budget, double focus_Hz) {
  std::string body;
  body += evidence::svg_text(
      kLeft, 22, fmt::format("serial: {:.4g} ms, up to {:.4g} Hz", budget.total.worst_ms, budget.serial_Hz), "start");
  double y = draw_timeline(budget, focus_Hz, 1, 34, body);
  const StageTime& slowest = budget.stages[budget.slowest];
  body += evidence::svg_text(kLeft, y,
                             fmt::format("pipelined: {} takes {:.4g} ms, up to {:.4g} Hz", slowest.name,
                                         slowest.worst_ms, budget.pipelined_Hz),
                             "start");
  y = draw_timeline(budget, focus_Hz, kDrawnCycles, y + 12, body);
  y = draw_rates(budget, y + 10, body);
  return evidence::svg_document(kLeft + kWidth + 20, y, "Control-rate budget", body);
}

}  // namespace takt::study

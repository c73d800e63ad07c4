// SPDX-License-Identifier: Apache-2.0
#include "cli/top/screen_summary.hpp"

#include <fmt/format.h>

#include <algorithm>
#include <array>

#include "executive/contract/tick_facts.hpp"
#include "monitor/judge/run_metrics.hpp"

namespace takt::monitor::top {
namespace {

constexpr std::size_t kStageBar = 12;
constexpr double kMs = 1e-6;  // per nanosecond

std::string upper(std::string_view text) {
  std::string all(text);
  std::ranges::transform(all, all.begin(), [](char c) { return c >= 'a' && c <= 'z' ? static_cast<char>(c - 32) : c; });
  return all;
}

Style freshness_style(Freshness freshness) {
  switch (freshness) {
    case Freshness::missing:
      return Style::faint;
    case Freshness::fresh:
      return Style::good;
    case Freshness::aging:
      return Style::warning;
    case Freshness::stale:
      return Style::alarm;
  }
  return Style::plain;
}

Style verdict_style(Verdict verdict) {
  switch (verdict) {
    case Verdict::held:
      return Style::good;
    case Verdict::undecided:
      return Style::plain;
    case Verdict::violated:
      return Style::alarm;
  }
  return Style::plain;
}

}  // namespace

Line title(const Picture& picture) {
  Line line;
  line.add("takt top  ", Style::faint).add(picture.robot, Style::strong).add("  ");
  switch (picture.link) {
    case Link::waiting:
      return line.add("WAITING for the executive", Style::warning);
    case Link::silent:
      line.add("NO TICK", Style::alarm);
      if (picture.tick.tick == 0) return line.add(" yet", Style::alarm);
      return line.add(fmt::format(" for {:.1f} s, was {}", picture.since_tick.seconds(), name(picture.tick.mode)),
                      Style::alarm);
    case Link::live:
      break;
  }
  line.add(upper(name(picture.tick.mode)), mode_style(picture.tick.mode));
  line.add(fmt::format(" {:.0f} s", picture.in_mode.seconds()));
  if (picture.tick.player == Player::fallback) line.add("  FALLBACK POLICY", Style::warning);
  if (picture.tick.candidate.in_charge != 0) {
    const bool on_probation = picture.tick.candidate.on_probation != 0;
    line.add(on_probation ? "  CANDIDATE ON PROBATION" : "  CANDIDATE IN CHARGE", Style::warning);
  }
  if (picture.realtime && picture.tick.recorded_through == 0) line.add("  UNRECORDED", Style::warning);
  if (picture.realtime == false) line.add("  NOT REAL TIME", Style::warning);
  if (picture.entered_by != Cause::none) line.add(fmt::format("  {}", name(picture.entered_by)));
  return line.add(fmt::format("  tick {}", picture.tick.tick), Style::faint);
}

std::vector<Line> incident_lines(const Picture& picture, std::size_t columns) {
  std::vector<Line> lines;
  const std::size_t width = columns - kLabel;
  std::string_view rest = picture.incident;
  while (!rest.empty() && lines.size() < kIncidentRows) {
    std::size_t end = rest.size();
    if (end > width) end = std::max<std::size_t>(rest.rfind(' ', width) + 1, 1);
    if (rest.size() > width && end == 1) end = width;  // no space to break at
    lines.push_back(labelled(lines.empty() ? "why" : ""));
    lines.back().add(rest.substr(0, end), Style::alarm);
    rest.remove_prefix(end);
  }
  return lines;
}

Line age_line(const Picture& picture) {
  const Freshness freshness = picture.tick.seats[Seat::policy].freshness;
  const bool is_missing = freshness == Freshness::missing;
  Line line = labelled("age");
  line.add(is_missing ? std::string("none") : fmt::format("{:.1f}", picture.tick.age.total().milliseconds()),
           freshness_style(freshness));
  line.add(fmt::format(" of {:g} ms ", picture.max_age.milliseconds()));
  line.add(name(freshness), freshness_style(freshness)).to(38);
  const Quantiles& age = picture.age;
  if (age.count == 0) return line.add("p50 -  p95 -  p99 -  max -", Style::faint);
  return line.add(fmt::format("p50 {:.1f}  p95 {:.1f}  p99 {:.1f}  max {:.1f}", age.p50 * kMs, age.p95 * kMs,
                              age.p99 * kMs, age.max * kMs));
}

Line stages_line(const Picture& picture, Glyphs glyphs) {
  std::array<double, kAgeStageCount> medians{};
  for (std::size_t stage = 0; stage < kAgeStageCount; ++stage) medians[stage] = picture.stages[stage].p50;
  Line line = labelled("stages");
  line.add("[", Style::faint);
  line.add(stacked_bar(medians, static_cast<double>(picture.max_age.ns), kStageBar, glyphs));
  line.add("] ", Style::faint);
  for (std::size_t stage = 0; stage < kAgeStageCount; ++stage) {
    // In ASCII the letters of the bar explain themselves.
    if (glyphs == Glyphs::unicode) line.add(part_glyph(stage, glyphs), Style::faint);
    line.add(fmt::format("{} {:.1f}  ", kAgeStageNames[stage], medians[stage] * kMs));
  }
  return line.add("ms", Style::faint);
}

Line misses_line(const Picture& picture) {
  const TickRecordHeader& tick = picture.tick;
  const double rate = window_miss_share(tick);
  Line line = labelled("misses");
  line.add(fmt::format("{}/{} = {:.2f} %", tick.window_misses, tick.window_ticks, 100 * rate),
           rate > picture.epsilon ? Style::alarm : Style::plain);
  line.add(fmt::format(", epsilon {:g} %", 100 * picture.epsilon)).to(44);
  if (picture.misses.count == 0) return line.add("nothing to judge yet", Style::faint);
  line.add(fmt::format("so far {:.2f} % <= {:.2f} % ", 100 * picture.misses.rate, 100 * picture.misses.upper_bound));
  return line.add(name(picture.misses.verdict), verdict_style(picture.misses.verdict));
}

Line overruns_line(const Picture& picture) {
  Line line = labelled("overruns");
  std::string causes;
  for (std::size_t cause = 1; cause < kOverrunCauseCount; ++cause)
    if (picture.overruns[cause] != 0)
      causes += fmt::format("{} {}, ", name(static_cast<OverrunCause>(cause)), picture.overruns[cause]);
  if (causes.empty()) return line.add(fmt::format("none in {} ticks", picture.ticks));
  return line.add(causes, Style::warning).add(fmt::format("{} periods skipped", picture.skipped_periods));
}

Line policy_line(const Picture& picture) {
  Line line = labelled("policy");
  if (picture.planned_rate <= 0 && picture.tick.command_policy == 0)
    return line.add("the robot has none", Style::faint);
  if (picture.tick.command_policy != 0)
    line.add(fmt::format("{:016x}", picture.tick.command_policy));
  else
    line.add("no command yet", Style::faint);
  line.add(fmt::format("  {:.0f} Hz", picture.policy_rate),
           picture.policy_rate < 0.9 * picture.planned_rate ? Style::warning : Style::plain);
  if (picture.planned_rate > 0) line.add(fmt::format(" of {:.0f}", picture.planned_rate));
  if (picture.realtime && picture.policy_pid == 0) line.add("  not attached", Style::warning);
  if (picture.policy_pid != 0) line.add(fmt::format("  pid {}", picture.policy_pid));
  for (std::size_t arrival = 2; arrival < kArrivalCount; ++arrival)
    if (picture.arrivals[arrival] != 0)
      line.add(fmt::format("  {} {}", name(static_cast<Arrival>(arrival)), picture.arrivals[arrival]), Style::warning);
  return line;
}

}  // namespace takt::monitor::top

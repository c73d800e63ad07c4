// SPDX-License-Identifier: Apache-2.0
#include "cli/top/screen.hpp"

#include <fmt/format.h>

#include <algorithm>
#include <array>
#include <utility>

#include "cli/top/screen_summary.hpp"
#include "cli/top/screen_tables.hpp"

namespace takt::monitor::top {
namespace {

constexpr std::size_t kMostPlotRows = 8;
constexpr std::size_t kFixedRows = 8;  // all but plot, buses and joints

constexpr std::array<std::string_view, 10> kHelp{
    "a  arm: asks, then y enables the drives and lets the policy move the robot",
    "s  stop: damping until the robot rests, then hold; at once, asks nothing",
    "r  reset: clear a latched stop or fault, back to standby",
    "m  mark: this instant, in the run's ticks; takt report shows the marks",
    "p  snapshot: write down what takt trace start --flight-recorder remembers",
    "j k, arrows  scroll the joints        ?  this help        q  quit",
    "mode: s standby  a arming  T tracking  D degraded  S damped stop  F fault",
    "age: of the command in use, the worst of each quarter second, and max_age",
    "p50 p95 p99: of the last 10 s; stages: of commands at their first use",
    "bus: load of the last second, worst stuffing; in brackets as configured"};

Line footer(const Picture& picture, const Prompt& prompt) {
  Line line;
  if (prompt.confirms_arm)
    return line.add("ARM: enable the drives, let the policy move the robot? y yes, other keys no", Style::alarm);
  if (!prompt.note.empty()) return line.add(prompt.note, prompt.note_is_bad ? Style::alarm : Style::strong);
  if (picture.lost_ticks != 0)
    return line.add(
        fmt::format("this view missed {} ticks: it was too slow; the run is not touched by it", picture.lost_ticks),
        Style::warning);
  return line.add("a arm  s stop  r reset  m mark  p snapshot  j k scroll  ? help  q quit", Style::faint);
}

void append(std::vector<Line>& lines, std::vector<Line> more) {
  std::ranges::move(more, std::back_inserter(lines));
}

std::vector<Line> age_lines(const Picture& picture, std::size_t columns, std::size_t rows, Glyphs glyphs) {
  std::vector<Line> lines;
  std::size_t row = 0;
  for (const Line& plot : age_plot(picture.history, picture.max_age, columns - kLabel, rows, glyphs)) {
    // The limit is drawn at the bottom of the row above three quarters.
    const bool is_limit = rows > 1 && rows - 1 - row == rows * 3 / 4;
    lines.push_back(labelled(is_limit ? fmt::format("{:g} ms", picture.max_age.milliseconds()) : ""));
    lines.back().add(plot);
    ++row;
  }
  return lines;
}

std::vector<Line> help_lines(std::size_t rows) {
  std::vector<Line> lines;
  for (std::size_t line = 0; line < std::min(rows, kHelp.size()); ++line) {
    lines.emplace_back();
    lines.back().add(kHelp[line]);
  }
  return lines;
}

Line band_line(const Picture& picture, std::size_t columns) {
  Line line = labelled("mode");
  return line.add(mode_band(picture.history, columns - kLabel));
}

std::vector<Line> screen(const Picture& picture, const Prompt& prompt, Size size, Glyphs glyphs) {
  std::vector<Line> buses = bus_lines(picture, size.columns);
  std::vector<Line> incident = incident_lines(picture, size.columns);
  const std::size_t fixed_rows = kFixedRows + incident.size();
  const std::size_t most_buses = size.rows - fixed_rows - 3;  // leaves the plot and two rows of joints
  if (buses.size() > most_buses) buses.resize(most_buses);
  const std::size_t room = size.rows - fixed_rows - buses.size();  // for plot and joints
  const std::size_t wanted = prompt.help ? kHelp.size() : picture.joints.size() + 1;
  const std::size_t plot_rows = room > wanted ? std::min(room - wanted, kMostPlotRows) : 1;

  std::vector<Line> lines{title(picture)};
  append(lines, std::move(incident));
  lines.push_back(band_line(picture, size.columns));
  lines.push_back(age_line(picture));
  append(lines, age_lines(picture, size.columns, plot_rows, glyphs));
  lines.push_back(stages_line(picture, glyphs));
  lines.push_back(misses_line(picture));
  lines.push_back(overruns_line(picture));
  lines.push_back(policy_line(picture));
  append(lines, std::move(buses));
  const std::size_t joint_rows = room - plot_rows;
  append(lines, prompt.help ? help_lines(joint_rows) : joint_lines(picture, prompt.scroll, joint_rows));
  lines.resize(size.rows - 1);
  lines.push_back(footer(picture, prompt));
  return lines;
}

}  // namespace

std::vector<Line> render(const Picture& picture, const Prompt& prompt, Size size, Glyphs glyphs) {
  std::vector<Line> lines;
  if (size.rows < kLeast.rows || size.columns < kLeast.columns) {
    if (size.rows == 0) return lines;
    lines.emplace_back();
    lines.back().add(fmt::format("too small: {}x{} needed", kLeast.columns, kLeast.rows));
  } else {
    lines = screen(picture, prompt, size, glyphs);
    if (picture.link == Link::waiting) lines[2] = labelled("because").add(picture.why);
  }
  for (Line& line : lines) line.clip(size.columns);
  return lines;
}

}  // namespace takt::monitor::top

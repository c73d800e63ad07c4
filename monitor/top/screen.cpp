#include "monitor/top/screen.hpp"

#include <fmt/format.h>

#include <algorithm>
#include <array>
#include <utility>

#include "monitor/run_metrics.hpp"

namespace takt::monitor::top {
namespace {

constexpr std::size_t kLabel = 9;  // columns of the labels at the left
constexpr std::size_t kStageBar = 12;
constexpr std::size_t kMostPlotRows = 8;
constexpr std::size_t kFixedRows = 8;  // all but plot, buses and joints
constexpr std::size_t kBusColumns = 35;
constexpr double kMs = 1e-6;  // per nanosecond

constexpr std::array<std::string_view, 10> kHelp{
    "a  arm: asks, then y enables the drives and lets the policy move the robot",
    "s  stop: damping until the robot rests, then hold; at once, asks nothing",
    "r  reset: clear a latched stop or fault, back to standby",
    "m  mark: this instant, in the run's ticks; takt report lists the marks",
    "p  snapshot: write down what takt trace start --flight-recorder remembers",
    "j k, arrows  scroll the joints        ?  this help        q  quit",
    "mode: s standby  a arming  T tracking  D degraded  S damped stop  F fault",
    "age: of the command in use, the worst of each quarter second, and max_age",
    "p50 p95 p99: of the last 10 s; stages: of commands at their first use",
    "bus: load of the last second, worst stuffing; in brackets as configured"};

Line labelled(std::string_view label) {
  Line line;
  return line.add(label, Style::faint).to(kLabel);
}

std::string_view name_of(BusState state) {
  constexpr std::array<std::string_view, 4> names{"up", "passive", "bus-off", "down"};
  const auto index = static_cast<std::size_t>(state);
  return index < names.size() ? names[index] : "invalid";
}

std::string upper(std::string_view text) {
  std::string all(text);
  std::ranges::transform(all, all.begin(), [](char c) { return c >= 'a' && c <= 'z' ? static_cast<char>(c - 32) : c; });
  return all;
}

void append(Line& line, const Line& more) {
  for (const Piece& piece : more.pieces()) line.add(piece.text, piece.style);
}

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
  if (picture.realtime && picture.monitor_pid == 0) line.add("  UNRECORDED", Style::warning);
  if (picture.realtime == false) line.add("  NOT REAL TIME", Style::warning);
  if (picture.entered_by != Cause::none) line.add(fmt::format("  {}", name(picture.entered_by)));
  return line.add(fmt::format("  tick {}", picture.tick.tick), Style::faint);
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

Line age_line(const Picture& picture) {
  const Freshness freshness = picture.tick.freshness;
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
  append(line, stacked_bar(medians, static_cast<double>(picture.max_age.ns), kStageBar, glyphs));
  line.add("] ", Style::faint);
  for (std::size_t stage = 0; stage < kAgeStageCount; ++stage) {
    // In ASCII the letters of the bar explain themselves.
    if (glyphs == Glyphs::unicode) line.add(part_glyph(stage, glyphs), Style::faint);
    line.add(fmt::format("{} {:.1f}  ", kAgeStageNames[stage], medians[stage] * kMs));
  }
  return line.add("ms", Style::faint);
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

Line misses_line(const Picture& picture) {
  const TickRecordHeader& tick = picture.tick;
  const double rate = tick.window_ticks == 0 ? 0 : static_cast<double>(tick.window_misses) / tick.window_ticks;
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
  if (picture.planned_rate <= 0 && picture.policy_hash == 0) return line.add("the robot has none", Style::faint);
  if (picture.policy_hash != 0)
    line.add(fmt::format("{:016x}", picture.policy_hash));
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

void add_bus(Line& line, const BusPicture& bus) {
  const BusHealth& health = bus.health;
  line.add(first_cells(bus.name, 10)).add(" ");
  line.add(name_of(health.state), health.state == BusState::up ? Style::good : Style::alarm);
  line.add(fmt::format(" {:.0f} %", 100 * bus.load), bus.load > 0.9 ? Style::alarm : Style::plain);
  if (bus.planned) line.add(fmt::format(" [{:.0f}]", 100 * *bus.planned), Style::faint);
  std::string errors;
  if (health.tx_dropped != 0) errors += fmt::format(" tx lost {}", health.tx_dropped);
  if (health.rx_dropped != 0) errors += fmt::format(" rx lost {}", health.rx_dropped);
  if (health.foreign_frames != 0) errors += fmt::format(" alien {}", health.foreign_frames);
  if (health.flooded != 0) errors += " flooded";
  line.add(errors.empty() ? " no errors" : errors, errors.empty() ? Style::faint : Style::warning);
}

std::vector<Line> bus_lines(const Picture& picture, std::size_t columns) {
  const std::size_t per_line = std::max<std::size_t>((columns - kLabel) / kBusColumns, 1);
  std::vector<Line> lines;
  for (std::size_t bus = 0; bus < picture.buses.size(); ++bus) {
    if (bus % per_line == 0) lines.push_back(labelled(bus == 0 ? "bus" : ""));
    lines.back().to(kLabel + bus % per_line * kBusColumns);
    add_bus(lines.back(), picture.buses[bus]);
  }
  return lines;
}

std::string interventions_text(const JointPicture& joint) {
  std::string text;
  for (std::size_t kind = 0; kind < kInterventionCount; ++kind)
    if ((joint.recent >> kind & 1U) != 0) text += fmt::format("{} {}  ", kInterventionNames[kind], joint.ticks[kind]);
  return text;
}

Line joint_line(const JointPicture& joint) {
  const JointRecord& record = joint.newest;
  Line line;
  line.add(first_cells(joint.name, 19)).to(20);
  line.add(fmt::format("{:>8.3f} {:>8.3f} {:>8.2f} {:>5.0f}  ", record.q_estimate, record.q_reference, record.tau_total,
                       record.feedback.temperature_C));
  if (record.feedback.error_code != 0)
    line.add(fmt::format("drive error {}  ", record.feedback.error_code), Style::alarm);
  if (record.reply_faults != 0) line.add("replies bad  ", Style::warning);
  return line.add(interventions_text(joint), Style::warning);
}

std::vector<Line> joint_lines(const Picture& picture, const Prompt& prompt, std::size_t rows) {
  Line header;
  header.add(fmt::format("{:<19} {:>8} {:>8} {:>8} {:>5}  ", "joint", "q rad", "target", "tau Nm", "C"), Style::faint);
  std::vector<Line> lines;
  const std::size_t count = picture.joints.size();
  const std::size_t shown = std::min(count, rows - 1);
  const std::size_t first = std::min(prompt.scroll, count - shown);
  if (shown < count)
    header.add(fmt::format("{}-{} of {} (j k)", first + 1, first + shown, count), Style::strong);
  else
    header.add("interventions (in ticks)", Style::faint);
  lines.push_back(std::move(header));
  for (std::size_t joint = first; joint < first + shown; ++joint) lines.push_back(joint_line(picture.joints[joint]));
  return lines;
}

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
    append(lines.back(), plot);
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
  append(line, mode_band(picture.history, columns - kLabel));
  return line;
}

std::vector<Line> screen(const Picture& picture, const Prompt& prompt, Size size, Glyphs glyphs) {
  std::vector<Line> buses = bus_lines(picture, size.columns);
  const std::size_t most_buses = size.rows - kFixedRows - 3;  // leaves the plot and two rows of joints
  if (buses.size() > most_buses) buses.resize(most_buses);
  const std::size_t room = size.rows - kFixedRows - buses.size();  // for plot and joints
  const std::size_t wanted = prompt.help ? kHelp.size() : picture.joints.size() + 1;
  const std::size_t plot_rows = room > wanted ? std::min(room - wanted, kMostPlotRows) : 1;

  std::vector<Line> lines{title(picture), band_line(picture, size.columns), age_line(picture)};
  append(lines, age_lines(picture, size.columns, plot_rows, glyphs));
  lines.push_back(stages_line(picture, glyphs));
  lines.push_back(misses_line(picture));
  lines.push_back(overruns_line(picture));
  lines.push_back(policy_line(picture));
  append(lines, std::move(buses));
  const std::size_t joint_rows = room - plot_rows;
  append(lines, prompt.help ? help_lines(joint_rows) : joint_lines(picture, prompt, joint_rows));
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

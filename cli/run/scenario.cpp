// SPDX-License-Identifier: Apache-2.0
#include "cli/run/scenario.hpp"

#include <fmt/format.h>

#include <algorithm>
#include <array>
#include <span>

#include "config/printable.hpp"
#include "config/trouble/line.hpp"
#include "config/units.hpp"
#include "policy_host/host_faults.hpp"

namespace takt::cli {
namespace {

constexpr std::array<std::string_view, 3> kWithoutRow{"thaw", "unload", "fault"};

// In the order of ProcessName.
std::span<const std::string_view> process_names() {
  return trouble::row_of(ActionKind::kill).strikes.words;
}

// Of a line's target: the process itself, or the one that runs in those threads.
ProcessName process_of(const trouble::Line& line) {
  const auto found = std::ranges::find(process_names(), line.target);
  if (found != process_names().end()) return static_cast<ProcessName>(found - process_names().begin());
  return line.row->as<ActionKind>() == ActionKind::load ? ProcessName::policy : ProcessName::executive;
}

void add_event(const trouble::Line& line, std::vector<Event>& events) {
  const Event event{line.at,     line.row->as<ActionKind>(),          process_of(line), trouble::text_of(line),
                    line.length, static_cast<std::size_t>(line.dose), line.command};
  events.push_back(event);
  if (event.action != ActionKind::freeze && event.action != ActionKind::load) return;
  Event& end = events.emplace_back(event);
  end.at = event.at + event.length;
  end.length = {};
  end.action = event.action == ActionKind::freeze ? ActionKind::thaw : ActionKind::unload;
  end.text = event.action == ActionKind::freeze ? "thaw " + line.target : "end of " + event.text;
}

// The values of an option in the command line of another program of ours.
std::vector<std::string> values_of(const std::string& option, const std::vector<std::string>& arguments) {
  std::vector<std::string> values;
  for (std::size_t at = 0; at < arguments.size(); ++at) {
    if (arguments[at].starts_with(option + "=")) values.push_back(arguments[at].substr(option.size() + 1));
    if (arguments[at] == option && at + 1 < arguments.size()) values.push_back(arguments[++at]);
  }
  return values;
}

}  // namespace

std::string_view name(ActionKind action) {
  const auto rows = trouble::rows(trouble::Place::run);
  const auto index = static_cast<std::size_t>(action);
  return index < rows.size() ? rows[index].name : kWithoutRow[index - rows.size()];
}

std::string_view name(ProcessName process) {
  return process_names()[static_cast<std::size_t>(process)];
}

std::expected<Duration, std::string> parse_duration(std::string_view text) {
  return trouble::parse_time(text);
}

std::expected<std::vector<Event>, std::string> parse_scenario(const std::vector<std::string>& lines,
                                                              const std::vector<std::string>& policy_arguments) {
  std::vector<Event> events;
  for (const std::string& line : lines) {
    const auto given = trouble::parse_line(line, trouble::Place::run);
    if (!given) return std::unexpected(fmt::format("--at '{}': {}", config::printable(line), given.error()));
    add_event(*given, events);
  }
  const std::vector<std::string> faults = values_of("--fault", policy_arguments);
  const auto windows = policy_host::parse_host_faults(faults);
  if (!windows) return std::unexpected("--policy=" + windows.error());
  for (std::size_t i = 0; i < faults.size(); ++i)
    events.push_back({(*windows)[i].from, ActionKind::fault, ProcessName::policy, faults[i], (*windows)[i].length});
  std::ranges::stable_sort(events, {}, &Event::at);
  return events;
}

std::string plant_scenario_of(const std::vector<std::string>& plant_arguments) {
  const std::vector<std::string> files = values_of("--scenario", plant_arguments);
  return files.empty() ? std::string() : files.back();
}

std::string as_given(const Event& event) {
  if (event.action == ActionKind::fault) return fmt::format("--policy=--fault='{}'", event.text);
  return fmt::format("--at '{}: {}'", config::format_duration(event.at), event.text);
}

bool is_end(const Event& event) {
  return event.action == ActionKind::thaw || event.action == ActionKind::unload;
}

std::expected<void, std::string> check_instants(const std::vector<Event>& events, Duration duration) {
  const auto late =
      std::ranges::find_if(events, [&](const Event& event) { return !is_end(event) && event.at >= duration; });
  if (late == events.end()) return {};
  return std::unexpected(
      fmt::format("{} would never happen: the run ends after {}; choose an earlier instant or a "
                  "longer --duration",
                  as_given(*late), config::format_duration(duration)));
}

}  // namespace takt::cli

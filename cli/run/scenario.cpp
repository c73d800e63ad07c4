// SPDX-License-Identifier: Apache-2.0
#include "cli/run/scenario.hpp"

#include <fmt/format.h>

#include <algorithm>
#include <array>
#include <cmath>
#include <optional>
#include <sstream>

#include "cli/run/cpu_hog.hpp"
#include "config/units.hpp"
#include "policy_host/host_faults.hpp"

namespace takt::cli {
namespace {

constexpr std::array<std::string_view, kProcessCount> kProcesses{"plant", "executive", "monitor", "policy", "fallback"};
constexpr std::array<std::string_view, 13> kActions{"freeze", "thaw",   "kill", "start", "hog",   "throttle", "crowd",
                                                    "load",   "unload", "arm",  "stop",  "reset", "fault"};
constexpr std::string_view kGrammar =
    "write 'T: ACTION', ACTION one of `freeze PROCESS DURATION`, `kill PROCESS`, `start PROCESS`, `hog control|policy "
    "DURATION`, `throttle control DURATION`, `crowd policy N DURATION`, `load N DURATION COMMAND`, `arm`, `stop`, "
    "`reset`; "
    "PROCESS one of policy, monitor, plant, executive";
constexpr std::size_t kLargestCrowd = 64;

std::optional<ProcessName> find_process(const std::string& word) {
  const auto found = std::ranges::find(kProcesses, word);
  if (found == kProcesses.end()) return std::nullopt;
  return static_cast<ProcessName>(found - kProcesses.begin());
}

std::optional<ActionKind> find_request(const std::string& word) {
  if (word == "arm") return ActionKind::arm;
  if (word == "stop") return ActionKind::stop;
  if (word == "reset") return ActionKind::reset;
  return std::nullopt;
}

std::string rest_of(std::istringstream& words) {
  std::string rest;
  std::getline(words >> std::ws, rest);
  return rest;
}

ActionKind contention_kind(const std::string& verb) {
  if (verb == "hog") return ActionKind::hog;
  return verb == "throttle" ? ActionKind::throttle : ActionKind::crowd;
}

// `hog control 8ms`, `throttle control 2s`, `crowd policy 5 2s`; `rest` is what follows the verb. None: not written so.
std::optional<Event> contention_of(Duration at, const std::string& verb, const std::string& rest) {
  std::istringstream words(rest);
  std::string target;
  words >> target;
  Event event{at, contention_kind(verb), ProcessName::policy, verb + ' ' + rest};
  if (target == "control") event.process = ProcessName::executive;
  if (target != "control" && target != "policy") return std::nullopt;
  if (verb != "hog" && target != (verb == "throttle" ? "control" : "policy")) return std::nullopt;
  if (verb == "crowd" && (!(words >> event.count) || event.count == 0 || event.count > kLargestCrowd))
    return std::nullopt;
  const auto length = parse_duration(rest_of(words));
  if (!length) return std::nullopt;
  event.length = *length;
  return event;
}

// `2 400ms ./burn --all`: a duration without a space. None: not written so.
std::optional<Event> load_of(Duration at, const std::string& rest) {
  std::istringstream words(rest);
  Event event{at, ActionKind::load, ProcessName::policy, "load " + rest};
  std::string span;
  if (!(words >> event.count >> span) || event.count == 0 || event.count > kLargestCrowd) return std::nullopt;
  const auto length = parse_duration(span);
  if (!length) return std::nullopt;
  event.length = *length;
  for (std::string word; words >> word;) event.command.push_back(word);
  if (event.command.empty()) return std::nullopt;
  return event;
}

std::expected<void, std::string> add_event(const std::string& line, std::vector<Event>& events) {
  const auto refuse = [&](std::string_view why) { return std::unexpected(fmt::format("--at '{}': {}", line, why)); };
  const std::size_t colon = line.find(':');
  if (colon == std::string::npos) return refuse(kGrammar);
  const auto at = parse_duration(std::string_view(line).substr(0, colon));
  if (!at) return refuse(at.error());
  std::istringstream words(line.substr(colon + 1));
  std::string verb, target;
  words >> verb;
  if (const auto request = find_request(verb)) {
    if (!rest_of(words).empty()) return refuse(kGrammar);
    events.push_back({*at, *request, ProcessName::executive, verb});
    return {};
  }
  if (verb == "hog" || verb == "throttle" || verb == "crowd") {
    const auto event = contention_of(*at, verb, rest_of(words));
    if (!event) return refuse(kGrammar);
    if (verb == "hog" && event->length > kLongestFifoHog) return refuse("a hog may last 1 s: above it nothing runs");
    if (verb == "throttle" && event->length > kLongestLowestFifoHog)
      return refuse("this may last 60 s: ordinary processes get little of that core meanwhile");
    events.push_back(*event);
    return {};
  }
  if (verb == "load") {
    const auto event = load_of(*at, rest_of(words));
    if (!event) return refuse(kGrammar);
    events.push_back(*event);
    Event& end = events.emplace_back(*event);
    end.at = *at + event->length;
    end.action = ActionKind::unload;
    end.text = "end of " + event->text;
    return {};
  }
  words >> target;
  const auto process = find_process(target);
  const std::string rest = rest_of(words);
  if (!process) return refuse(kGrammar);
  if ((verb == "kill" || verb == "start") && rest.empty()) {
    const ActionKind kind = verb == "kill" ? ActionKind::kill : ActionKind::start;
    events.push_back({*at, kind, *process, fmt::format("{} {}", verb, target)});
    return {};
  }
  if (verb != "freeze") return refuse(kGrammar);
  constexpr std::string_view kFor = "for ";  // as it is told
  const auto span = parse_duration(std::string_view(rest).substr(rest.starts_with(kFor) ? kFor.size() : 0));
  if (!span) return refuse(span.error());
  events.push_back({*at, ActionKind::freeze, *process,
                    fmt::format("freeze {} for {}", target, config::format_duration(*span)), *span});
  events.push_back({*at + *span, ActionKind::thaw, *process, fmt::format("thaw {}", target)});
  return {};
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
  return kActions[static_cast<std::size_t>(action)];
}

std::string_view name(ProcessName process) {
  return kProcesses[static_cast<std::size_t>(process)];
}

std::expected<Duration, std::string> parse_duration(std::string_view text) {
  const auto trim = [](std::string_view t) {
    while (t.starts_with(' ')) t.remove_prefix(1);
    while (t.ends_with(' ')) t.remove_suffix(1);
    return t;
  };
  const auto quantity = config::parse_quantity(trim(text), config::Dimension::time);
  if (!quantity || *quantity < 0)
    return std::unexpected(fmt::format("`{}` is not a time; write such as 300ms or 20s", text));
  return Duration{std::llround(*quantity)};
}

std::expected<std::vector<Event>, std::string> parse_scenario(const std::vector<std::string>& lines,
                                                              const std::vector<std::string>& policy_arguments) {
  std::vector<Event> events;
  for (const std::string& line : lines)
    if (auto added = add_event(line, events); !added) return std::unexpected(added.error());
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

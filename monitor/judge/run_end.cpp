// SPDX-License-Identifier: Apache-2.0
#include "monitor/judge/run_end.hpp"

#include <fmt/format.h>

#include <algorithm>
#include <charconv>
#include <nlohmann/json.hpp>
#include <optional>
#include <set>
#include <sstream>
#include <string_view>
#include <vector>

#include "config/printable.hpp"
#include "executive/contract/policy_word.hpp"
#include "monitor/judge/script.hpp"
#include "monitor/record/bounded_file.hpp"
#include "monitor/record/word_log.hpp"

namespace takt::monitor {
namespace {

constexpr const char* kExecutiveLog = "logs/takt-executive.log";
constexpr std::size_t kMostTold = 10'000;                      // transitions, whatever the files hold
constexpr std::int64_t kFarthest_ns = std::int64_t{1} << 61U;  // from any other instant: no difference overflows

struct ToldTransition {
  Transition change;
  std::string detail, sentence, told_by;
};

template <class Enum, std::size_t count>
std::optional<Enum> enum_named(std::string_view word) {
  for (std::size_t value = 0; value < count; ++value)
    if (name(static_cast<Enum>(value)) == word) return static_cast<Enum>(value);
  return std::nullopt;
}

std::optional<Transition> change_of(std::uint64_t tick, MonoTime at, std::string_view from, std::string_view to,
                                    std::string_view cause) {
  const auto left = enum_named<Mode, kModeCount>(from);
  const auto entered = enum_named<Mode, kModeCount>(to);
  const auto why = enum_named<Cause, kCauseCount>(cause);
  if (!left || !entered || !why || at < MonoTime{-kFarthest_ns} || at > MonoTime{kFarthest_ns}) return std::nullopt;
  return Transition{tick, at, *left, *entered, *why};
}

std::optional<ToldTransition> told_by_line(const std::string& line) {
  const auto json = nlohmann::ordered_json::parse(line, nullptr, false);
  try {
    const auto change = change_of(json.at("tick").get<std::uint64_t>(), MonoTime{json.at("monotonic_ns")},
                                  json.at("from").get<std::string>(), json.at("to").get<std::string>(),
                                  json.at("cause").get<std::string>());
    if (change) return ToldTransition{*change, json.at("detail"), json.at("incident"), "transitions.jsonl"};
    return std::nullopt;
  } catch (const nlohmann::json::exception&) {
    return std::nullopt;  // a line that was cut off
  }
}

// "2026-11-21T09:33:00.123Z": ns since 1970, without the day's leap seconds; none: no such instant.
std::optional<std::int64_t> unix_ns_at(std::string_view text) {
  const auto number = [&](std::size_t from, std::size_t digits) {
    int value = -1;
    if (text.size() >= from + digits) std::from_chars(text.data() + from, text.data() + from + digits, value);
    return value;
  };
  tm utc{};
  utc.tm_year = number(0, 4) - 1900;
  utc.tm_mon = number(5, 2) - 1;
  utc.tm_mday = number(8, 2);
  utc.tm_hour = number(11, 2);
  utc.tm_min = number(14, 2);
  utc.tm_sec = number(17, 2);
  const int milliseconds = number(20, 3);
  const bool is_date = utc.tm_year >= 70 && utc.tm_year < 300 && utc.tm_mon >= 0 && utc.tm_mday >= 1;
  if (milliseconds < 0 || !is_date) return std::nullopt;
  return (std::int64_t{timegm(&utc)} * 1000 + milliseconds) * 1'000'000;
}

// "UTC NAME LEVEL: FROM -> TO: CAUSE (tick N, ...): SENTENCE" (executive/runtime/journal.cpp).
std::optional<ToldTransition> told_by_log(std::string_view line, std::int64_t monotonic_to_unix_ns) {
  constexpr std::string_view kArrow = " -> ", kTick = " (tick ";
  const std::size_t arrow = line.find(kArrow), tick = line.find(kTick);
  const auto unix_ns = unix_ns_at(line);
  std::int64_t at_ns = 0;
  if (arrow == std::string_view::npos || tick == std::string_view::npos || tick < arrow || !unix_ns ||
      __builtin_sub_overflow(*unix_ns, monotonic_to_unix_ns, &at_ns))
    return std::nullopt;
  const std::size_t from = line.rfind(' ', arrow - 1) + 1;
  const std::size_t to_end = line.find(": ", arrow);
  if (to_end == std::string_view::npos || to_end > tick) return std::nullopt;
  std::uint64_t number = 0;
  const char* const digits = line.data() + tick + kTick.size();
  std::from_chars(digits, line.data() + line.size(), number);
  const std::size_t to = arrow + kArrow.size();
  const auto change = change_of(number, MonoTime{at_ns}, line.substr(from, arrow - from), line.substr(to, to_end - to),
                                line.substr(to_end + 2, tick - to_end - 2));
  if (!change) return std::nullopt;
  ToldTransition told{*change, {}, {}, kExecutiveLog};
  for (const std::string_view begins : {"): stop", "): fault"})
    if (const std::size_t at = line.find(begins, tick); at != std::string_view::npos)
      told.sentence = line.substr(at + 3);
  return told;
}

// In order of ticks; of what two tell, the first.
std::vector<ToldTransition> told_elsewhere(const RecordedRun& run) {
  std::vector<ToldTransition> all;
  std::set<std::uint64_t> ticks;
  const auto take = [&](std::optional<ToldTransition> told) {
    if (told && all.size() < kMostTold && ticks.insert(told->change.tick).second) all.push_back(std::move(*told));
  };
  const auto lines_of = [](const std::string& path, const auto& use) {
    const auto text = read_file(path);
    std::istringstream lines(text ? *text : std::string());
    for (std::string line; std::getline(lines, line);) use(line);
  };
  lines_of(run.folder.transitions(), [&](const std::string& line) { take(told_by_line(line)); });
  const std::int64_t offset = run.manifest.clock.monotonic_to_unix_ns;
  lines_of(run.folder.path() + "/" + kExecutiveLog, [&](const std::string& line) { take(told_by_log(line, offset)); });
  std::ranges::stable_sort(all, {}, [](const ToldTransition& each) { return each.change.tick; });
  return all;
}

void join(RunMetrics& metrics, const RecordedRun& run) {
  if (metrics.transition_count > metrics.transitions.size()) return;  // more than are listed
  for (ToldTransition& told : told_elsewhere(run)) {
    const Transition& change = told.change;
    if (std::ranges::find(metrics.transitions, change.tick, &Transition::tick) != metrics.transitions.end()) continue;
    ++metrics.transition_count;
    metrics.transitions.push_back(change);
    if (told.sentence.empty()) continue;
    metrics.stop_origins[change.tick].told_by = told.told_by;
    note(metrics, {.tick = change.tick,
                   .at = change.at,
                   .from = change.from,
                   .to = change.to,
                   .cause = change.cause,
                   .asked = incident::is_asked(change.cause),
                   .detail = std::move(told.detail),
                   .chain = {{change.tick, change.at, fmt::format("{} -> {}", name(change.from), name(change.to))}},
                   .sentence = std::move(told.sentence)});
  }
  std::ranges::stable_sort(metrics.transitions, {}, &Transition::tick);
  std::ranges::stable_sort(metrics.incidents, {}, &incident::Incident::tick);
}

bool moves(Mode mode) {
  return mode == Mode::arming || mode == Mode::tracking || mode == Mode::degraded;
}

std::string in_brackets(const std::string& text) {
  return text.empty() ? text : fmt::format(" ({})", text);
}

// Why the record ends before the run; empty: it does not.
std::string ends_because(const RunMetrics& metrics, const RecordedRun& run, const Script& script) {
  const RunManifest& manifest = run.manifest;
  if (!manifest.stopped_because.empty()) return "recording stopped: " + manifest.stopped_because;
  if (!manifest.complete && is_being_written(run.folder.ticks())) return "the run is still recorded";
  if (!manifest.complete)
    return "the recorder was ended before it closed the run" +
           in_brackets(script.end_of("takt-monitor", manifest.started_at));
  if (!metrics.scan.file.finished) return "ticks.mcap is cut off";
  if (!moves(metrics.last_mode)) return {};
  if (manifest.ended_because == "executive ended")
    return fmt::format("the executive ended while the robot was in {}{}", name(metrics.last_mode),
                       in_brackets(script.end_of("takt-executive", manifest.started_at)));
  return manifest.ended_because == "monitor told to end"
             ? fmt::format("the recorder was told to end while the robot was in {}", name(metrics.last_mode))
             : std::string();
}

// In which the first tick found the robot.
Mode first_mode(const RunMetrics& metrics) {
  return metrics.transitions.empty() ? metrics.last_mode : metrics.transitions.front().from;
}

// What is missing before its last tick; empty: nothing.
std::string holes(const RunMetrics& metrics, const RecordedRun& run) {
  std::string text;
  const auto add = [&text](const std::string& what) { text += (text.empty() ? "" : ", ") + what; };
  const bool is_part = !run.manifest.goes_on_from.empty();
  if (metrics.first_tick > 1 && !is_part && first_mode(metrics) != Mode::standby)
    add(fmt::format("when it began, at tick {}, the robot was in {}", metrics.first_tick, name(first_mode(metrics))));
  if (const std::uint64_t missing = missing_ticks(run.manifest, metrics.ticks); missing != 0)
    add(fmt::format("{} of {} recorded ticks cannot be read", missing, run.manifest.ticks));
  if (metrics.missing_ticks != 0) add(fmt::format("{} ticks are missing in between", metrics.missing_ticks));
  if (metrics.scan.file.damaged_chunks != 0)
    add(fmt::format("{} chunks are damaged", metrics.scan.file.damaged_chunks));
  if (metrics.scan.undecodable != 0) add(fmt::format("{} messages cannot be read", metrics.scan.undecodable));
  return text;
}

std::string gap_of(const RunMetrics& metrics, const RecordedRun& run, const Script& script) {
  const std::string because = ends_because(metrics, run, script), missing = holes(metrics, run);
  if (because.empty()) return missing.empty() ? missing : "the record has holes: " + missing;
  const std::string where = metrics.ticks == 0
                                ? "before its first tick"
                                : fmt::format("{:+.3f} s, tick {}", metrics.span.seconds(), metrics.last_tick);
  return fmt::format("the record ends here ({}): {}{}", where, because, missing.empty() ? "" : "; " + missing);
}

std::vector<CommandSource> sources_in(const std::vector<RunEvent>& events) {
  std::vector<CommandSource> sources;
  for (const RunEvent& event : events)
    if (event.event == kPolicyEvent && event.kind == name(PolicyWordKind::source) && event.is_sealed)
      sources.push_back({event.at, event.role, config::printable(event.what), event.first_sequence, event.superseded});
  std::ranges::stable_sort(sources, {}, &CommandSource::at);
  return sources;
}

std::vector<NotedRequest> requests_in(const std::vector<RunEvent>& events) {
  std::vector<NotedRequest> requests;
  for (const RunEvent& event : events)
    if (event.event == kOperatorEvent && event.is_sealed)
      requests.push_back({event.at, config::printable(event.action), config::printable(event.process),
                          config::printable(event.what), event.pid, event.uid, event.done});
  std::ranges::stable_sort(requests, {}, &NotedRequest::at);
  return requests;
}

// What operators said of their marks: the executive answers "marked tick 700: the gripper slips".
void name_marks(std::vector<Mark>& marks, const std::vector<NotedRequest>& requests) {
  constexpr std::string_view kMarked = "marked tick ";
  for (const NotedRequest& request : requests) {
    if (request.action != name(OperatorVerb::mark) || !request.answer.starts_with(kMarked)) continue;
    const std::size_t colon = request.answer.find(": ", kMarked.size());
    if (colon == std::string::npos) continue;
    const std::string_view tick = std::string_view(request.answer).substr(kMarked.size(), colon - kMarked.size());
    const auto marked =
        std::ranges::find_if(marks, [&](const Mark& mark) { return std::to_string(mark.tick) == tick; });
    if (marked != marks.end()) marked->text = request.answer.substr(colon + 2);
  }
}

}  // namespace

void judge_end(RunMetrics& metrics, const RecordedRun& run) {
  const std::vector<RunEvent> events = read_run_events(run.folder);
  metrics.command_sources = sources_in(events);
  metrics.requests = requests_in(events);
  name_marks(metrics.marks, metrics.requests);
  const Script script(events, run.robot);
  metrics.record_gap = gap_of(metrics, run, script);
  if (!metrics.record_gap.empty()) {
    if (metrics.ticks == 0) metrics.start = run.manifest.started_at;
    join(metrics, run);
    for (MissRate* const misses : {&metrics.misses_per_tick, &metrics.misses_per_command})
      if (misses->verdict == Verdict::held) misses->verdict = Verdict::undecided;
  }
  for (incident::Incident& incident : metrics.incidents) {
    const ScriptFinding found = script.explain(incident);
    if (found.scripted.empty() && found.ended.empty() && found.said.empty()) continue;
    StopOrigin& origin = metrics.stop_origins[incident.tick];
    origin.scripted = found.scripted;
    origin.ended = found.ended;
    origin.said = found.said;
  }
}

}  // namespace takt::monitor

// SPDX-License-Identifier: Apache-2.0
#include "monitor/judge/script.hpp"

#include <fmt/format.h>

#include <algorithm>
#include <initializer_list>
#include <string_view>
#include <utility>

#include "config/printable.hpp"
#include "executive/contract/policy_word.hpp"
#include "executive/incident/log_hint.hpp"
#include "monitor/record/word_log.hpp"

namespace takt::monitor {
namespace {

using Causes = std::uint64_t;
static_assert(kCauseCount <= 64);

constexpr Causes set_of(std::initializer_list<Cause> causes) {
  Causes set = 0;
  for (const Cause cause : causes) set |= Causes{1} << static_cast<unsigned>(cause);
  return set;
}

constexpr Duration kNotedLate = milliseconds(300);  // how long a death may wait for its line
constexpr Causes kPersons = set_of({Cause::operator_stop, Cause::operator_deenergise, Cause::shutdown});
constexpr Causes kAnything = ~kPersons;
constexpr Causes kCommands =
    set_of({Cause::command_lost, Cause::bad_commands, Cause::contract_violated, Cause::command_late,
            Cause::degraded_spent, Cause::fallback_spent, Cause::enable_timeout, Cause::tilt});
constexpr Causes kRecording = set_of({Cause::recording_lost});
constexpr Causes kDrives = kAnything & ~kCommands & ~kRecording & ~set_of({Cause::overrun, Cause::internal_error});

// What a process can stop by not doing its work.
Causes without(std::string_view process) {
  if (process == "takt-policy-host" || process == "takt-policy-host-fallback") return kCommands;
  if (process == "takt-monitor") return kRecording;
  if (process == "takt-plant") return kDrives | set_of({Cause::enable_timeout, Cause::tilt});
  return process == "takt-executive" ? kAnything : 0;
}

Causes effect_of(const RunEvent& event) {
  if (event.event == "fault") return kAnything;  // of a drive, a bus, a sensor or the body
  if (event.event != "script") return 0;
  const std::string_view action = event.action;
  if (action == "kill" || action == "freeze") return without(event.process);
  if (action == "fault") return kCommands;
  if (action == "stop") return set_of({Cause::operator_stop});
  const bool contends = action == "hog" || action == "throttle" || action == "crowd" || action == "load";
  return contends ? kAnything : 0;
}

// A stop of that cause is what such a loss would have led to.
Cause cause_like(Fault fault) {
  switch (fault) {
    case Fault::inference_stall:
    case Fault::middleware_queue_growth:
    case Fault::unknown:
      return Cause::command_lost;
    case Fault::controller_integration_error:
      return Cause::bad_commands;
    case Fault::scheduler_preemption:
    case Fault::platform_stall:
      return Cause::overrun;
    case Fault::sensor_backlog:
    case Fault::estimator_lag:
    case Fault::actuator_or_bus_fault:
      return Cause::feedback_lost;
  }
  return Cause::command_lost;
}

std::string before_text(Duration before) {
  return before < seconds(1) ? fmt::format("{:.0f} ms before", before.milliseconds())
                             : fmt::format("{:.1f} s before", before.seconds());
}

std::string end_text(const RunEvent& end) {
  return fmt::format("{} {}", end.process, end.how);
}

// As seen from `at`, after which its line may have been written.
std::string end_before(const RunEvent& end, MonoTime at) {
  return end_text(end) + (end.at <= at ? ", " + before_text(at - end.at) : "");
}

void replace_in(std::string& text, std::string_view what, std::string_view by) {
  if (const std::size_t at = text.find(what); at != std::string::npos) text.replace(at, what.size(), by);
}

// Behind what was the matter, before what came first and what was done.
void insert_clause(std::string& sentence, const std::string& clause) {
  const std::size_t at = std::min({sentence.find("; first sign "), sentence.find("; done: "), sentence.size()});
  sentence.insert(at, "; " + clause);
}

// The hint gives way to what is known.
std::string clause_of(const ScriptFinding& finding) {
  std::string text = finding.ended.empty() ? finding.said : finding.ended;
  if (!finding.scripted.empty()) text += fmt::format("{}scripted: {}", text.empty() ? "" : "; ", finding.scripted);
  return text;
}

}  // namespace

Script::Script(std::vector<RunEvent> events, const config::RobotConfig& robot)
    : events_(std::move(events)), grace_(robot.freshness.stop_after + seconds(1)) {
  std::ranges::stable_sort(events_, {}, &RunEvent::at);
}

const RunEvent* Script::next(std::string_view event, const RunEvent& since) const {
  const auto found = std::ranges::find_if(events_, [&](const RunEvent& each) {
    return each.at >= since.at && each.event == event && each.process == since.process;
  });
  return found == events_.end() ? nullptr : &*found;
}

MonoTime Script::over_at(const RunEvent& event) const {
  if (event.event == "fault") {
    const std::size_t colon = event.what.find(": ");
    std::string end = event.what;
    if (colon != std::string::npos) end.insert(colon + 2, "end of ");
    const auto found = std::ranges::find(events_, end, &RunEvent::what);
    return found == events_.end() ? MonoTime{} : found->at + grace_;
  }
  if (event.action != "kill" && event.event != "ended") return event.at + event.length + grace_;
  const RunEvent* const again = next("started", event);
  return again == nullptr ? MonoTime{} : again->at + grace_;
}

namespace {

// "sensor cam0: no sample yet" names cam0, and not cam.
bool names_sensor(std::string_view problem, const std::string& sensor) {
  const std::string named = "sensor " + sensor;
  const std::size_t at = problem.find(named), end = at + named.size();
  return at != std::string_view::npos && (end == problem.size() || problem[end] == ':' || problem[end] == ' ');
}

}  // namespace

// Of the sensor's program that `problem` names, where `takt run` started it: it ended, and is not back.
std::string Script::sensors_end(std::string_view problem, MonoTime at) const {
  constexpr std::string_view kLabel = "sensor-";
  std::string text;
  for (const RunEvent& event : events_) {
    const bool is_sensors = event.event == "ended" && event.is_sealed && event.process.starts_with(kLabel) &&
                            names_sensor(problem, event.process.substr(kLabel.size()));
    const RunEvent* const again = is_sensors ? next("started", event) : nullptr;
    if (is_sensors && event.at <= at + kNotedLate && (again == nullptr || at < again->at))
      text = "; " + config::printable(end_before(event, at));
  }
  return text;
}

// Of the robot's policy, at that instant: the newest that its host said, and did not take back.
std::string Script::problem_at(MonoTime at) const {
  const RunEvent* standing = nullptr;
  for (const RunEvent& event : events_) {
    if (event.event != kPolicyEvent || event.kind != name(PolicyWordKind::problem) ||
        event.role != name(Role::policy) || !event.is_sealed)
      continue;
    if (event.at > at + (event.what.empty() ? Duration{} : kNotedLate)) break;
    standing = &event;
  }
  if (standing == nullptr || standing->what.empty()) return {};
  const std::string when = standing->at <= at ? ", " + before_text(at - standing->at) : "";
  return fmt::format("policy: {}{}{}", config::printable(standing->what), when, sensors_end(standing->what, at));
}

ScriptFinding Script::of(Cause cause, MonoTime at) const {
  ScriptFinding finding;
  const Causes this_cause = set_of({cause});
  const auto holds = [&](const RunEvent& event) {
    const MonoTime over = over_at(event);
    return !over.is_set() || at <= over;
  };
  std::string killed;
  for (const RunEvent& event : events_) {
    if (!event.is_sealed || event.at > at || (effect_of(event) & this_cause) == 0 || !holds(event)) continue;
    if (event.event == "fault" && event.what.find(": end of ") != std::string::npos) continue;
    finding.scripted = event.given + (event.what.empty() ? "" : ": " + event.what) + ", " + before_text(at - event.at);
    const RunEvent* const end = event.action == "kill" ? next("ended", event) : nullptr;
    killed = end == nullptr ? std::string() : end_before(*end, at);
  }
  for (const RunEvent& event : events_) {
    if (event.event != "ended" || event.at > at + kNotedLate || (without(event.process) & this_cause) == 0) continue;
    if (holds(event)) finding.ended = end_before(event, at);
  }
  if (!killed.empty()) finding.ended = killed;
  if ((this_cause & kCommands) != 0) finding.said = problem_at(at);
  return finding;
}

std::string Script::end_of(std::string_view process, MonoTime since) const {
  const auto end = std::ranges::find_if(events_, [&](const RunEvent& event) {
    return event.event == "ended" && event.process == process && event.at >= since;
  });
  return end == events_.end() ? std::string() : end_text(*end);
}

ScriptFinding Script::explain(incident::Incident& incident) const {
  ScriptFinding finding = of(incident.cause, incident.at);
  const std::string clause = clause_of(finding);
  if (clause.empty()) return finding;
  const bool has_hint = incident.detail.find(incident::kPolicyLogHint) != std::string::npos;
  for (std::string* const text : {&incident.detail, &incident.sentence})
    replace_in(*text, incident::kPolicyLogHint, clause);
  if (!has_hint) insert_clause(incident.sentence, clause);
  if (finding.scripted.empty() || incident.asked) return finding;
  incident.asked = true;
  replace_in(incident.sentence, " at tick ", " asked for at tick ");
  return finding;
}

void Script::explain(FaultSummary& faults) const {
  for (FaultVerdict& verdict : faults.verdicts) {
    const ScriptFinding finding = of(cause_like(verdict.fault), verdict.at);
    const std::string clause = clause_of(finding);
    if (clause.empty()) continue;
    const bool has_hint = verdict.sentence.find(incident::kPolicyLogHint) != std::string::npos;
    if (has_hint) replace_in(verdict.sentence, incident::kPolicyLogHint, clause);
    if (!has_hint) verdict.sentence += "; " + clause;
  }
}

}  // namespace takt::monitor

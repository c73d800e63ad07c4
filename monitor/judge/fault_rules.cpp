// SPDX-License-Identifier: Apache-2.0
// The rules of the fault classifier, in the order the header gives them.
#include <fmt/format.h>

#include <algorithm>
#include <map>
#include <string_view>

#include "executive/incident/log_hint.hpp"
#include "monitor/judge/fault_classifier.hpp"

namespace takt::monitor {
namespace {

constexpr std::array<std::string_view, 4> kParts{"tau_sense", "tau_queue", "tau_infer", "tau_publish"};
enum Part : std::size_t { sense, queue, infer, publish };

using Judged = std::optional<FaultVerdict>;

constexpr Duration kStandstill = milliseconds(20);  // of the loop: a drive may stop for want of commands

Duration half(Duration duration) {
  return {duration.ns / 2};
}

struct Case {
  const FaultEvidence& evidence;
  const FaultBaseline& baseline;
  const FaultRules& rules;

  [[nodiscard]] FaultVerdict verdict(Fault fault, const std::string& why) const {
    return {.fault = fault,
            .first_tick = evidence.first_tick,
            .last_tick = evidence.last_tick,
            .at = evidence.at,
            .sentence = fmt::format("{}: {}", name(fault), why),
            .gravity = evidence.gravity,
            .lateness = evidence.worst_lateness,
            .missed_ticks = evidence.missed_ticks,
            .troubled_ticks = evidence.troubled_ticks};
  }
  [[nodiscard]] Duration excess(Part part) const { return evidence.worst_parts[part] - baseline.parts[part]; }
  [[nodiscard]] std::string part_text(Part part) const {
    return fmt::format("{} {:.3g} ms against a median of {:.3g} ms", kParts[part],
                       evidence.worst_parts[part].milliseconds(), baseline.parts[part].milliseconds());
  }
  [[nodiscard]] std::string feedback_text() const {
    const std::string joint = evidence.feedback_joint < rules.joints.size()
                                  ? rules.joints[evidence.feedback_joint]
                                  : fmt::format("{}", evidence.feedback_joint);
    return fmt::format("feedback of joint {} was {:.3g} ms old against a median of {:.3g} ms", joint,
                       evidence.feedback_age.milliseconds(), baseline.feedback_age.milliseconds());
  }
};

// A loop that slept for a moment does not explain a command that stayed away for long.
bool is_too_short_for_the_silence(const Case& c) {
  const FaultEvidence& evidence = c.evidence;
  const Duration lost = evidence.worst_lateness + c.rules.period * static_cast<std::int64_t>(evidence.skipped);
  return evidence.has_miss && evidence.silence > c.rules.max_age && lost < half(evidence.silence);
}

Judged lost_period(const Case& c) {
  const FaultEvidence& evidence = c.evidence;
  if (is_too_short_for_the_silence(c)) return {};
  const std::string what =
      fmt::format("the control loop woke up to {:.3g} ms late, {} periods skipped, cause recorded: {}",
                  evidence.worst_lateness.milliseconds(), evidence.skipped, takt::name(evidence.overrun));
  switch (evidence.overrun) {
    case OverrunCause::preempted:
    case OverrunCause::blocked:
      return c.verdict(Fault::scheduler_preemption, what);
    case OverrunCause::own_overrun:
      return c.verdict(Fault::controller_integration_error, what);
    case OverrunCause::page_fault:
    case OverrunCause::platform_stall:
      return c.verdict(Fault::platform_stall, what);
    case OverrunCause::none:
      if (evidence.skipped != 0 || evidence.worst_lateness >= c.rules.period) {
        return c.verdict(Fault::platform_stall, what);
      }
      return {};
  }
  return {};
}

// Who sleeps hears nothing: feedback that grew old while the loop stood still says nothing of drives or buses.
bool slept_through_the_feedback(const Case& c) {
  const FaultEvidence& evidence = c.evidence;
  const Duration awake = evidence.feedback_age - evidence.worst_lateness;
  return evidence.worst_lateness >= c.rules.period && awake <= c.baseline.feedback_age + c.rules.period * 2;
}

// The computer slept: no other rule can say anything of it.
Judged suspended(const Case& c) {
  if (c.evidence.slept_ms == 0) return {};
  return c.verdict(Fault::platform_stall,
                   fmt::format("the computer was suspended for {:.1f} s", c.evidence.slept_ms / 1000.0));
}

// A drive whose commands stay away ends by itself what it does.
bool made_a_drive_stop(const Case& c) {
  const FaultEvidence& evidence = c.evidence;
  return (evidence.fault_cause == Cause::drive_fault || evidence.fault_cause == Cause::drive_disabled) &&
         evidence.worst_lateness >= kStandstill;
}

// A lost reply leaves a joint old until the next one; late replies come and leave it old.
bool replies_are_late(const FaultEvidence& evidence) {
  return evidence.old_replied_ticks != 0 && evidence.old_replied_ticks * 10 >= evidence.old_ticks;
}

Judged drives_and_buses(const Case& c) {
  const FaultEvidence& evidence = c.evidence;
  const bool feedback_lost = evidence.fault_cause == Cause::feedback_lost;
  if (!evidence.bus_was_bad && ((feedback_lost && slept_through_the_feedback(c)) || made_a_drive_stop(c))) {
    if (auto lost = lost_period(c)) return lost;
  }
  if (feedback_lost && !evidence.bus_was_bad && replies_are_late(evidence)) {
    return c.verdict(Fault::estimator_lag, fmt::format("{}, though {} of {} replies came", c.feedback_text(),
                                                       evidence.replies, evidence.replies_due));
  }
  if (evidence.fault_cause != Cause::none) {
    return c.verdict(Fault::actuator_or_bus_fault,
                     fmt::format("the executive reacted to {}, {} of {} replies came", takt::name(evidence.fault_cause),
                                 evidence.replies, evidence.replies_due));
  }
  if (evidence.bus_was_bad) return c.verdict(Fault::actuator_or_bus_fault, "a bus was bus-off or down");
  return {};
}

// Wrong targets are what comes of it.
Judged sensor_content(const Case& c) {
  const WrongContent& content = c.evidence.content;
  if (content.frozen_samples + content.mirrored_samples == 0) return {};
  const auto& sensors = c.rules.content.sensors;
  const std::string sensor =
      content.sensor < sensors.size() ? sensors[content.sensor].name : fmt::format("{}", content.sensor);
  if (content.frozen_samples >= content.mirrored_samples)
    return c.verdict(
        Fault::sensor_backlog,
        fmt::format("sensor {} repeated its values under fresh stamps in {} samples", sensor, content.frozen_samples));
  return c.verdict(Fault::sensor_backlog,
                   fmt::format("values of sensor {} were the opposite of those before in {} samples", sensor,
                               content.mirrored_samples));
}

Judged integration(const Case& c) {
  const FaultEvidence& evidence = c.evidence;
  if (!evidence.refusals.empty()) {
    std::string list;
    for (const auto& [arrival, count] : evidence.refusals) {
      list += fmt::format("{}{} {}", list.empty() ? "" : ", ", takt::name(arrival), count);
    }
    return c.verdict(Fault::controller_integration_error, fmt::format("commands refused: {}", list));
  }
  if (evidence.ran_backwards != 0) {
    return c.verdict(Fault::controller_integration_error,
                     fmt::format("stamps of {} commands ran backwards", evidence.ran_backwards));
  }
  if (evidence.clamped_ticks != 0) {
    return c.verdict(Fault::controller_integration_error,
                     fmt::format("targets out of their joints' range in {} ticks", evidence.clamped_ticks));
  }
  if (evidence.content.reordered_joints != 0) {
    return c.verdict(
        Fault::controller_integration_error,
        fmt::format("{} joints were given one another's targets: is the policy's order of joints the robot's?",
                    evidence.content.reordered_joints));
  }
  if (evidence.bad_commands)
    return c.verdict(Fault::controller_integration_error, "the executive gave up on bad commands");
  return {};
}

Judged base_sensor(const Case& c) {
  if (!c.evidence.imu_lost) return {};
  return c.verdict(Fault::sensor_backlog, "the base's IMU gave no usable sample");
}

Judged age_part(const Case& c) {
  if (!c.evidence.has_miss) return {};
  Part worst = sense;
  for (const Part part : {queue, infer, publish}) worst = c.excess(part) > c.excess(worst) ? part : worst;
  if (c.excess(worst).ns * 5 < c.rules.max_age.ns) return {};
  if (c.evidence.worst_lateness >= half(c.excess(worst))) {
    if (auto lost = lost_period(c)) return lost;
  }
  switch (worst) {
    case infer:
      return c.verdict(Fault::inference_stall, c.part_text(infer));
    case queue:
      return c.verdict(Fault::middleware_queue_growth, c.part_text(queue));
    case publish:
      return c.verdict(Fault::middleware_queue_growth, c.part_text(publish));
    case sense:
      break;
  }
  if (c.evidence.feedback_age - c.baseline.feedback_age >= half(c.excess(sense))) {
    return c.verdict(Fault::estimator_lag, fmt::format("{}; {}", c.part_text(sense), c.feedback_text()));
  }
  return c.verdict(Fault::sensor_backlog, fmt::format("{}, while joint feedback was at most {:.3g} ms old",
                                                      c.part_text(sense), c.evidence.feedback_age.milliseconds()));
}

Judged silence(const Case& c) {
  if (!c.evidence.has_miss) return {};
  if (c.evidence.silence <= c.rules.max_age) {
    if (!c.evidence.other_session) return {};
    return c.verdict(Fault::inference_stall,
                     fmt::format("no command came for {:.3g} ms, and the next were another policy process's",
                                 c.evidence.silence.milliseconds()));
  }
  const Duration sense_excess = c.evidence.sense_before - c.baseline.parts[sense];
  if (sense_excess.ns * 5 >= c.rules.max_age.ns)
    return c.verdict(
        Fault::sensor_backlog,
        fmt::format("no command came for {:.4g} ms after one with tau_sense {:.3g} ms against a median of {:.3g} ms",
                    c.evidence.silence.milliseconds(), c.evidence.sense_before.milliseconds(),
                    c.baseline.parts[sense].milliseconds()));
  return c.verdict(Fault::inference_stall, fmt::format("no command came for {:.4g} ms, max_age is {:.3g} ms; {}",
                                                       c.evidence.silence.milliseconds(),
                                                       c.rules.max_age.milliseconds(), incident::kPolicyLogHint));
}

Judged lost_replies(const Case& c) {
  const std::uint64_t due = c.evidence.replies_due;
  const std::uint64_t lost = due - std::min(due, c.evidence.replies);
  if (lost * 10 <= due) return {};
  return c.verdict(Fault::actuator_or_bus_fault, fmt::format("{} of {} replies did not come", lost, due));
}

FaultVerdict unknown(const Case& c) {
  Part worst = sense;
  for (const Part part : {queue, infer, publish}) worst = c.excess(part) > c.excess(worst) ? part : worst;
  return c.verdict(Fault::unknown, fmt::format("nothing stands out; the nearest is {}", c.part_text(worst)));
}

}  // namespace

FaultVerdict judge(const FaultEvidence& evidence, const FaultBaseline& baseline, const FaultRules& rules) {
  const Case judged{evidence, baseline, rules};
  for (const auto rule : {suspended, drives_and_buses, sensor_content, integration, base_sensor, age_part, lost_period,
                          silence, lost_replies}) {
    if (auto verdict = rule(judged)) return std::move(*verdict);
  }
  return unknown(judged);
}

namespace {

bool holds(const std::vector<FaultVerdict>& verdicts, Fault fault) {
  return std::ranges::find(verdicts, fault, &FaultVerdict::fault) != verdicts.end();
}

// What no drive or bus explains may have more than one cause. The first is the one that judge() finds.
std::vector<FaultVerdict> causes_of(const Case& c) {
  std::vector<FaultVerdict> causes{judge(c.evidence, c.baseline, c.rules)};
  if (suspended(c) || drives_and_buses(c)) return causes;
  const auto add = [&](Judged verdict) {
    if (verdict && !holds(causes, verdict->fault)) causes.push_back(std::move(*verdict));
  };
  if (sensor_content(c) || integration(c) || base_sensor(c)) add(age_part(c));
  add(lost_period(c));
  return causes;
}

// Of one cause in a stretch.
struct Explained {
  FaultEvidence evidence;  // of its segments
  FaultVerdict worst;      // of the segment with the most troubled ticks
};
using ByCause = std::map<Fault, Explained>;

void add_to(ByCause& by_cause, const FaultVerdict& verdict, const FaultEvidence& segment) {
  const auto [found, is_new] = by_cause.emplace(verdict.fault, Explained{segment, verdict});
  if (is_new) return;
  found->second.evidence.take(segment);
  if (verdict.troubled_ticks > found->second.worst.troubled_ticks) found->second.worst = verdict;
}

// Segments that nothing explains go with the one before, at the beginning with the one behind.
ByCause explained_by_cause(const FaultStretch& stretch, const FaultBaseline& baseline, const FaultRules& rules) {
  ByCause by_cause;
  FaultEvidence unexplained;
  std::optional<Fault> before;
  for (const FaultEvidence& segment : stretch.segments) {
    if (!segment.at.is_set()) continue;
    const auto causes = causes_of({segment, baseline, rules});
    if (causes.front().fault == Fault::unknown && causes.size() == 1) {
      (before ? by_cause.at(*before).evidence : unexplained).take(segment);
      continue;
    }
    for (const FaultVerdict& verdict : causes)
      if (verdict.fault != Fault::unknown) add_to(by_cause, verdict, segment);
    const Fault named = causes.front().fault == Fault::unknown ? causes.back().fault : causes.front().fault;
    if (!before) by_cause.at(named).evidence.take(unexplained);
    before = named;
  }
  return by_cause;
}

// Less than a telling share of the stretch, and no stop.
bool is_slight(const Explained& one, const ByCause& by_cause) {
  std::uint64_t all = 0;
  for (const auto& [fault, each] : by_cause) all += each.evidence.troubled_ticks;
  return one.evidence.gravity != Gravity::stopped &&
         static_cast<double>(one.evidence.troubled_ticks) < kTellingShare * static_cast<double>(all);
}

FaultVerdict verdict_of(Fault fault, const Explained& one, const FaultBaseline& baseline, const FaultRules& rules) {
  FaultVerdict verdict = judge(one.evidence, baseline, rules);
  if (verdict.fault == fault) return verdict;
  const std::string sentence = one.worst.sentence;
  verdict.fault = fault;
  verdict.sentence = sentence;
  return verdict;
}

}  // namespace

std::vector<FaultVerdict> judge(const FaultStretch& given, const FaultBaseline& baseline, const FaultRules& rules) {
  FaultStretch stretch = given;
  if (met_wrong_sensing(stretch.whole)) {
    for (FaultEvidence& segment : stretch.segments) {
      segment.clamped_ticks = 0;
      segment.bad_commands = segment.bad_commands && !segment.refusals.empty();
    }
  }
  const ByCause by_cause = explained_by_cause(stretch, baseline, rules);
  FaultVerdict whole = judge(stretch.whole, baseline, rules);
  std::vector<FaultVerdict> verdicts;
  for (const auto& [fault, one] : by_cause)
    if (!is_slight(one, by_cause)) verdicts.push_back(verdict_of(fault, one, baseline, rules));
  if (verdicts.empty() || (verdicts.size() == 1 && verdicts.front().fault == whole.fault)) {
    whole.troubled_ticks = 0;
    for (const FaultEvidence& segment : stretch.segments) whole.troubled_ticks += segment.troubled_ticks;
    return {std::move(whole)};
  }
  return verdicts;
}

namespace {

struct Line {
  std::string text;
  std::uint64_t verdicts = 1;  // that it stands for
};
using Lines = std::vector<Line>;

Line line_of_late(const std::vector<const FaultVerdict*>& late) {
  const FaultVerdict& worst = **std::ranges::max_element(late, {}, [](const auto* each) { return each->lateness; });
  if (late.size() == 1) return {fmt::format("  tick {:>9}  no miss: {}\n", worst.first_tick, worst.sentence)};
  return {fmt::format("  {:>14}  no miss: {}: the control loop woke up late, at tick {} by {:.3g} ms\n",
                      fmt::format("{} times", late.size()), name(worst.fault), worst.first_tick,
                      worst.lateness.milliseconds()),
          late.size()};
}

// The gravest first; what cost nothing but late wake-ups comes last, a line for each fault.
Lines lines_of(const FaultSummary& summary) {
  Lines lines;
  std::array<std::vector<const FaultVerdict*>, kFaultCount> late;
  const std::vector<FaultVerdict> verdicts = by_gravity(summary.verdicts);
  for (const FaultVerdict& verdict : verdicts) {
    if (verdict.gravity == Gravity::late) {
      late[static_cast<std::size_t>(verdict.fault)].push_back(&verdict);
      continue;
    }
    lines.push_back({fmt::format("  tick {:>9}  {}{}\n", verdict.first_tick,
                                 verdict.gravity == Gravity::stopped ? "STOPPED: " : "", verdict.sentence)});
  }
  for (const auto& same : late)
    if (!same.empty()) lines.push_back(line_of_late(same));
  return lines;
}

}  // namespace

std::string fault_text(const FaultSummary& summary, std::size_t most_sentences) {
  std::string text;
  for (std::size_t index = 0; index < kFaultCount; ++index) {
    if (summary.counts[index] == 0) continue;
    text += fmt::format("{}{} {}", text.empty() ? "" : ", ", kFaultNames[index], summary.counts[index]);
  }
  text = fmt::format("faults        {}\n", text.empty() ? "none" : text);
  const Lines found = lines_of(summary);
  for (std::size_t index = 0; index < std::min(most_sentences, found.size()); ++index) text += found[index].text;
  std::uint64_t told = 0;
  for (std::size_t index = 0; index < std::min(most_sentences, found.size()); ++index) told += found[index].verdicts;
  if (summary.total() > told) text += fmt::format("  and {} more\n", summary.total() - told);
  return text;
}

nlohmann::ordered_json to_json(const FaultSummary& summary) {
  nlohmann::ordered_json json{{"counts", nlohmann::ordered_json::object()},
                              {"verdicts", nlohmann::ordered_json::array()}};
  for (std::size_t index = 0; index < kFaultCount; ++index) json["counts"][kFaultNames[index]] = summary.counts[index];
  for (const FaultVerdict& verdict : summary.verdicts) {
    json["verdicts"].push_back({{"fault", name(verdict.fault)},
                                {"first_tick", verdict.first_tick},
                                {"last_tick", verdict.last_tick},
                                {"gravity", name(verdict.gravity)},
                                {"missed_ticks", verdict.missed_ticks},
                                {"sentence", verdict.sentence}});
  }
  return json;
}

}  // namespace takt::monitor

// SPDX-License-Identifier: Apache-2.0
#include "evidence/review/report/report_text.hpp"

#include <fmt/format.h>

#include <algorithm>
#include <iterator>
#include <numeric>

#include "config/printable.hpp"
#include "monitor/record/standby_thinner.hpp"

namespace takt::evidence {
namespace {

constexpr std::size_t kShownIncidents = 5;

double ms(double ns) {
  return ns * 1e-6;
}

double percent(std::uint64_t part, std::uint64_t whole) {
  return whole == 0 ? 0.0 : 100.0 * static_cast<double>(part) / static_cast<double>(whole);
}

std::string age_row(std::string_view label, const monitor::Quantiles& q) {
  return fmt::format("  {:<8}{:>10.3f}{:>10.3f}{:>10.3f}{:>10}{:>10.3f}\n", label, ms(q.p50), ms(q.p95), ms(q.p99),
                     q.p999 ? fmt::format("{:.3f}", ms(*q.p999)) : "-", ms(q.max));
}

// What nothing was found of: in a record that does not reach the run's end that is not nothing.
std::string_view none_in(const monitor::RunMetrics& metrics) {
  return metrics.record_gap.empty() ? "none" : "unknown";
}

std::string age_table(const monitor::RunMetrics& metrics, std::string_view title,
                      const std::array<monitor::Quantiles, monitor::kAgePartCount>& parts, std::size_t rows) {
  if (parts.back().count == 0) return fmt::format("{}: {}\n", title, none_in(metrics));
  std::string text = fmt::format("{} ({}), ms\n  {:<8}{:>10}{:>10}{:>10}{:>10}{:>10}\n", title, parts.back().count, "",
                                 "p50", "p95", "p99", "p99.9", "max");
  for (std::size_t part = 0; part < rows; ++part) text += age_row(monitor::kAgePartNames[part], parts[part]);
  return text + age_row(monitor::kAgePartNames.back(), parts.back());
}

// What outside sensors add to `sense`. Nothing of a robot without any, or whose policy's inputs are not recorded.
std::string sensor_lines(const monitor::RunMetrics& metrics) {
  std::string text;
  for (const monitor::SensorAge& one : metrics.sensors)
    text += fmt::format(
        "  of which sensor {}, when asked: p50 {:.3f}, p99 {:.3f}, max {:.3f}; the oldest of {:.1f} % of {} answers\n",
        one.sensor, ms(one.age.p50), ms(one.age.p99), ms(one.age.max), percent(one.oldest, one.age.count),
        one.age.count);
  return text;
}

// Of samples that depend on each other.
std::string worth(const monitor::MissRate& misses) {
  if (misses.effective_count >= static_cast<double>(misses.count)) return {};
  return fmt::format(" (they say as much as {:.0f} independent ones)", misses.effective_count);
}

std::string miss_row(std::string_view label, const monitor::MissRate& misses, double confidence) {
  if (misses.count == 0) return fmt::format("  {:<12} nothing to judge\n", label);
  return fmt::format("  {:<12} {} of {} missed = {:.3f} %, at most {:.3f} % with {:.0f} % confidence{}: {}\n", label,
                     misses.misses, misses.count, 100 * misses.rate, 100 * misses.upper_bound, 100 * confidence,
                     worth(misses), name(misses.verdict));
}

// "a 3, b 1" of the non-zero counts from `first` on; "none" without any.
template <class NameOf, std::size_t size>
std::string counted(const monitor::RunMetrics& metrics, const std::array<std::uint64_t, size>& counts,
                    std::size_t first, const NameOf& name_of) {
  std::string text;
  for (std::size_t index = first; index < size; ++index) {
    if (counts[index] == 0) continue;
    text += fmt::format("{}{} {}", text.empty() ? "" : ", ", name_of(index), counts[index]);
  }
  return text.empty() ? std::string(none_in(metrics)) : text;
}

std::string modes_line(const monitor::RunMetrics& metrics) {
  std::string text;
  for (std::size_t mode = 0; mode < kModeCount; ++mode) {
    if (metrics.ticks_in_mode[mode] == 0) continue;
    text += fmt::format("{}{} {:.1f} %", text.empty() ? "" : ", ", takt::name(static_cast<Mode>(mode)),
                        percent(metrics.ticks_in_mode[mode], metrics.ticks));
  }
  const std::uint64_t fallback = metrics.ticks_of_player[static_cast<std::size_t>(Player::fallback)];
  if (fallback != 0) text += fmt::format("; moved by the fallback policy {:.1f} %", percent(fallback, metrics.ticks));
  if (const std::uint64_t without = metrics.ticks_without_fallback; without != 0)
    text += fmt::format("; without a fresh fallback policy {:.1f} %", percent(without, metrics.ticks));
  return text.empty() ? fmt::format("{}: not one tick can be read", none_in(metrics)) : text;
}

std::string transitions(const monitor::RunMetrics& metrics, std::size_t most) {
  if (metrics.transition_count == 0) return fmt::format("transitions   {}\n", none_in(metrics));
  std::string text = fmt::format("transitions   {}\n", metrics.transition_count);
  for (std::size_t index = 0; index < std::min(most, metrics.transitions.size()); ++index) {
    const monitor::Transition& each = metrics.transitions[index];
    text +=
        fmt::format("  tick {:>9}  {:>+10.3f} s  {:<13} -> {:<13} {}\n", each.tick, (each.at - metrics.start).seconds(),
                    takt::name(each.from), takt::name(each.to), takt::name(each.cause));
  }
  if (metrics.transition_count > most) text += fmt::format("  and {} more\n", metrics.transition_count - most);
  return text;
}

// Of a run in which nothing could stop; empty: it was armed.
std::string never_armed(const monitor::RunMetrics& metrics) {
  if (metrics.ticks == 0 || metrics.ticks_in_mode[static_cast<std::size_t>(Mode::standby)] != metrics.ticks) return "";
  const auto is_refusal = [](const monitor::NotedRequest& request) { return request.action == "arm" && !request.done; };
  const auto last = std::find_if(metrics.requests.rbegin(), metrics.requests.rend(), is_refusal);
  return last == metrics.requests.rend() ? ": it was never armed"
                                         : fmt::format(": it was never armed, refused by: {}", last->answer);
}

// What stopped the robot comes first of all: nothing else on the page matters as much.
std::string incidents(const monitor::RunMetrics& metrics, std::size_t most) {
  if (metrics.incident_count == 0 && metrics.record_gap.empty())
    return fmt::format("stops         none{}\n", never_armed(metrics));
  std::string text;
  std::size_t shown = 0;
  for (const incident::Incident& incident : monitor::by_gravity(metrics.incidents)) {
    if (shown++ == most) break;
    text += fmt::format("{:<14}{:+.3f} s: {}\n", incident.asked ? "asked" : "STOPPED",
                        (incident.at - metrics.start).seconds(), incident.sentence);
    if (!incident.counterfactual.empty()) text += fmt::format("{:<14}{}\n", "", incident.counterfactual);
    const auto origin = metrics.stop_origins.find(incident.tick);
    if (origin != metrics.stop_origins.end() && !origin->second.told_by.empty())
      text += fmt::format("{:<14}told by {}, beyond the ticks that can be read\n", "", origin->second.told_by);
  }
  if (metrics.incident_count > most) text += fmt::format("              and {} more\n", metrics.incident_count - most);
  if (!metrics.record_gap.empty())
    text += fmt::format("UNKNOWN       {}{}\n",
                        metrics.incident_count == 0 ? "stops: " : "further stops: ", metrics.record_gap);
  return text;
}

std::string marks(const monitor::RunMetrics& metrics, std::size_t most) {
  if (metrics.mark_count == 0) return fmt::format("marks         {}\n", none_in(metrics));
  std::string text = fmt::format("marks         {}\n", metrics.mark_count);
  for (std::size_t index = 0; index < std::min(most, metrics.marks.size()); ++index) {
    const monitor::Mark& each = metrics.marks[index];
    text += fmt::format("  tick {:>9}  {:>+10.3f} s{}{}\n", each.tick, (each.at - metrics.start).seconds(),
                        each.text.empty() ? "" : "  ", each.text);
  }
  if (metrics.mark_count > most) text += fmt::format("  and {} more\n", metrics.mark_count - most);
  return text;
}

bool are_alike(const monitor::NotedRequest& one, const monitor::NotedRequest& other) {
  return one.action == other.action && one.pid == other.pid && one.uid == other.uid && one.done == other.done &&
         one.answer == other.answer;
}

// Who armed, stopped and reset; one line for what was asked again and again. Nothing where no recorder was told.
std::string requests(const monitor::RunMetrics& metrics, std::size_t most) {
  if (metrics.requests.empty()) return "";
  std::string text = fmt::format("requests      {}\n", metrics.requests.size());
  const auto end = metrics.requests.end();
  std::size_t lines = 0;
  auto each = metrics.requests.begin();
  while (each != end && lines++ < most) {
    const auto next =
        std::find_if_not(each, end, [&](const monitor::NotedRequest& other) { return are_alike(*each, other); });
    const auto times = std::distance(each, next);
    text += fmt::format("  {:>+10.3f} s  {} by pid {} ({}), user {}{}{}\n", (each->at - metrics.start).seconds(),
                        each->action, each->pid, each->program, each->uid,
                        each->done ? "" : fmt::format(": refused: {}", each->answer),
                        times == 1 ? "" : fmt::format(" ({} times)", times));
    each = next;
  }
  if (each != end) text += fmt::format("  and {} more\n", std::distance(each, end));
  return text;
}

// Nothing where the policies' hosts made their commands themselves, or did not say who did.
std::string command_sources(const monitor::RunMetrics& metrics, std::size_t most) {
  std::string text;
  for (std::size_t index = 0; index < std::min(most, metrics.command_sources.size()); ++index) {
    const monitor::CommandSource& each = metrics.command_sources[index];
    text += fmt::format(
        "  {:>+10.3f} s  {}: from command {} on of {}{}\n", (each.at - metrics.start).seconds(), each.role,
        each.first_sequence, each.what.empty() ? "the policy itself" : each.what,
        each.superseded == 0 ? "" : fmt::format("; {} others before it were not recorded", each.superseded));
  }
  if (metrics.command_sources.size() > most)
    text += fmt::format("  and {} more\n", metrics.command_sources.size() - most);
  return text;
}

// Nothing where no candidate ever ran.
std::string candidate(const monitor::RunMetrics& metrics, std::size_t most) {
  if (!metrics.candidate) return "";
  const monitor::CandidateMetrics& beside = *metrics.candidate;
  std::string text = fmt::format(
      "candidate     {:.1f} % of {} ticks fresh; age p50 {:.1f} ms, p99 {:.1f} ms; targets differ p50 {:.4f}, p99 "
      "{:.4f}, "
      "largest {:.4f} rad; {} ticks beyond a range, {} beyond limits\n",
      percent(beside.fresh_ticks, beside.ticks), beside.ticks, beside.age.p50 * 1e-6, beside.age.p99 * 1e-6,
      beside.distance.p50 * 1e-9, beside.distance.p99 * 1e-9, beside.distance.max * 1e-9, beside.ticks_beyond_range,
      beside.ticks_beyond_limits);
  for (std::size_t index = 0; index < std::min(most, metrics.policy_changes.size()); ++index) {
    const monitor::NotedPolicyChange& each = metrics.policy_changes[index];
    text += fmt::format("  tick {:>9}  {:>+10.3f} s  {}: {} is in charge\n", each.tick,
                        (each.at - metrics.start).seconds(), takt::name(each.change),
                        each.candidate_in_charge ? fmt::format("candidate {:016x}", each.candidate)
                                                 : std::string("the robot's own policy"));
  }
  if (metrics.policy_change_count > most) text += fmt::format("  and {} more\n", metrics.policy_change_count - most);
  return text;
}

// Nothing where the robot file has no monitors: silence would sound like a judgement.
std::string catches(const monitor::RunMetrics& metrics, const monitor::RecordedRun& run, std::size_t most) {
  if (!run.robot.policy || !run.robot.policy->monitors) return "";
  if (metrics.catch_count == 0) return fmt::format("catches       {}\n", none_in(metrics));
  std::string text = fmt::format("catches       {}\n", metrics.catch_count);
  for (std::size_t index = 0; index < std::min(most, metrics.catches.size()); ++index) {
    const monitor::PolicyCatch& each = metrics.catches[index];
    text +=
        fmt::format("  tick {:>9}  {:>+10.3f} s  {}\n", each.tick, (each.at - metrics.start).seconds(), each.sentence);
  }
  if (metrics.catch_count > most) text += fmt::format("  and {} more\n", metrics.catch_count - most);
  return text;
}

// Nothing where `model` fits, or there is none.
std::string loads(const monitor::RunMetrics& metrics, const monitor::RecordedRun& run, std::size_t most) {
  std::string text;
  for (std::size_t index = 0; index < std::min(most, metrics.load_mismatches.size()); ++index)
    text +=
        fmt::format("{:<14}{}\n", index == 0 ? "masses" : "", sentence_of(metrics.load_mismatches[index], run.robot));
  if (metrics.load_mismatches.size() > most)
    text += fmt::format("{:<14}and {} more\n", "", metrics.load_mismatches.size() - most);
  return text;
}

std::string on_wire(const monitor::RunMetrics& metrics, const monitor::RecordedRun& run) {
  std::string text;
  for (std::size_t bus = 0; bus < std::min(run.robot.buses.size(), kMaxBuses); ++bus) {
    const monitor::Quantiles& all = metrics.tick_to_wire[bus];
    if (all.count == 0) continue;
    text += fmt::format("{}{} p50 {:.0f} us, p99 {:.0f} us", text.empty() ? "" : "; ", run.robot.buses[bus].name,
                        all.p50 * 1e-3, all.p99 * 1e-3);
  }
  if (text.empty()) return "";
  const monitor::Quantiles& age = metrics.age_on_wire;
  return fmt::format("tick to wire  {}; a command's age there p50 {:.1f} ms, p99 {:.1f} ms, largest {:.1f} ms\n", text,
                     age.p50 * 1e-6, age.p99 * 1e-6, age.max * 1e-6);
}

std::string losses(const monitor::RunMetrics& metrics, const monitor::RecordedRun& run) {
  std::string text;
  for (const auto& [what, count] : metrics.losses) {
    text += fmt::format("{}{} {}", text.empty() ? "" : ", ", what, count == 0 ? "from then on" : std::to_string(count));
  }
  if (metrics.missing_ticks != 0)
    text += fmt::format("{}{} ticks", text.empty() ? "" : "; in all ", metrics.missing_ticks);
  if (text.empty()) text = none_in(metrics);
  text = fmt::format("losses        {}\n", text);
  if (metrics.stood_by_ticks != 0)
    text += fmt::format("standby       one tick in {} kept; {} that stood by were left out\n",
                        monitor::StandbyThinner::kOneIn, metrics.stood_by_ticks);
  if (!run.manifest.stopped_because.empty()) {
    text += fmt::format("              recording stopped: {}\n", run.manifest.stopped_because);
  }
  if (!metrics.scan.file.finished) {
    text += "              ticks.mcap was not closed: the monitor was cut off, or the file is not whole\n";
  }
  if (metrics.ticks < run.manifest.ticks) {
    text += fmt::format("              {} of {} recorded ticks cannot be read\n", run.manifest.ticks - metrics.ticks,
                        run.manifest.ticks);
  }
  if (metrics.scan.file.damaged_chunks != 0) {
    text += fmt::format("              damaged chunks, skipped: {}\n", metrics.scan.file.damaged_chunks);
  }
  if (metrics.scan.undecodable != 0) {
    text += fmt::format("              messages that are not what their topic says, skipped: {}\n",
                        metrics.scan.undecodable);
  }
  return text;
}

// Essential steps make it real time; what else could not be had is said beside.
std::string realtime_words(const monitor::RunManifest& manifest) {
  if (!manifest.executive.is_object() || !manifest.executive.contains("realtime")) return "unknown";
  if (!manifest.executive.at("realtime").get<bool>()) return "NO: figures do not stand for a real-time machine";
  std::string words = "yes";
  for (const auto& step : manifest.executive.value("realtime_steps", nlohmann::ordered_json::array()))
    if (!step.value("ok", true))
      words += fmt::format("; but {}: {}", step.value("name", "a step"), step.value("detail", ""));
  return words;
}

// Empty: the folder holds the whole session.
std::string part_line(const monitor::RunManifest& manifest) {
  std::string text;
  if (!manifest.goes_on_from.empty()) text += "goes on from " + config::printable(manifest.goes_on_from);
  if (!manifest.goes_on_in.empty())
    text += (text.empty() ? "goes on in " : ", goes on in ") + config::printable(manifest.goes_on_in);
  return text.empty() ? text : fmt::format("part          {}\n", text);
}

// Empty: the robot could not move unrecorded.
std::string_view recorder_line(const monitor::RunManifest& manifest) {
  const bool optional = manifest.executive.is_object() && manifest.executive.value("recorder", "") == "optional";
  return optional ? "recorder      OPTIONAL: the robot may have moved without being recorded\n" : "";
}

std::string text_or(const nlohmann::ordered_json& json, const char* key, const std::string& otherwise) {
  const auto found = json.find(key);
  return found != json.end() && found->is_string() ? found->get<std::string>() : otherwise;
}

// "identity 70003, watchdog 50 ms, DIFFERS: firmware 5012 (should be 5013); unknown: home"
std::string drive_card(const nlohmann::ordered_json& drive) {
  std::string known, unknown;
  const auto add = [](std::string& to, const std::string& what) {
    to += fmt::format("{}{}", to.empty() ? "" : ", ", what);
  };
  for (const auto& fact : drive.value("facts", nlohmann::ordered_json::array())) {
    const std::string what = text_or(fact, "fact", "?"), value = text_or(fact, "value", ""),
                      verdict = text_or(fact, "verdict", "");
    if (value.empty())
      add(unknown, what);
    else if (verdict == "differs")
      add(known, fmt::format("DIFFERS: {} {} (should be {})", what, value, text_or(fact, "expected", "?")));
    else
      add(known, fmt::format("{} {}", what, value));
  }
  std::string text = known.empty() ? "tells nothing of itself" : known;
  if (!unknown.empty()) text += "; unknown: " + unknown;
  const std::string waiver = text_or(drive, "watchdog_waiver", "");
  return waiver.empty() ? text : text + "; watchdog waived: " + waiver;
}

// What the drives said of themselves; empty: the run has no cards.
std::string drives(const monitor::RunManifest& manifest) {
  if (!manifest.drives.is_object()) return {};
  std::string text;
  for (const auto& drive : manifest.drives.value("drives", nlohmann::ordered_json::array()))
    text += fmt::format("{:<14}{} ({}): {}\n", text.empty() ? "drives" : "", text_or(drive, "joint", "?"),
                        text_or(drive, "protocol", "?"), drive_card(drive));
  return text;
}

}  // namespace

std::string contract_text(const monitor::RunMetrics& metrics) {
  const monitor::MissRate& time = metrics.misses_per_tick;
  const monitor::MissRate& commands = metrics.misses_per_command;
  if (commands.count == 0 || time.count == 0) return {};
  std::string facts =
      fmt::format("{} of {} commands missed, and {:.3g} % of the time there was no usable one: ", commands.misses,
                  commands.count, 100 * time.rate);
  if (!metrics.record_gap.empty() && commands.verdict != monitor::Verdict::violated)
    return facts + "the record does not reach the run's end, and nothing is known of what it lacks";
  const std::string by_time(name(time.verdict));
  switch (commands.verdict) {
    case monitor::Verdict::held:
      return facts + (time.verdict == monitor::Verdict::held
                          ? "the contract was held"
                          : "few losses, but long ones; held by commands, " + by_time + " by time");
    case monitor::Verdict::violated:
      return facts + (time.verdict == monitor::Verdict::violated
                          ? "the contract was violated"
                          : "many losses, but short ones; violated by commands, " + by_time + " by time");
    case monitor::Verdict::undecided:
      return facts + "too few commands to decide; by time the contract was " + by_time;
  }
  return facts;
}

std::string report_text(const monitor::RunMetrics& metrics, const monitor::RecordedRun& run, std::size_t most) {
  const config::Freshness& contract = run.robot.freshness;
  std::string text = fmt::format("run           {}  robot {}  {:.1f} s  {} ticks\n", run.manifest.run_id,
                                 run.manifest.robot, metrics.span.seconds(), metrics.ticks);
  text += incidents(metrics, std::min<std::size_t>(most, kShownIncidents));
  text += fmt::format("real-time     {}\n", realtime_words(run.manifest));
  text += part_line(run.manifest);
  text += recorder_line(run.manifest);
  text += fmt::format("contract      Pr(age > {:g} ms) <= {:g} %\n\n", contract.max_age.milliseconds(),
                      100 * contract.epsilon);
  text +=
      age_table(metrics, "age per tick that relied on the policy", metrics.age_per_tick, monitor::kAgePartCount - 1);
  text += age_table(metrics, "age per command at first use", metrics.age_per_command, monitor::kAgePartCount - 2);
  text += sensor_lines(metrics);
  text += "\ndeadline misses\n" + miss_row("per tick", metrics.misses_per_tick, contract.confidence) +
          miss_row("per command", metrics.misses_per_command, contract.confidence);
  if (const std::string together = contract_text(metrics); !together.empty())
    text += fmt::format("  {:<12} {}\n", "together", together);
  text += "  consecutive ticks share a command: the per-tick bound is optimistic, quote the one per command\n\n";
  text += fmt::format("modes         {}\n", modes_line(metrics)) + transitions(metrics, most) +
          requests(metrics, most) + candidate(metrics, most) + catches(metrics, run, most) + loads(metrics, run, most) +
          marks(metrics, most);
  const auto arrival = [](std::size_t index) { return takt::name(static_cast<Arrival>(index)); };
  text += fmt::format("commands      accepted {}; refused: {}\n",
                      metrics.arrivals[static_cast<std::size_t>(Arrival::accepted)],
                      counted(metrics, metrics.arrivals, static_cast<std::size_t>(Arrival::accepted) + 1, arrival)) +
          command_sources(metrics, most);
  text += fmt::format(
      "interventions {} (joint-ticks)\n",
      counted(metrics, metrics.interventions, 0, [](std::size_t index) { return kInterventionNames[index]; }));
  text += fmt::format("overruns      {}; {} periods skipped\n",
                      counted(metrics, metrics.overruns, 1,
                              [](std::size_t index) { return takt::name(static_cast<OverrunCause>(index)); }),
                      metrics.skipped_periods);
  if (metrics.ticks == 0)
    text += fmt::format("wake-up late  {}\n", none_in(metrics));
  else
    text += fmt::format("wake-up late  p50 {:.1f} us, p99 {:.1f} us; work per tick p50 {:.1f} us, p99 {:.1f} us\n",
                        metrics.lateness.p50 * 1e-3, metrics.lateness.p99 * 1e-3, metrics.work.p50 * 1e-3,
                        metrics.work.p99 * 1e-3);
  text += on_wire(metrics, run);
  return text + losses(metrics, run) + drives(run.manifest);
}

std::string faults_of_record(const monitor::RunMetrics& metrics, const monitor::FaultSummary& faults,
                             std::size_t most) {
  if (faults.total() == 0) return fmt::format("faults        {}\n", none_in(metrics));
  return monitor::fault_text(faults, most);
}

}  // namespace takt::evidence

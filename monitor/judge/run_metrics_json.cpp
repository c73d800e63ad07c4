// SPDX-License-Identifier: Apache-2.0
// metrics.json: the numbers of run_metrics.hpp under stable names. Times in nanoseconds.
#include <fmt/format.h>

#include <algorithm>

#include "monitor/judge/run_metrics.hpp"
#include "monitor/record/bounded_file.hpp"
#include "monitor/record/facts_json.hpp"

namespace takt::monitor {
namespace {

using Json = nlohmann::ordered_json;

Json age_json(const std::array<Quantiles, kAgePartCount>& parts) {
  Json json;
  for (std::size_t part = 0; part < kAgePartCount; ++part) json[kAgePartNames[part]] = to_json(parts[part]);
  return json;
}

Json incident_json(const incident::Incident& incident, const RunMetrics& metrics) {
  const auto found = metrics.stop_origins.find(incident.tick);
  const StopOrigin origin = found == metrics.stop_origins.end() ? StopOrigin{} : found->second;
  Json chain = Json::array();
  for (const incident::IncidentLink& link : incident.chain)
    chain.push_back({{"tick", link.tick}, {"monotonic_ns", link.at.ns}, {"what", link.what}});
  return {{"tick", incident.tick},
          {"monotonic_ns", incident.at.ns},
          {"from", takt::name(incident.from)},
          {"mode", takt::name(incident.to)},
          {"cause", takt::name(incident.cause)},
          {"asked", incident.asked},
          {"scripted", text_or_null(origin.scripted)},
          {"ended_process", text_or_null(origin.ended)},
          {"policy_said", text_or_null(origin.said)},
          {"told_by", origin.told_by.empty() ? "ticks.mcap" : origin.told_by},
          {"where", incident.where},
          {"error_code", incident.error_code},
          {"detail", incident.detail},
          {"chain", chain},
          {"done", incident.done},
          {"clears_when", incident.clears_when},
          {"sentence", incident.sentence},
          {"counterfactual", text_or_null(incident.counterfactual)}};
}

Json candidate_json(const CandidateMetrics& candidate) {
  Quantiles distance = candidate.distance;
  for (double* const value : {&distance.p50, &distance.p95, &distance.p99, &distance.max}) *value *= 1e-9;
  if (distance.p999) *distance.p999 *= 1e-9;
  return {{"ticks", candidate.ticks},
          {"fresh_ticks", candidate.fresh_ticks},
          {"age_ns", to_json(candidate.age)},
          {"distance_rad", to_json(distance)},
          {"ticks_beyond_range", candidate.ticks_beyond_range},
          {"ticks_beyond_limits", candidate.ticks_beyond_limits},
          {"arrivals", counts_json<Arrival>(candidate.arrivals)}};
}

}  // namespace

std::string_view name(Verdict verdict) {
  switch (verdict) {
    case Verdict::held:
      return "held";
    case Verdict::undecided:
      return "undecided";
    case Verdict::violated:
      return "violated";
  }
  return "invalid";
}

Json to_json(const Quantiles& quantiles) {
  return {{"count", quantiles.count},
          {"p50", quantiles.p50},
          {"p95", quantiles.p95},
          {"p99", quantiles.p99},
          {"p99.9", quantiles.p999 ? Json(*quantiles.p999) : Json(nullptr)},
          {"max", quantiles.max}};
}

Json to_json(const MissRate& misses) {
  return {{"misses", misses.misses},
          {"count", misses.count},
          {"rate", misses.rate},
          {"effective_count", misses.effective_count},
          {"lower_bound", misses.lower_bound},
          {"upper_bound", misses.upper_bound},
          {"verdict", name(misses.verdict)}};
}

Json to_json(const RunMetrics& metrics, const RecordedRun& run) {
  const config::Freshness& freshness = run.robot.freshness;
  Json json;
  json["schema"] = "takt.metrics/1";
  json["run_id"] = run.manifest.run_id;
  json["robot"] = run.manifest.robot;
  json["contract"] = {
      {"max_age_ns", freshness.max_age.ns}, {"epsilon", freshness.epsilon}, {"confidence", freshness.confidence}};
  json["ticks"] = {{"recorded", metrics.ticks},          {"first", metrics.first_tick},
                   {"last", metrics.last_tick},          {"missing", metrics.missing_ticks},
                   {"stood_by", metrics.stood_by_ticks}, {"relied_on_policy", metrics.relied_ticks},
                   {"span_ns", metrics.span.ns}};
  json["quantile_method"] = "exclusive";
  json["bound_method"] = "one-sided Clopper-Pearson";
  json["age_ns"] = {{"per_tick", age_json(metrics.age_per_tick)}, {"per_command", age_json(metrics.age_per_command)}};
  json["sensors"] = Json::object();
  for (const SensorAge& one : metrics.sensors)
    json["sensors"][one.sensor] = {{"age_ns", to_json(one.age)}, {"oldest", one.oldest}};
  json["deadline_misses"] = {{"per_tick", to_json(metrics.misses_per_tick)},
                             {"per_command", to_json(metrics.misses_per_command)}};
  json["degraded_by_p95"] = should_degrade(metrics.age_per_tick.back(), static_cast<double>(freshness.max_age.ns));
  json["lateness_ns"] = to_json(metrics.lateness);
  json["work_ns"] = to_json(metrics.work);
  json["tick_to_wire_ns"] = Json::object();
  for (std::size_t bus = 0; bus < std::min(run.robot.buses.size(), kMaxBuses); ++bus)
    json["tick_to_wire_ns"][run.robot.buses[bus].name] = to_json(metrics.tick_to_wire[bus]);
  json["age_on_wire_ns"] = to_json(metrics.age_on_wire);
  json["ticks_in_mode"] = counts_json<Mode>(metrics.ticks_in_mode);
  json["ticks_of_player"] = counts_json<Player>(metrics.ticks_of_player);
  json["ticks_of_policy"] = Json::object();
  for (const auto& [hash, ticks] : metrics.ticks_of_policy)
    json["ticks_of_policy"][fmt::format("{:016x}", hash)] = ticks;
  json["candidate"] = metrics.candidate ? candidate_json(*metrics.candidate) : Json(nullptr);
  json["policy_change_count"] = metrics.policy_change_count;
  json["policy_changes"] = Json::array();
  for (const NotedPolicyChange& each : metrics.policy_changes)
    json["policy_changes"].push_back({{"tick", each.tick},
                                      {"monotonic_ns", each.at.ns},
                                      {"change", takt::name(each.change)},
                                      {"in_charge", each.candidate_in_charge ? "candidate" : "policy"},
                                      {"candidate", fmt::format("{:016x}", each.candidate)}});
  json["ticks_without_fallback"] = metrics.ticks_without_fallback;
  json["arrivals"] = counts_json<Arrival>(metrics.arrivals);
  json["requests"] = Json::array();
  for (const NotedRequest& each : metrics.requests)
    json["requests"].push_back({{"monotonic_ns", each.at.ns},
                                {"action", each.action},
                                {"done", each.done},
                                {"pid", each.pid},
                                {"uid", each.uid},
                                {"program", each.program},
                                {"answer", each.answer}});
  json["command_sources"] = Json::array();
  for (const CommandSource& each : metrics.command_sources)
    json["command_sources"].push_back({{"monotonic_ns", each.at.ns},
                                       {"role", each.role},
                                       {"what", each.what},
                                       {"first_sequence", each.first_sequence},
                                       {"superseded", each.superseded}});
  json["overruns"] = counts_json<OverrunCause>(metrics.overruns);
  json["skipped_periods"] = metrics.skipped_periods;
  json["integration_errors"] = metrics.integration_errors;
  for (std::size_t index = 0; index < kInterventionCount; ++index) {
    json["interventions"][std::string(kInterventionNames[index])] = metrics.interventions[index];
  }
  json["incident_count"] = metrics.incident_count;
  json["incidents"] = Json::array();
  for (const incident::Incident& incident : by_gravity(metrics.incidents))
    json["incidents"].push_back(incident_json(incident, metrics));
  json["transition_count"] = metrics.transition_count;
  json["transitions"] = Json::array();
  for (const Transition& each : metrics.transitions) {
    json["transitions"].push_back({{"tick", each.tick},
                                   {"monotonic_ns", each.at.ns},
                                   {"from", takt::name(each.from)},
                                   {"to", takt::name(each.to)},
                                   {"cause", takt::name(each.cause)}});
  }
  json["catch_count"] = metrics.catch_count;
  json["catches"] = Json::array();
  for (const PolicyCatch& one : metrics.catches)
    json["catches"].push_back({{"tick", one.tick},
                               {"monotonic_ns", one.at.ns},
                               {"score", config::name(one.score)},
                               {"value", one.value},
                               {"threshold", one.threshold},
                               {"command", one.command},
                               {"observation", one.observation},
                               {"sentence", one.sentence}});
  json["mark_count"] = metrics.mark_count;
  json["load_mismatches"] = Json::array();
  for (const LoadMismatch& each : metrics.load_mismatches)
    json["load_mismatches"].push_back({{"tick", each.tick},
                                       {"monotonic_ns", each.at.ns},
                                       {"joint", run.robot.joints[each.joint].name},
                                       {"measured", each.measured},
                                       {"model", each.model},
                                       {"sentence", sentence_of(each, run.robot)}});
  json["marks"] = Json::array();
  for (const Mark& mark : metrics.marks) {
    json["marks"].push_back({{"tick", mark.tick}, {"monotonic_ns", mark.at.ns}});
    if (!mark.text.empty()) json["marks"].back()["text"] = mark.text;
  }
  json["losses"] = metrics.losses;
  json["file"] = {{"finished", metrics.scan.file.finished},
                  {"unread_bytes", metrics.scan.file.unread_bytes},
                  {"damaged_chunks", metrics.scan.file.damaged_chunks},
                  {"undecodable_messages", metrics.scan.undecodable}};
  json["recording_stopped"] = text_or_null(run.manifest.stopped_because);
  json["record_gap"] = text_or_null(metrics.record_gap);
  json["realtime"] = run.manifest.executive.is_object() && run.manifest.executive.contains("realtime")
                         ? run.manifest.executive.at("realtime")
                         : Json(nullptr);
  return json;
}

std::expected<RunMetrics, std::string> write_metrics(const RecordedRun& run) {
  auto metrics = metrics_of(run);
  if (!metrics) return metrics;
  const auto written = replace_file(run.folder.metrics(), to_json(*metrics, run).dump(2) + "\n");
  if (!written) return std::unexpected(written.error());
  return metrics;
}

}  // namespace takt::monitor

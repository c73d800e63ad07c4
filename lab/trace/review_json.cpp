// SPDX-License-Identifier: Apache-2.0
#include "lab/trace/review.hpp"

namespace takt::lab {
namespace {

using Json = nlohmann::ordered_json;

Json to_json(const monitor::Quantiles& q) {
  return {{"count", q.count}, {"p50_ns", q.p50}, {"p95_ns", q.p95}, {"p99_ns", q.p99}, {"max_ns", q.max}};
}

Json chain_json(const CommandChain& chain) {
  Json stages = Json::object();
  for (std::size_t stage = 0; stage < kStageNames.size(); ++stage) {
    const auto spent = stage_of(chain, static_cast<Stage>(stage));
    stages[std::string(kStageNames[stage]) + "_ns"] = spent ? Json(spent->ns) : Json(nullptr);
  }
  return {{"sequence", chain.sequence},
          {"observation_id", chain.observation_id},
          {"tick", chain.tick},
          {"policy_host_pid", chain.host_pid},
          {"stages", stages}};
}

Json to_json(const WorstCommand& worst) {
  const CommandContext& context = worst.context;
  Json modes = Json::array();
  for (const Mode mode : context.modes) modes.push_back(name(mode));
  Json overruns = Json::object();
  for (std::size_t cause = 1; cause < context.overruns.size(); ++cause) {
    if (context.overruns[cause] != 0)
      overruns[std::string(name(static_cast<OverrunCause>(cause)))] = context.overruns[cause];
  }
  Json json = chain_json(worst.chain);
  json["longest_stage"] = kStageNames[static_cast<std::size_t>(worst.longest)];
  json["context"] = {{"first_tick", context.first_tick},
                     {"last_tick", context.last_tick},
                     {"untraced_ticks", context.untraced_ticks},
                     {"modes", modes},
                     {"late_wakeups", context.late_wakeups},
                     {"worst_lateness_ns", context.worst_lateness.ns},
                     {"longest_tick_ns", context.longest_tick.ns},
                     {"skipped_periods", context.skipped_periods},
                     {"overruns", overruns},
                     {"refused_messages", context.refused_messages}};
  return json;
}

Json to_json(const RecordCheck& check) {
  Json disagreements = Json::array();
  for (const Disagreement& each : check.disagreements)
    disagreements.push_back(
        {{"tick", each.tick}, {"what", each.what}, {"traced", each.traced}, {"recorded", each.recorded}});
  return {{"agree", check.agrees()},
          {"ticks", check.ticks},
          {"ages", check.ages},
          {"commands", check.commands},
          {"underivable_ages", check.underivable},
          {"unrecorded_ticks", check.unrecorded},
          {"largest_difference_ns", check.largest.ns},
          {"tracer_delay_ns", check.tracer_delay.ns},
          {"disagreement_count", check.disagreement_count},
          {"disagreements", disagreements}};
}

Json losses_json(const TraceReading& reading) {
  Json losses = Json::array();
  for (const TraceLoss& loss : reading.losses)
    losses.push_back({{"what", loss.what == TraceLoss::What::events ? "events" : "packets"},
                      {"count", loss.count == 0 ? Json(nullptr) : Json(loss.count)},
                      {"from_ns", loss.from.ns},
                      {"to_ns", loss.to.ns}});
  return losses;
}

Json processes_json(const Timeline& timeline) {
  Json processes = Json::array();
  for (const auto& [pid, process] : timeline.processes)
    processes.push_back({{"pid", pid}, {"program", process.program}});
  return processes;
}

}  // namespace

Json to_json(const TraceReview& review, const TraceReading& reading, const Timeline& timeline) {
  Json latency = Json::object();
  for (std::size_t stage = 0; stage < kStageNames.size(); ++stage)
    latency[std::string(kStageNames[stage])] = to_json(review.stages[stage]);
  latency["wake_up"] = to_json(review.lateness);
  latency["tick"] = to_json(review.tick_work);
  latency["dequeue"] = to_json(review.looks);
  latency["drain"] = to_json(review.drains);
  Json worst = Json::array();
  for (const WorstCommand& each : review.worst) worst.push_back(to_json(each));
  const Chains& chains = review.chains;
  return {{"schema", "takt.trace_review/1"},
          {"events", reading.events},
          {"other_events", reading.other_events},
          {"unreadable", reading.unreadable},
          {"span_ns", (timeline.last_at - timeline.first_at).ns},
          {"processes", processes_json(timeline)},
          {"losses", losses_json(reading)},
          {"executive_pid", review.executive_pid},
          {"ticks", review.ticks},
          {"period_ns", review.period.ns},
          {"late_wakeups", review.late_wakeups},
          {"skipped_periods", review.skipped_periods},
          {"commands",
           {{"accepted", chains.accepted.size()},
            {"refused", chains.refused},
            {"without_observation", chains.without_observation},
            {"without_inference", chains.without_inference},
            {"without_publish", chains.without_publish},
            {"without_tick", chains.without_tick}}},
          {"latency", latency},
          {"worst", worst},
          {"records", review.records ? to_json(*review.records) : Json(nullptr)}};
}

}  // namespace takt::lab

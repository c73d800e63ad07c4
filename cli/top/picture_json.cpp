// SPDX-License-Identifier: Apache-2.0
#include "cli/top/picture_json.hpp"

#include <fmt/format.h>

#include <nlohmann/json.hpp>

#include "executive/contract/feedback_names.hpp"

namespace takt::monitor::top {
namespace {

using Json = nlohmann::ordered_json;

Json quantiles_json(const Quantiles& quantiles) {
  return {{"count", quantiles.count},
          {"p50", quantiles.p50},
          {"p95", quantiles.p95},
          {"p99", quantiles.p99},
          {"max", quantiles.max}};
}

template <class Enum, std::size_t size>
Json counts_json(const std::array<std::uint64_t, size>& counts, std::size_t first) {
  Json json = Json::object();
  for (std::size_t value = first; value < size; ++value)
    json[std::string(takt::name(static_cast<Enum>(value)))] = counts[value];
  return json;
}

Json age_json(const Picture& picture) {
  Json json{{"limit_ns", picture.max_age.ns}, {"freshness", takt::name(picture.tick.seats[Seat::policy].freshness)}};
  json["now_ns"] = picture.tick.seats[Seat::policy].freshness == Freshness::missing ? Json(nullptr)
                                                                                    : Json(picture.tick.age.total().ns);
  json["recent_ns"] = quantiles_json(picture.age);
  for (std::size_t stage = 0; stage < kAgeStageCount; ++stage)
    json["stages_ns"][std::string(kAgeStageNames[stage])] = quantiles_json(picture.stages[stage]);
  return json;
}

Json misses_json(const Picture& picture) {
  return {{"window", {{"misses", picture.tick.window_misses}, {"ticks", picture.tick.window_ticks}}},
          {"epsilon", picture.epsilon},
          {"since_attached",
           {{"misses", picture.misses.misses},
            {"ticks", picture.misses.count},
            {"upper_bound", picture.misses.upper_bound},
            {"confidence", picture.confidence}}}};
}

Json policy_json(const Picture& picture) {
  return {{"hash", picture.policy_hash == 0 ? Json(nullptr) : Json(fmt::format("{:016x}", picture.policy_hash))},
          {"rate", picture.policy_rate},
          {"planned_rate", picture.planned_rate},
          {"pid", picture.policy_pid},
          {"arrivals", counts_json<Arrival>(picture.arrivals, 1)}};
}

Json bus_json(const BusPicture& bus) {
  return {{"bus", bus.name},
          {"state", takt::name(bus.health.state)},
          {"load", bus.load},
          {"planned_load", bus.planned ? Json(*bus.planned) : Json(nullptr)},
          {"tx_dropped", bus.health.tx_dropped},
          {"rx_dropped", bus.health.rx_dropped},
          {"foreign_frames", bus.health.foreign_frames},
          {"flooded", bus.health.flooded != 0},
          {"tick_to_wire_ns", bus.tick_to_wire ? Json(bus.tick_to_wire->ns) : Json(nullptr)}};
}

Json joint_json(const JointPicture& joint) {
  Json interventions = Json::object();
  for (std::size_t kind = 0; kind < kInterventionCount; ++kind)
    interventions[std::string(kInterventionNames[kind])] = joint.ticks[kind];
  return {{"joint", joint.name},
          {"q", joint.newest.q_estimate},
          {"target", joint.newest.q_reference},
          {"torque", joint.newest.tau_total},
          {"temperature_C", joint.newest.feedback.temperature_C},
          {"error_code", joint.newest.feedback.error_code},
          {"error", joint.error},
          {"intervention_ticks", interventions}};
}

}  // namespace

Json to_json(const Picture& picture) {
  Json json{{"robot", picture.robot}, {"link", name(picture.link)}, {"tick", picture.tick.tick}};
  json["mode"] = takt::name(picture.tick.mode);
  json["player"] = takt::name(picture.tick.player);
  json["in_mode_ns"] = picture.in_mode.ns;
  json["entered_by"] = takt::name(picture.entered_by);
  json["incident"] = picture.incident.empty() ? Json(nullptr) : Json(picture.incident);
  json["realtime"] = picture.realtime ? Json(*picture.realtime) : Json(nullptr);
  json["monitor_pid"] = picture.monitor_pid;
  json["age"] = age_json(picture);
  json["misses"] = misses_json(picture);
  json["ticks_seen"] = picture.ticks;
  json["overruns"] = counts_json<OverrunCause>(picture.overruns, 1);
  json["skipped_periods"] = picture.skipped_periods;
  json["policy"] = policy_json(picture);
  json["buses"] = Json::array();
  for (const BusPicture& bus : picture.buses) json["buses"].push_back(bus_json(bus));
  json["joints"] = Json::array();
  for (const JointPicture& joint : picture.joints) json["joints"].push_back(joint_json(joint));
  return json;
}

}  // namespace takt::monitor::top

// SPDX-License-Identifier: Apache-2.0
#include "cli/top/picture_json.hpp"

#include <fmt/format.h>

#include <nlohmann/json.hpp>

#include "config/joint_units.hpp"
#include "executive/contract/feedback_names.hpp"
#include "monitor/judge/run_metrics.hpp"
#include "monitor/record/facts_json.hpp"

namespace takt::monitor::top {
namespace {

using Json = nlohmann::ordered_json;

Json since_attached_json(const Picture& picture) {
  return {{"ticks", picture.ticks},
          {"deadline_misses", to_json(picture.misses)},
          {"overruns", counts_json<OverrunCause>(picture.overruns, 1)},
          {"skipped_periods", picture.skipped_periods},
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
          {"tick_to_wire_ns", in_ns(bus.tick_to_wire)}};
}

Json joint_json(const JointPicture& joint) {
  Json interventions = Json::object();
  for (std::size_t kind = 0; kind < kInterventionCount; ++kind)
    interventions[std::string(kInterventionNames[kind])] = joint.ticks[kind];
  const std::string_view position = config::kJointPosition.unit(joint.kind);
  return {{"joint", joint.name},
          {fmt::format("q_estimate_{}", position), joint.newest.q_estimate},
          {fmt::format("q_reference_{}", position), joint.newest.q_reference},
          {fmt::format("tau_total_{}", config::kJointTorque.unit(joint.kind)), joint.newest.tau_total},
          {"temperature_C", joint.newest.feedback.temperature_C},
          {"error_code", joint.newest.feedback.error_code},
          {"error", joint.error},
          {"intervention_ticks", interventions}};
}

}  // namespace

Json to_json(const Picture& picture) {
  Json json{{"schema", "takt.top/1"}, {"robot", picture.robot}, {"link", name(picture.link)}};
  json.update(facts_json(picture.tick));
  json["cause"] = takt::name(picture.entered_by);
  json["in_mode_ns"] = picture.in_mode.ns;
  json["incident"] = picture.incident.empty() ? Json(nullptr) : Json{{"stands", true}, {"sentence", picture.incident}};
  json["realtime"] = picture.realtime ? Json(*picture.realtime) : Json(nullptr);
  json["policy_pid"] = picture.policy_pid;
  json["monitor_pid"] = picture.monitor_pid;
  json["contract"] = {
      {"max_age_ns", picture.max_age.ns}, {"epsilon", picture.epsilon}, {"confidence", picture.confidence}};
  json["recent_age_ns"] = to_json(picture.age);
  for (std::size_t stage = 0; stage < kAgeStageCount; ++stage)
    json["recent_stages_ns"][std::string(kAgeStageNames[stage])] = to_json(picture.stages[stage]);
  json["policy_rate"] = picture.policy_rate;
  json["planned_rate"] = picture.planned_rate;
  json["since_attached"] = since_attached_json(picture);
  json["buses"] = Json::array();
  for (const BusPicture& bus : picture.buses) json["buses"].push_back(bus_json(bus));
  json["joints"] = Json::array();
  for (const JointPicture& joint : picture.joints) json["joints"].push_back(joint_json(joint));
  return json;
}

}  // namespace takt::monitor::top

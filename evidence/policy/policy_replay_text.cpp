// SPDX-License-Identifier: Apache-2.0
#include <fmt/format.h>

#include "evidence/policy/policy_replay.hpp"

namespace takt::evidence {
namespace {

std::string joints_text(const PolicyReplay& policy, double tolerance) {
  std::string text = fmt::format("  {:<24} {:>12} {:>12}\n", "targets, " + policy.unit, "largest", "rms");
  for (const JointDistance& joint : policy.joints)
    text += fmt::format("  {:<24} {:>12.6f} {:>12.6f}\n", joint.joint, joint.largest, joint.rms);
  if (!policy.first_beyond)
    return text + fmt::format("  no target differs by more than {} {}\n", tolerance, policy.unit);
  const PolicyDifference& first = *policy.first_beyond;
  return text + fmt::format(
                    "  {} answers differ by more than {} {}; the first is to observation {} (command {}): {}, step {}, "
                    "{:.6f} recorded, {:.6f} now\n",
                    policy.beyond, tolerance, policy.unit, first.observation_id, first.sequence, first.joint,
                    first.step, first.recorded, first.recomputed);
}

std::string policy_text(const PolicyReplay& policy, double tolerance) {
  const std::uint64_t judged = policy.answers - policy.not_judged;
  std::string text =
      fmt::format("{} {} ({:016x}), {}\n", policy.sender == Player::fallback ? "fallback policy" : "policy",
                  policy.file, policy.hash, policy.is_of_the_run ? "as in the run" : "not the run's");
  text += fmt::format("  {} of {} answers reproduce bit for bit\n", policy.identical, judged);
  if (policy.not_judged != 0 || policy.missing != 0)
    text += fmt::format(
        "  {} more could not be judged, {} are missing; what follows a missing one is judged from the "
        "next reset on where the network has a memory\n",
        policy.not_judged, policy.missing);
  if (policy.without_image != 0)
    text += fmt::format("  {} of them rest on an image without a sound file; the first: {}\n", policy.without_image,
                        policy.first_without_image);
  if (policy.lost != 0) text += fmt::format("  {} are declared lost by the recorder\n", policy.lost);
  if (policy.unanswered != 0)
    text += fmt::format(
        "  {} commands that the executive read are of no recorded answer, and no loss is declared that explains them\n",
        policy.unanswered);
  if (policy.altered != 0)
    text += fmt::format("  {} were altered after recording; the first: {}\n", policy.altered, policy.first_altered);
  if (policy.commands != 0)
    text += fmt::format("  {} of {} commands that the executive read are what these answers said\n", policy.as_answered,
                        policy.commands);
  if (policy.is_mixed)
    text += "  commands are not compared: the host mixed earlier answers into them (policy.action.join)\n";
  if (policy.identical != judged) text += joints_text(policy, tolerance);
  return text;
}

nlohmann::ordered_json policy_json(const PolicyReplay& policy) {
  nlohmann::ordered_json json{{"sender", policy.sender == Player::fallback ? "fallback" : "policy"},
                              {"file", policy.file},
                              {"hash", fmt::format("{:016x}", policy.hash)},
                              {"is_of_the_run", policy.is_of_the_run},
                              {"answers", policy.answers},
                              {"identical", policy.identical},
                              {"beyond_tolerance", policy.beyond},
                              {"not_judged", policy.not_judged},
                              {"missing", policy.missing},
                              {"without_image", policy.without_image},
                              {"first_without_image", policy.first_without_image},
                              {"before_attach", policy.before},
                              {"lost", policy.lost},
                              {"unanswered", policy.unanswered},
                              {"altered", policy.altered},
                              {"commands", policy.commands},
                              {"commands_as_answered", policy.as_answered},
                              {"commands_are_mixed", policy.is_mixed},
                              {"unit", policy.unit},
                              {"joints", nlohmann::ordered_json::array()},
                              {"first_beyond", nullptr}};
  for (const JointDistance& joint : policy.joints)
    json["joints"].push_back(
        {{"joint", joint.joint}, {"unit", joint.unit}, {"largest", joint.largest}, {"rms", joint.rms}});
  if (const auto& first = policy.first_beyond)
    json["first_beyond"] = {{"observation_id", first->observation_id},
                            {"sequence", first->sequence},
                            {"step", first->step},
                            {"joint", first->joint},
                            {"recorded", first->recorded},
                            {"recomputed", first->recomputed}};
  return json;
}

}  // namespace

std::string policy_replay_text(const PolicyReplayReport& report) {
  std::string text;
  for (const PolicyReplay& policy : report.policies) text += policy_text(policy, report.tolerance);
  if (report.fallback_unanswered != 0)
    text += fmt::format("fallback policy: {} commands that the executive read, and no answer of it is recorded\n",
                        report.fallback_unanswered);
  if (report.missing_ticks != 0)
    text += fmt::format("{} ticks are missing: the manifest says that more were recorded than ticks.mcap holds\n",
                        report.missing_ticks);
  if (report.unrecorded_ticks != 0)
    text += fmt::format("{} ticks are not in this folder: recording stopped\n", report.unrecorded_ticks);
  if (report.file.damaged_chunks != 0)
    text += fmt::format("{} chunks of ticks.mcap are damaged and were skipped\n", report.file.damaged_chunks);
  if (!report.file.finished)
    text +=
        fmt::format("ticks.mcap was not closed: {} bytes at its end are no whole record\n", report.file.unread_bytes);
  return text;
}

nlohmann::ordered_json to_json(const PolicyReplayReport& report) {
  nlohmann::ordered_json json{{"schema", "takt.policy_replay/1"},
                              {"agrees", report.agrees()},
                              {"is_whole", report.is_whole()},
                              {"tolerance", report.tolerance},
                              {"missing_ticks", report.missing_ticks},
                              {"unrecorded_ticks", report.unrecorded_ticks},
                              {"fallback_unanswered", report.fallback_unanswered},
                              {"file_finished", report.file.finished},
                              {"damaged_chunks", report.file.damaged_chunks},
                              {"policies", nlohmann::ordered_json::array()}};
  for (const PolicyReplay& policy : report.policies) json["policies"].push_back(policy_json(policy));
  return json;
}

}  // namespace takt::evidence

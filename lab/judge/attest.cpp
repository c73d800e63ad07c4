// SPDX-License-Identifier: Apache-2.0
#include "lab/judge/attest.hpp"

#include <fmt/format.h>

#include <algorithm>
#include <map>
#include <span>
#include <utility>

#include "config/cautions.hpp"
#include "config/load.hpp"
#include "lab/artifact/rollout_json.hpp"

namespace takt::lab {
namespace {

double seconds_in(const evidence::RolloutRow& row, Mode mode, const config::RobotConfig& robot) {
  return row.mode_share[static_cast<std::size_t>(mode)] * static_cast<double>(row.ticks) *
         robot.control.period.seconds();
}

Bearing of_stop(const evidence::RolloutRow& row, std::string_view cause, const config::RobotConfig& robot) {
  Bearing bearing{.seconds = seconds_in(row, Mode::damped_stop, robot)};
  const bool latched = row.safety.entered_damped_stop + row.safety.entered_fault_latched != 0;
  bearing.came_to_it =
      row.safety.entered_damped_stop == 1 && row.final_mode == Mode::damped_stop && name(row.final_cause) == cause;
  bearing.stood = bearing.came_to_it && !row.fell && bearing.seconds >= evidence::kLeastStopped_s;
  // One that stood, but for a shorter time, shows nothing either way.
  const bool too_short = bearing.came_to_it && !row.fell && !bearing.stood;
  bearing.is_trial = (latched || row.fell) && !too_short;
  return bearing;
}

Bearing of_fallback(const evidence::RolloutRow& row, const config::RobotConfig& robot) {
  Bearing bearing{.seconds = seconds_in(row, Mode::degraded, robot)};
  const bool latched = row.safety.entered_fault_latched != 0;
  bearing.came_to_it = bearing.seconds >= evidence::kLeastDegraded_s;
  bearing.stood = bearing.came_to_it && !row.fell && !latched;
  bearing.is_trial = bearing.came_to_it || row.fell || latched;
  return bearing;
}

std::vector<evidence::AttestedCondition> conditions_of(std::span<const evidence::RolloutRow* const> rows,
                                                       const std::string& of, const std::string& parts,
                                                       const config::RobotConfig& robot) {
  std::map<std::pair<std::string, double>, std::vector<const evidence::RolloutRow*>> groups;
  for (const evidence::RolloutRow* const row : rows) groups[{row->perturbation, row->dose}].push_back(row);
  std::vector<evidence::AttestedCondition> conditions;
  for (auto& [key, group] : groups) {
    const bool any =
        std::ranges::any_of(group, [&](const auto* row) { return bearing_of(*row, of, robot).came_to_it; });
    if (!any) continue;
    evidence::AttestedCondition condition{key.first, key.second, {}};
    std::ranges::sort(group, {}, &evidence::RolloutRow::seed);
    for (const evidence::RolloutRow* const row : group)
      if (const Bearing bearing = bearing_of(*row, of, robot); bearing.is_trial)
        condition.trials.push_back(
            {row->seed, row->replay_hash, row_sha256(*row, parts), bearing.seconds, bearing.stood});
    if (!condition.trials.empty()) conditions.push_back(std::move(condition));
  }
  return conditions;
}

}  // namespace

std::string row_sha256(const evidence::RolloutRow& row, const std::string& parts) {
  evidence::RolloutRow sealed = row;
  sealed.config_sha256 = parts;
  const auto text = row_text(sealed, HostFields::left_out);
  return text ? config::sha256_hex(*text) : "";
}

Bearing bearing_of(const evidence::RolloutRow& row, std::string_view of, const config::RobotConfig& robot) {
  return of.starts_with(evidence::kStops) ? of_stop(row, of.substr(evidence::kStops.size()), robot)
                                          : of_fallback(row, robot);
}

std::expected<evidence::Attestation, std::string> attest(const Artifact& artifact, const std::string& panel_text,
                                                         const config::RobotConfig& robot, const std::string& of,
                                                         const std::string& method, const evidence::FallRule& fall) {
  const ArtifactManifest& manifest = artifact.manifest;
  if (!manifest.complete)
    return std::unexpected(artifact.folder.path() + ": not every rollout has its row; run the panel with --resume");
  if (!artifact.manifest.until_decided.empty())
    return std::unexpected(artifact.folder.path() +
                           ": its outcomes chose its number of seeds (--until-decided); run the panel with --seeds");
  const auto offered = config::offered_as_safe(robot);
  if (std::ranges::find(offered, of, &config::Offer::of) == offered.end())
    return std::unexpected(
        fmt::format("{}: `{}` is nothing that this robot is to stay on its feet by; `takt config check` names what is",
                    robot.file, of));
  std::vector<const evidence::RolloutRow*> rows;
  for (const evidence::RolloutRow& row : artifact.rows)
    if (row.method == method && row.task == "base_velocity") rows.push_back(&row);
  if (rows.empty())
    return std::unexpected(
        fmt::format("{}: no rollout of method `{}` in a task that tells whether a robot fell "
                    "(base_velocity)",
                    artifact.folder.path(), method));
  if (std::ranges::any_of(rows, [&](const auto* row) { return row->config_sha256 != robot.sha256; }))
    return std::unexpected(
        fmt::format("{}: the rows of method `{}` are of another robot file than {} is today; run the "
                    "panel again",
                    artifact.folder.path(), method, robot.file));
  const auto parts = evidence::moving_parts_sha256(robot);
  if (!parts) return std::unexpected(parts.error());
  evidence::Attestation made{.of = of,
                             .robot = robot.robot,
                             .parts_sha256 = *parts,
                             .artifact_id = manifest.artifact_id,
                             .panel = manifest.panel,
                             .panel_text = panel_text,
                             .task = rows.front()->task,
                             .method = method,
                             .timing = std::string(kTimingNames[static_cast<std::size_t>(manifest.timing)]),
                             .script_version = manifest.script_version,
                             .script_source_sha256 = manifest.script_source_sha256,
                             .fall = fall,
                             .conditions = conditions_of(rows, of, *parts, robot)};
  if (made.conditions.empty())
    return std::unexpected(fmt::format("{}: no rollout of method `{}` came to {}; add a perturbation that leads there",
                                       artifact.folder.path(), method, of));
  return made;
}

}  // namespace takt::lab

// SPDX-License-Identifier: Apache-2.0
#include "lab/artifact/artifact.hpp"

#include <fmt/format.h>

#include <algorithm>
#include <array>
#include <filesystem>
#include <string_view>

#include "config/load.hpp"
#include "lab/artifact/confusion.hpp"
#include "lab/artifact/rollout_json.hpp"
#include "lab/artifact/seal.hpp"
#include "monitor/record/bounded_file.hpp"
#include "monitor/record/run_manifest.hpp"
#include "monitor/record/strict_json.hpp"

namespace takt::lab {
namespace {

constexpr std::size_t kIdDigits = 12;
// Of row schemas that lack only fields that were added since.
constexpr std::array<std::string_view, 1> kEarlierSchemas{
    "d458d1ff4aa9854b6d3dcda5edb248bd138b25fcd8a8512b58f172fedf35a955"};

// Rows of `text`, which ends with a line end.
std::expected<std::vector<evidence::RolloutRow>, std::string> rows_of(std::string_view text) {
  std::vector<evidence::RolloutRow> rows;
  while (!text.empty()) {
    const std::size_t end = text.find('\n');
    const std::size_t number = rows.size() + 1;
    if (end == std::string_view::npos) {
      return std::unexpected(fmt::format(
          "row {} is cut off; go on with an unfinished panel by --resume, take a whole copy of a finished one",
          number));
    }
    auto row = row_of(text.substr(0, end));
    if (!row) return std::unexpected(fmt::format("row {}: {}", number, row.error()));
    rows.push_back(std::move(*row));
    text.remove_prefix(end + 1);
  }
  return rows;
}

std::string first_misfit(std::span<const evidence::RolloutRow> rows, const ArtifactManifest& manifest) {
  std::map<std::string, std::size_t> seen, hashes;
  for (std::size_t index = 0; index < rows.size(); ++index) {
    if (std::string reason = misfit(rows[index], manifest); !reason.empty()) {
      return fmt::format("row {} {}", index + 1, reason);
    }
    const auto [first, is_new] = seen.emplace(evidence::rollout_id(rows[index]), index + 1);
    if (!is_new)
      return fmt::format("row {} is rollout {}, which row {} is already", index + 1, first->first, first->second);
    if (rows[index].replay_hash.empty()) continue;
    // A perturbation may do nothing to a rollout; another seed always does.
    const auto [same, is_other] = hashes.emplace(rows[index].method + " " + rows[index].replay_hash, index + 1);
    if (!is_other && rows[same->second - 1].seed != rows[index].seed)
      return fmt::format("row {} has the ticks of row {} (replay_hash): one rollout is no two", index + 1,
                         same->second);
  }
  return {};
}

// Of the whole; empty: it is what it says.
std::string unfinished_or_changed(const ArtifactFolder& folder, const ArtifactManifest& manifest,
                                  std::span<const evidence::RolloutRow> rows) {
  std::error_code error;
  if (!manifest.complete) {
    if (std::filesystem::exists(folder.seal(), error))
      return "manifest.json says that it is unfinished, and seal.json that it was finished";
    return {};
  }
  if (artifact_id_of(manifest, rows) != manifest.artifact_id)
    return fmt::format("not the rows, contracts and seed plan that {} was named after", manifest.artifact_id);
  if (rows.size() != manifest.planned_rollouts)
    return fmt::format("says that it is complete, and holds {} of {} planned rollouts", rows.size(),
                       manifest.planned_rollouts);
  return {};
}

}  // namespace

std::string ArtifactFolder::post_mortem(const evidence::RolloutRow& row) const {
  return fmt::format("{}/{}.md", post_mortems(), evidence::rollout_id(row));
}

std::expected<ArtifactManifest, std::string> ArtifactFolder::read_manifest() const {
  const auto text = monitor::read_file(manifest());
  if (!text)
    return std::unexpected(
        fmt::format("{}: is {} an artifact? It is the folder of `takt panel run --out`", text.error(), path_));
  const auto json = monitor::parse_strict(*text);
  if (!json) return std::unexpected(fmt::format("{} is {}", manifest(), json.error()));
  if (json->contains("schema") &&
      (json->at("schema") == monitor::kRunSchema || json->at("schema") == monitor::kFirstRunSchema))
    return std::unexpected(fmt::format(
        "{} is a run, not the artifact of a panel; compare two runs by takt report {} --against RUN", path_, path_));
  return artifact_manifest_of(*json);
}

std::expected<void, std::string> ArtifactFolder::write_manifest(const ArtifactManifest& manifest_to_write) const {
  return monitor::replace_file(manifest(), to_json(manifest_to_write).dump(2) + "\n");
}

std::expected<Artifact, std::string> open_artifact(const std::string& path) {
  const ArtifactFolder folder(path);
  auto manifest = folder.read_manifest();
  if (!manifest) return std::unexpected(manifest.error());
  if (manifest->schema_sha256 != rollout_schema_sha256() &&
      std::ranges::find(kEarlierSchemas, manifest->schema_sha256) == kEarlierSchemas.end()) {
    return std::unexpected(
        fmt::format("{} was written with another row schema; read it with takt {}", path, manifest->script_version));
  }
  const auto schema = monitor::read_file(folder.schema());
  if (!schema) return std::unexpected(schema.error());
  if (config::sha256_hex(*schema) != manifest->schema_sha256)
    return std::unexpected(fmt::format("{}: not the row schema that manifest.json names", folder.schema()));
  const auto text = monitor::read_file(folder.rows());
  if (!text) return std::unexpected(text.error());
  auto rows = rows_of(*text);
  if (!rows) return std::unexpected(fmt::format("{}: {}", folder.rows(), rows.error()));
  if (const std::string reason = first_misfit(*rows, *manifest); !reason.empty()) {
    return std::unexpected(fmt::format("{}: {}", folder.rows(), reason));
  }
  const auto seals = monitor::read_file(folder.row_seals());
  if (!seals) return std::unexpected(seals.error());
  std::string reason = unfinished_or_changed(folder, *manifest, *rows);
  if (reason.empty()) reason = broken_row_seal(*text, *seals, !manifest->complete);
  if (reason.empty() && manifest->complete) reason = broken_seal(folder, manifest->artifact_id);
  if (!reason.empty()) return std::unexpected(fmt::format("{}: {}", path, reason));
  return Artifact{folder, std::move(*manifest), std::move(*rows)};
}

std::expected<Artifact, std::string> open_finished_artifact(const std::string& path) {
  auto artifact = open_artifact(path);
  if (artifact && !artifact->manifest.complete)
    return std::unexpected(
        fmt::format("{} is unfinished: {} of {} planned rollouts; go on with it by takt panel run "
                    "--resume",
                    path, artifact->rows.size(), artifact->manifest.planned_rollouts));
  return artifact;
}

std::string confusion_file_text(const std::string& artifact_id, std::span<const evidence::RolloutRow> rows) {
  return confusion_json(confusions_of(rows), artifact_id).dump(2) + "\n";
}

std::string artifact_id_of(const ArtifactManifest& manifest, std::span<const evidence::RolloutRow> rows) {
  std::vector<std::string> lines;
  for (const evidence::RolloutRow& row : rows) lines.push_back(row_text(row, HostFields::left_out).value_or("") + "\n");
  std::ranges::sort(lines);
  // What the rows do not say of themselves: by what a miss is one, and over which seeds they were to be.
  std::string text = fmt::format("{}\n{}\n{}\n", manifest.panel_sha256,
                                 kTimingNames[static_cast<std::size_t>(manifest.timing)], manifest.seed_plan.rule);
  for (const std::uint64_t seed : manifest.seed_plan.seeds) text += fmt::format("{}\n", seed);
  for (const auto& [name, method] : manifest.methods)
    for (const auto& [task, facts] : method.tasks)
      text += fmt::format("{} {} {} {} {}\n", name, task, facts.max_age_ms, facts.epsilon, facts.confidence);
  for (const std::string& method : manifest.until_decided) text += fmt::format("until decided {}\n", method);
  for (const std::string& line : lines) text += line;
  return fmt::format("{}-{}", manifest.panel, config::sha256_hex(text).substr(0, kIdDigits));
}

}  // namespace takt::lab

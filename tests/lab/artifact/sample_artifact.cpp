// SPDX-License-Identifier: Apache-2.0
#include "tests/lab/artifact/sample_artifact.hpp"

#include <numeric>
#include <stdexcept>

#include "tests/lab/artifact/sample_rows.hpp"

namespace takt::lab {
namespace {

template <class Value>
Value required(std::expected<Value, std::string> value) {
  if (!value) throw std::runtime_error(value.error());
  return std::move(*value);
}

}  // namespace

ArtifactManifest sample_manifest(const std::vector<std::string>& methods, std::uint64_t planned) {
  const evidence::RolloutRow row = sample_row();
  ArtifactManifest manifest;
  manifest.panel = row.panel;
  manifest.panel_sha256 = row.panel_sha256;
  manifest.seed_plan.rule = "seeds 1 to 20, the same for every method";
  manifest.seed_plan.seeds.resize(20);
  std::iota(manifest.seed_plan.seeds.begin(), manifest.seed_plan.seeds.end(), 1);
  manifest.script_version = row.script_version;
  manifest.script_source_sha256 = row.script_source_sha256;
  manifest.plants[row.task] = row.plant_sha256;
  for (const std::string& method : methods) {
    manifest.methods[method] = {.description = "for tests",
                                .tasks = {{row.task,
                                           {.config_sha256 = sample_row(method).config_sha256,
                                            .policy_sha256 = row.policy_sha256,
                                            .max_age_ms = 40,
                                            .epsilon = 0.05,
                                            .confidence = 0.95}}}};
  }
  manifest.claims = {"late actions destabilise", "how stale chunks are refused", "p95 age and success under stalls"};
  manifest.planned_rollouts = planned;
  return manifest;
}

Artifact write_artifact(const std::string& path, const ArtifactManifest& manifest,
                        const std::vector<evidence::RolloutRow>& rows) {
  ArtifactWriter writer = required(ArtifactWriter::create(path, manifest, kPanelText));
  for (const evidence::RolloutRow& row : rows) {
    if (const auto done = writer.append(row); !done) throw std::runtime_error(done.error());
  }
  if (rows.size() == manifest.planned_rollouts) (void)required(writer.finish());
  return required(open_artifact(path));
}

}  // namespace takt::lab

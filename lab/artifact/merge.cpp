// SPDX-License-Identifier: Apache-2.0
#include "lab/artifact/merge.hpp"

#include <fmt/format.h>

#include <algorithm>
#include <filesystem>
#include <map>
#include <set>
#include <utility>

#include "lab/artifact/inputs.hpp"
#include "monitor/record/bounded_file.hpp"
#include "monitor/record/run_manifest.hpp"

namespace takt::lab {
namespace {

// Why parts of the plan are missing; empty: each method has them all.
std::string missing_shard(std::span<const Artifact> artifacts) {
  std::map<std::string, std::set<std::uint64_t>> indices;
  std::map<std::string, std::uint64_t> counts;
  for (const Artifact& artifact : artifacts) {
    const ShardFacts& shard = artifact.manifest.shard;
    for (const auto& [name, facts] : artifact.manifest.methods) {
      const auto [known, is_new] = counts.emplace(name, shard.count);
      if (!is_new && known->second != shard.count)
        return fmt::format("{} is one of {} shards of method {}, others of {}", artifact.folder.path(), shard.count,
                           name, known->second);
      indices[name].insert(shard.index);
    }
  }
  for (const auto& [name, count] : counts)
    for (std::uint64_t index = 1; index <= count; ++index)
      if (!indices[name].contains(index))
        return fmt::format("shard {}/{} of method {} is missing; name its folder too", index, count, name);
  return {};
}

// Why the artifacts must not become one; empty: they may.
std::string mixture(std::span<const Artifact> artifacts) {
  const Artifact& first = artifacts.front();
  std::map<std::string, std::string> methods_from, rollouts_from;
  for (const Artifact& artifact : artifacts) {
    const std::string& folder = artifact.folder.path();
    if (!artifact.manifest.complete) return fmt::format("{} is unfinished", folder);
    if (!artifact.manifest.until_decided.empty())
      return fmt::format("{} ended when it was decided (--until-decided): it stands alone", folder);
    if (artifact.rows.size() != artifact.manifest.planned_rollouts)
      return fmt::format("{} holds {} of {} planned rollouts", folder, artifact.rows.size(),
                         artifact.manifest.planned_rollouts);
    std::string reason = difference_between(first.manifest, artifact.manifest, first.folder.path(), folder);
    if (!reason.empty()) return reason;
    if (artifact.manifest.claims != first.manifest.claims) {
      return fmt::format("the claims differ between {} and {}", first.folder.path(), folder);
    }
    if (contents_of(artifact.manifest.outside.policy_host) != contents_of(first.manifest.outside.policy_host))
      return fmt::format("the policy host's program differs between {} and {}", first.folder.path(), folder);
    for (const auto& [name, facts] : artifact.manifest.methods) {
      const auto [owner, is_new] = methods_from.emplace(name, folder);
      for (const Artifact& other : artifacts) {
        if (is_new || other.folder.path() != owner->second || other.manifest.methods.at(name) == facts) continue;
        return fmt::format("method {} has another configuration, policy or contract in {} than in {}", name, folder,
                           owner->second);
      }
    }
    for (const evidence::RolloutRow& row : artifact.rows) {
      const auto [owner, is_new] = rollouts_from.emplace(evidence::rollout_id(row), folder);
      if (!is_new) return fmt::format("rollout {} is in {} and in {}", owner->first, owner->second, folder);
    }
  }
  return missing_shard(artifacts);
}

ArtifactManifest merged_manifest(std::span<const Artifact> artifacts) {
  ArtifactManifest merged = artifacts.front().manifest;
  merged.artifact_id.clear();
  merged.complete = false;
  merged.merged_from.clear();
  merged.methods.clear();
  merged.planned_rollouts = 0;
  merged.shard = {};
  merged.host = nlohmann::ordered_json::array();
  for (const Artifact& artifact : artifacts) {
    merged.merged_from.push_back(artifact.manifest.artifact_id);
    merged.methods.insert(artifact.manifest.methods.begin(), artifact.manifest.methods.end());
    merged.planned_rollouts += artifact.manifest.planned_rollouts;
    merged.host.push_back(artifact.manifest.host);
    merged.started_unix_ns = std::min(merged.started_unix_ns, artifact.manifest.started_unix_ns);
  }
  return merged;
}

// Post-mortems go along; a row keeps its name in every artifact.
std::expected<void, std::string> copy_post_mortems(std::span<const Artifact> from, const ArtifactFolder& to) {
  std::error_code error;
  for (const Artifact& artifact : from) {
    if (!std::filesystem::exists(artifact.folder.post_mortems(), error)) continue;
    std::filesystem::create_directories(to.post_mortems(), error);
    std::filesystem::copy(artifact.folder.post_mortems(), to.post_mortems(),
                          std::filesystem::copy_options::recursive | std::filesystem::copy_options::skip_existing,
                          error);
    if (error) return std::unexpected(fmt::format("cannot copy post-mortems: {}", error.message()));
  }
  return {};
}

// Empty: none.
std::expected<std::string, std::string> text_if_there(const std::string& path) {
  std::error_code unknown;
  return std::filesystem::exists(path, unknown) ? monitor::read_file(path) : "";
}

struct KeptRegistration {
  std::string envelope, stamp;  // empty: none
};

// Shards of a registered panel keep the same one each.
std::expected<KeptRegistration, std::string> registration_of(std::span<const Artifact> artifacts) {
  KeptRegistration kept;
  for (const Artifact& artifact : artifacts) {
    auto envelope = text_if_there(artifact.folder.registration());
    auto stamp = text_if_there(artifact.folder.registration_stamp());
    if (!envelope || !stamp) return std::unexpected(envelope ? stamp.error() : envelope.error());
    if (&artifact == &artifacts.front())
      kept = {std::move(*envelope), std::move(*stamp)};
    else if (*envelope != kept.envelope || *stamp != kept.stamp)
      return std::unexpected(fmt::format("refusing the mixture: the registration differs between {} and {}",
                                         artifacts.front().folder.path(), artifact.folder.path()));
  }
  return kept;
}

std::expected<void, std::string> keep(const KeptRegistration& registration, const ArtifactFolder& folder) {
  for (const auto& [file, text] : {std::pair{folder.registration(), &registration.envelope},
                                   std::pair{folder.registration_stamp(), &registration.stamp}})
    if (!text->empty())
      if (auto done = monitor::replace_file(file, *text); !done) return done;
  return {};
}

}  // namespace

std::expected<Artifact, std::string> merge(const std::string& path, std::span<const Artifact> artifacts) {
  if (artifacts.empty()) return std::unexpected("nothing to merge");
  if (const std::string reason = mixture(artifacts); !reason.empty()) {
    return std::unexpected(fmt::format("refusing the mixture: {}", reason));
  }
  const auto registration = registration_of(artifacts);
  if (!registration) return std::unexpected(registration.error());
  const auto panel_text = monitor::read_file(artifacts.front().folder.panel());
  if (!panel_text) return std::unexpected(panel_text.error());
  auto writer = ArtifactWriter::create(path, merged_manifest(artifacts), *panel_text);
  if (!writer) return std::unexpected(writer.error());
  for (const Artifact& artifact : artifacts) {
    for (evidence::RolloutRow row : artifact.rows) {
      row.run_folder.clear();  // stays where it was recorded: paths are relative to the artifact
      if (auto done = writer->append(row); !done) return std::unexpected(done.error());
    }
  }
  if (auto done = copy_post_mortems(artifacts, writer->folder()); !done) return std::unexpected(done.error());
  if (auto done = keep(*registration, writer->folder()); !done) return std::unexpected(done.error());
  if (auto done = merge_inputs(artifacts, writer->folder()); !done) return std::unexpected(done.error());
  if (auto done = writer->finish(); !done) return std::unexpected(done.error());
  return open_artifact(path);
}

}  // namespace takt::lab

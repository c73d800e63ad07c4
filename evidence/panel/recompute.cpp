// SPDX-License-Identifier: Apache-2.0
#include "evidence/panel/recompute.hpp"

#include <fmt/format.h>

#include <algorithm>
#include <map>
#include <numeric>
#include <random>

#include "evidence/artifact/rollout_json.hpp"
#include "evidence/panel/worker_pool.hpp"

namespace takt::panel {
namespace {

// Where two rows' texts part, for a reader.
std::string difference_of(const std::string& was, const std::string& is) {
  const auto [a, b] = std::ranges::mismatch(was, is);
  const auto key = was.rfind('"', static_cast<std::size_t>(a - was.begin()));
  const std::size_t from = key == std::string::npos ? 0 : was.rfind(',', key) + 1;
  constexpr std::size_t kShown = 60;
  return fmt::format("says {} where {} comes out", was.substr(from, kShown),
                     is.substr(std::min(from, is.size()), kShown));
}

}  // namespace

std::vector<std::size_t> drawn_rows(std::size_t count, std::size_t rows, std::uint64_t nonce) {
  std::vector<std::size_t> indices(rows);
  std::iota(indices.begin(), indices.end(), 0);
  std::mt19937_64 random(nonce);
  std::ranges::shuffle(indices, random);
  indices.resize(std::min(count, rows));
  std::ranges::sort(indices);
  return indices;
}

std::expected<Recomputed, std::string> recompute(const Artifact& artifact, Contest& contest,
                                                 const std::vector<std::size_t>& rows, std::size_t workers) {
  const ArtifactManifest& manifest = artifact.manifest;
  if (manifest.timing != Timing::virtual_time)
    return std::unexpected("real-time rows cannot be computed anew; replay their runs");
  const ArtifactManifest wanted = contest.manifest(manifest.planned_rollouts);
  ArtifactManifest known = wanted;
  known.schema_sha256 = manifest.schema_sha256;
  if (const std::string reason = difference_between(manifest, known, "the artifact", "this panel file");
      !reason.empty())
    return std::unexpected(reason);
  for (const auto& [name, facts] : manifest.methods)
    if (const auto found = wanted.methods.find(name); found == wanted.methods.end() || !(found->second == facts))
      return std::unexpected(fmt::format("method {} has another configuration, policy or contract than here", name));
  std::map<std::string, PlannedRollout> plan;
  for (const PlannedRollout& one : plan_of(contest.panel(), {})) plan.emplace(rollout_id(contest.identity(one)), one);
  std::vector<PlannedRollout> again;
  for (const std::size_t row : rows) {
    const auto found = plan.find(rollout_id(artifact.rows[row]));
    if (found == plan.end()) return std::unexpected(fmt::format("row {} is no rollout of this panel file", row + 1));
    again.push_back(found->second);
  }
  Recomputed result{.rows = 0, .of = artifact.rows.size(), .differences = {}};
  const auto compare = [&](const RanRollout& ran) -> std::expected<void, std::string> {
    const std::size_t row = rows[result.rows++];
    RolloutRow was = artifact.rows[row];
    was.run_folder = ran.row.run_folder;  // a place, and no measure
    const auto before = row_text(was, HostFields::left_out), now = row_text(ran.row, HostFields::left_out);
    if (!before || !now) return std::unexpected(before ? now.error() : before.error());
    if (*before != *now) result.differences.push_back(fmt::format("row {} {}", row + 1, difference_of(*before, *now)));
    return {};
  };
  if (auto done = run_in_workers(contest, again, workers, compare); !done) return std::unexpected(done.error());
  return result;
}

}  // namespace takt::panel

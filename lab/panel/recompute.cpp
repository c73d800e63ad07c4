// SPDX-License-Identifier: Apache-2.0
#include "lab/panel/recompute.hpp"

#include <fmt/format.h>

#include <algorithm>
#include <map>
#include <numeric>
#include <random>

#include "lab/artifact/rollout_json.hpp"
#include "lab/judge/run_audit.hpp"
#include "lab/panel/recorded_row.hpp"
#include "lab/panel/worker_pool.hpp"
#include "monitor/record/recorded_run.hpp"

namespace takt::lab {
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

// From the kept run folder; the error says why that is no evidence.
std::expected<RanRollout, std::string> measured_anew(const Artifact& artifact, std::size_t row, const Contest& contest,
                                                     const PlannedRollout& planned) {
  constexpr std::string_view kRun = "/run";
  const std::string& place = artifact.rows[row].run_folder;
  if (!place.ends_with(kRun)) return std::unexpected(fmt::format("{} is no place of a rollout's run", place));
  const std::string folder = artifact.folder.path() + "/" + place.substr(0, place.size() - kRun.size());
  const auto run = monitor::open_run(folder + std::string(kRun));
  if (!run) return std::unexpected(run.error());
  if (run->manifest.config_sha256 != artifact.rows[row].config_sha256)
    return std::unexpected("its run is of another configuration");
  const RunAudit judged = audit_run(*run);
  if (!judged.seal) return std::unexpected(judged.seal.error());
  if (!judged.seal->altered.empty()) return std::unexpected(judged.seal->altered.front());
  if (!judged.is_consistent())
    return std::unexpected("its run is not closed, or does not replay: see takt audit of it");
  evidence::RolloutRow measured = contest.identity(planned);
  RolloutWatch watch(contest.contestant(planned).robot);
  if (auto done = measure_recorded(recorded_rollout(contest.panel(), planned, folder), watch, measured); !done)
    return std::unexpected(done.error());
  return contest.conclude(std::move(measured), watch);
}

}  // namespace

void keep_what_ran(const ArtifactManifest& manifest, Panel& panel) {
  std::erase_if(panel.tasks, [&](const PanelTask& one) {
    return !manifest.plants.contains(std::string(evidence::kTaskNames[static_cast<std::size_t>(one.task)]));
  });
  std::erase_if(panel.methods, [&](const PanelMethod& one) { return !manifest.methods.contains(one.name); });
  const auto& seeds = manifest.seed_plan.seeds;
  if (seeds.empty()) return;
  panel.first_seed = seeds.front();
  panel.seed_count = seeds.size();
}

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
  const ArtifactManifest wanted = contest.manifest(manifest.planned_rollouts);
  ArtifactManifest known = wanted;
  known.schema_sha256 = manifest.schema_sha256;
  known.timing = manifest.timing;
  if (const std::string reason = difference_between(manifest, known, "the artifact", "this panel file");
      !reason.empty())
    return std::unexpected(reason);
  for (const auto& [name, facts] : manifest.methods)
    if (const auto found = wanted.methods.find(name); found == wanted.methods.end() || !(found->second == facts))
      return std::unexpected(fmt::format("method {} has another configuration, policy or contract than here", name));
  if (contents_of(manifest.outside.policy_host) != contents_of(wanted.outside.policy_host))
    return std::unexpected("another program answered for its policies: name it by --policy-host");
  std::map<std::string, PlannedRollout> plan;
  for (const PlannedRollout& one : plan_of(contest.panel(), {}))
    plan.emplace(evidence::rollout_id(contest.identity(one)), one);
  std::vector<PlannedRollout> again;
  for (const std::size_t row : rows) {
    const auto found = plan.find(evidence::rollout_id(artifact.rows[row]));
    if (found == plan.end()) return std::unexpected(fmt::format("row {} is no rollout of this panel file", row + 1));
    again.push_back(found->second);
    if (manifest.timing != Timing::virtual_time && artifact.rows[row].run_folder.empty())
      return std::unexpected(fmt::format("row {} was lived through, and its run is not kept here", row + 1));
  }
  Recomputed result{.rows = 0, .of = artifact.rows.size(), .differences = {}};
  const auto compare = [&](const RanRollout& ran) -> std::expected<void, std::string> {
    const std::size_t row = rows[result.rows++];
    evidence::RolloutRow was = artifact.rows[row];
    was.run_folder = ran.row.run_folder;  // a place, and no measure
    const auto before = row_text(was, HostFields::left_out), now = row_text(ran.row, HostFields::left_out);
    if (!before || !now) return std::unexpected(before ? now.error() : before.error());
    if (*before != *now) result.differences.push_back(fmt::format("row {} {}", row + 1, difference_of(*before, *now)));
    return {};
  };
  if (manifest.timing == Timing::virtual_time) {
    if (auto done = run_in_workers(contest, again, workers, compare); !done) return std::unexpected(done.error());
    return result;
  }
  for (std::size_t i = 0; i < rows.size(); ++i) {
    const auto measured = measured_anew(artifact, rows[i], contest, again[i]);
    if (!measured) {
      ++result.rows;
      result.differences.push_back(fmt::format("row {}: {}", rows[i] + 1, measured.error()));
    } else if (auto done = compare(*measured); !done) {
      return std::unexpected(done.error());
    }
  }
  return result;
}

}  // namespace takt::lab

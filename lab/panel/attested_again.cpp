// SPDX-License-Identifier: Apache-2.0
#include "lab/panel/attested_again.hpp"

#include <fmt/format.h>

#include <algorithm>
#include <cmath>

#include "executive/contract/version.hpp"
#include "lab/judge/attest.hpp"
#include "lab/panel/worker_pool.hpp"

namespace takt::lab {
namespace {

constexpr std::uint64_t kMostSeeds = 1'000'000;

const evidence::AttestedCondition* condition_of(const evidence::Attestation& attestation,
                                                const evidence::RolloutRow& row) {
  const auto found = std::ranges::find_if(attestation.conditions, [&](const evidence::AttestedCondition& one) {
    return one.perturbation == row.perturbation && one.dose == row.dose;
  });
  return found == attestation.conditions.end() ? nullptr : &*found;
}

// Empty: it is what the attestation says of it.
std::string difference(const evidence::Attestation& attestation, const evidence::RolloutRow& row,
                       const config::RobotConfig& robot) {
  const Bearing now = bearing_of(row, attestation.of, robot);
  const evidence::AttestedCondition* const condition = condition_of(attestation, row);
  if (condition == nullptr) return now.came_to_it ? "came to it, and the attestation leaves out its condition" : "";
  const auto said = std::ranges::find(condition->trials, row.seed, &evidence::AttestedTrial::seed);
  const bool is_said = said != condition->trials.end();
  if (now.is_trial && !is_said) return "is a trial that the attestation leaves out";
  if (!now.is_trial) return is_said ? "is no trial, and the attestation has it as one" : "";
  if (said->stood != now.stood)
    return now.stood ? "stood, and is said to have fallen" : "did not stand, as it is said to";
  const bool same_sources = attestation.script_source_sha256 == source_sha256();
  // Of other sources, whole seconds count.
  const double tolerance_s = same_sources ? 0 : 0.5;
  if (std::abs(said->seconds - now.seconds) > tolerance_s)
    return fmt::format("was in it for {:g} s, and {:g} s are said", now.seconds, said->seconds);
  if (same_sources && said->replay_hash != row.replay_hash) return "has other ticks than are said (replay_hash)";
  if (same_sources && said->row_sha256 != row_sha256(row, attestation.parts_sha256))
    return "has another row than is said (row_sha256)";
  return {};
}

}  // namespace

std::expected<Panel, std::string> attested_panel(const evidence::Attestation& attestation) {
  auto read = panel_of(attestation.panel_text, "panel_text");
  if (!read) return read;
  Panel& panel = *read;
  std::erase_if(panel.methods, [&](const PanelMethod& one) { return one.name != attestation.method; });
  std::erase_if(panel.tasks, [&](const PanelTask& one) {
    return evidence::kTaskNames[static_cast<std::size_t>(one.task)] != attestation.task;
  });
  if (panel.methods.empty() || panel.tasks.empty())
    return std::unexpected(
        fmt::format("its panel has no method {} in a task {}", attestation.method, attestation.task));
  for (const evidence::AttestedCondition& condition : attestation.conditions)
    for (const evidence::AttestedTrial& trial : condition.trials) {
      if (trial.seed < panel.first_seed || trial.seed - panel.first_seed >= kMostSeeds)
        return std::unexpected(
            fmt::format("it names seed {}, and the panel's begin at {}", trial.seed, panel.first_seed));
      panel.seed_count = std::max(panel.seed_count, trial.seed - panel.first_seed + 1);
    }
  return read;
}

std::expected<Recomputed, std::string> recompute(const evidence::Attestation& attestation, Contest& contest,
                                                 const std::vector<PlannedRollout>& drawn, std::size_t workers) {
  const config::RobotConfig& robot = contest.contestant({}).robot;
  if (const std::string why = evidence::shortcoming(attestation, robot, attestation.of); !why.empty())
    return std::unexpected(why);
  Recomputed result{.rows = 0, .of = plan_of(contest.panel(), {}).size(), .differences = {}};
  const auto compare = [&](const RanRollout& ran) -> std::expected<void, std::string> {
    ++result.rows;
    if (const std::string why = difference(attestation, ran.row, robot); !why.empty())
      result.differences.push_back(
          fmt::format("{}@{:g} with seed {} {}", ran.row.perturbation, ran.row.dose, ran.row.seed, why));
    return {};
  };
  if (auto done = run_in_workers(contest, drawn, workers, compare); !done) return std::unexpected(done.error());
  return result;
}

}  // namespace takt::lab

// SPDX-License-Identifier: Apache-2.0
// takt panel run: runs a panel of rollouts in virtual time, into one artifact.
#include <fmt/format.h>

#include <charconv>
#include <filesystem>
#include <memory>
#include <nlohmann/json.hpp>
#include <optional>
#include <vector>

#include "cli/command.hpp"
#include "cli/json_line.hpp"
#include "cli/lab/panel_choice.hpp"
#include "cli/lab/progress.hpp"
#include "cli/lab/real_rollouts.hpp"
#include "cli/world_option.hpp"
#include "config/load.hpp"
#include "config/printable.hpp"
#include "lab/artifact/artifact.hpp"
#include "lab/artifact/confusion.hpp"
#include "lab/panel/harm_table.hpp"
#include "lab/panel/kept_inputs.hpp"
#include "lab/panel/panel_plan.hpp"
#include "lab/panel/panel_table.hpp"
#include "lab/panel/registration.hpp"
#include "lab/panel/sequential_decision.hpp"
#include "lab/panel/worker_pool.hpp"

namespace takt::cli {
namespace {

struct PanelRunOptions {
  std::string panel, out, only, shard = "1/1";
  PanelChoice choice;
  std::size_t workers = 1;
  bool resume = false, json = false, real_time = false, allow_non_realtime = false;
};

std::optional<lab::Shard> shard_of(const std::string& text) {
  lab::Shard shard;
  const char* const end = text.data() + text.size();
  const auto [slash, first] = std::from_chars(text.data(), end, shard.index);
  if (first != std::errc{} || slash == end || *slash != '/') return std::nullopt;
  const auto [last, second] = std::from_chars(slash + 1, end, shard.count);
  const bool fits = shard.index >= 1 && shard.index <= shard.count && shard.count <= 10'000;
  if (second != std::errc{} || last != end || !fits) return std::nullopt;
  return shard;
}

// "arm_tracking.none@0.takt.s17": 17.
std::optional<std::uint64_t> seed_of(const std::string& rollout_id) {
  const std::size_t mark = rollout_id.rfind(".s");
  std::uint64_t seed = 0;
  if (mark == std::string::npos) return std::nullopt;
  const char* const end = rollout_id.data() + rollout_id.size();
  const auto [last, error] = std::from_chars(rollout_id.data() + mark + 2, end, seed);
  return error == std::errc{} && last == end ? std::optional(seed) : std::nullopt;
}

// A rollout of a run with more seeds than the file names (--seeds) can be run again without saying how many there were.
void plan_for(std::uint64_t seed, lab::Panel& panel) {
  if (seed >= panel.first_seed && seed < panel.first_seed + panel.seed_count) return;
  panel.first_seed = seed;
  panel.seed_count = 1;
}

std::expected<lab::ArtifactWriter, std::string> open_writer(const PanelRunOptions& options,
                                                            const lab::ArtifactManifest& manifest,
                                                            const std::string& panel_text) {
  const bool begun = std::filesystem::exists(lab::ArtifactFolder(options.out).manifest());
  if (options.resume && begun) return lab::ArtifactWriter::resume(options.out, manifest);
  auto writer = lab::ArtifactWriter::create(options.out, manifest, panel_text);
  // Only of a panel that begins: what is registered later says nothing of its rows.
  if (const auto kept = lab::keep_registration(options.panel, lab::ArtifactFolder(options.out)); writer && !kept)
    return std::unexpected(kept.error());
  return writer;
}

// The post-mortem first: a row that is there has its own.
std::expected<void, std::string> keep(lab::ArtifactWriter& rows, const lab::RanRollout& ran) {
  if (!ran.post_mortem.empty()) {
    const auto kept = lab::keep_post_mortem(rows.folder(), ran.row, ran.post_mortem);
    if (!kept) return std::unexpected(kept.error());
  }
  return rows.append(ran.row);
}

// `decision`: under --until-decided.
void print_summary(const PanelRunOptions& options, const std::string& id, const std::vector<evidence::RolloutRow>& rows,
                   std::size_t ran, const std::optional<lab::SequentialDecision>& decision) {
  const auto succeeded = std::ranges::count_if(rows, &evidence::RolloutRow::success);
  if (options.json) {
    nlohmann::ordered_json summary{
        {"artifact", options.out}, {"rollouts", rows.size()}, {"ran_now", ran}, {"succeeded", succeeded}};
    if (decision)
      summary["until_decided"] = {
          {"decided", decision->is_made()}, {"seeds", decision->seeds()}, {"evidence", decision->evidence()}};
    fmt::print("{}\n", json_line(summary));
    return;
  }
  const std::string harm = lab::harm_table(rows);
  fmt::print("{}\n{}\n{}{}\n{}{}{} rollouts, {} of them now, {} succeeded: {} in {}\n", lab::panel_table(rows),
             lab::latency_table(rows), lab::motion_table(rows), lab::confusion_text(lab::confusions_of(rows)), harm,
             harm.empty() ? "" : "\n", rows.size(), ran, succeeded, id, config::printable(options.out));
  if (decision) fmt::print("{}\n", decision->text());
}

lab::Timing timing_of(const PanelRunOptions& options) {
  if (!options.real_time) return lab::Timing::virtual_time;
  return options.allow_non_realtime ? lab::Timing::real_without_guarantees : lab::Timing::real;
}

std::expected<void, std::string> run_all(const PanelRunOptions& options, lab::Contest& contest,
                                         const std::vector<lab::PlannedRollout>& rollouts,
                                         const std::optional<RealRollouts>& real, lab::ArtifactWriter& rows,
                                         std::optional<lab::SequentialDecision>& decision) {
  Progress progress("rollouts");
  std::size_t arrived = 0;
  const auto deliver = [&](const lab::RanRollout& ran) {
    progress.show(++arrived, rollouts.size());
    if (decision) decision->add(ran.row);
    return keep(rows, ran);
  };
  const auto is_enough = [&] { return decision && decision->is_made(); };
  if (!real) return lab::run_in_workers(contest, rollouts, options.workers, deliver, is_enough);
  for (const lab::PlannedRollout& planned : rollouts) {
    if (is_enough()) break;
    const auto ran = real->run(planned);
    if (!ran) return std::unexpected(ran.error());
    if (auto done = deliver(*ran); !done) return done;
  }
  return {};
}

int run(const PanelRunOptions& options) {
  const auto shard = shard_of(options.shard);
  if (!shard) return refuse(kExitUsage, "takt panel run: --shard " + options.shard + ": write I/N, such as 1/4");
  auto chosen = chosen_panel("takt panel run", options.panel, options.choice);
  if (!chosen) return refuse(chosen.error().exit_code, chosen.error().sentence);
  const evidence::OutsideProcesses outside = options.choice.outside();
  if (const std::string why = crowded_world(outside.world, options.workers); !why.empty())
    return refuse(kExitUsage, "takt panel run: " + why);
  lab::Panel& panel = chosen->panel;
  if (const auto seed = seed_of(options.only)) plan_for(*seed, panel);
  auto plan = lab::plan_of(panel, *shard);
  if (plan.empty())
    return refuse(kExitUsage,
                  fmt::format("takt panel run: --shard {}: the panel has {} rollouts, and this part has none; "
                              "write fewer parts",
                              options.shard, lab::plan_of(panel, {}).size()));
  auto contest = lab::Contest::prepare(std::move(panel), outside);
  if (!contest) return refuse(config::kExitBadConfiguration, contest.error());
  if (!options.only.empty()) {
    const std::string first = evidence::rollout_id(contest->identity(plan.front()));
    std::erase_if(plan, [&](const auto& one) { return evidence::rollout_id(contest->identity(one)) != options.only; });
    if (plan.empty())
      return refuse(kExitUsage, fmt::format("takt panel run: --only {}: no rollout of this panel, which has such as {}",
                                            options.only, first));
  }
  std::optional<lab::SequentialDecision> decision;
  if (!options.choice.until_decided.empty()) decision.emplace(chosen->rivals, plan);
  std::optional<RealRollouts> real;
  if (options.real_time) {
    auto made = RealRollouts::make(*contest, options.out, outside, options.allow_non_realtime);
    if (!made) return refuse(config::kExitBadConfiguration, made.error());
    real.emplace(std::move(*made));
  }
  lab::ArtifactManifest manifest = contest->manifest(plan.size());
  manifest.timing = timing_of(options);
  manifest.shard = {shard->index, shard->count};
  if (decision) manifest.until_decided = {chosen->rivals.begin(), chosen->rivals.end()};
  auto rows = open_writer(options, manifest, contest->panel().text);
  if (!rows) return refuse(kExitFailed, "takt panel run: " + rows.error());
  if (const auto kept = lab::keep_inputs(*contest, rows->folder()); !kept)
    return refuse(kExitFailed, "takt panel run: " + kept.error());

  if (decision)
    for (const evidence::RolloutRow& row : rows->rows()) decision->add(row);
  std::vector<lab::PlannedRollout> remaining;
  for (const lab::PlannedRollout& one : plan)
    if (!rows->has(contest->identity(one))) remaining.push_back(one);
  const std::size_t there = rows->rows().size();
  const auto done = run_all(options, *contest, remaining, real, *rows, decision);
  if (!done) return refuse(kExitFailed, "takt panel run: " + done.error());
  if (decision && decision->is_made()) rows->end_plan_after(decision->seeds());
  const auto finished = rows->finish();
  if (!finished) return refuse(kExitFailed, "takt panel run: " + finished.error());
  print_summary(options, finished->artifact_id, rows->rows(), rows->rows().size() - there, decision);
  return kExitOk;
}

}  // namespace

void add_panel_run(CLI::App& panel, int& exit_code) {
  auto options = std::make_shared<PanelRunOptions>();
  CLI::App* command = panel.add_subcommand("run", "Run every rollout of a panel file; write one row each.");
  command->add_option("PANEL", options->panel, "panel file (docs/panels.md)")->required();
  command->add_option("--out", options->out, "folder to write the rows into")->required();
  command->add_option("--workers", options->workers, "processes that share the work; rows do not depend on it")
      ->check(CLI::Range(1, 1024));
  command->add_option("--shard", options->shard, "I/N: run only the I-th of N parts of the plan");
  add_panel_choice(*command, options->choice);
  command->get_option("--until-decided")->excludes(command->get_option("--shard"));
  command->add_option("--only", options->only, "run the one rollout of this id, as post-mortems name it")
      ->excludes(command->get_option("--until-decided"));
  auto* const real_time =
      command->add_flag("--real-time", options->real_time, "with real processes, one robot after the other");
  command
      ->add_flag("--allow-non-realtime", options->allow_non_realtime,
                 "with --real-time: run even without real-time guarantees")
      ->needs(real_time);
  command->get_option("--workers")->excludes(real_time);
  command->get_option("--world")->excludes(real_time);
  command->add_flag("--resume", options->resume, "go on with what lies in --out; rollouts already there are skipped");
  command->add_flag("--json", options->json, "print one line of JSON instead of the table");
  command->footer(
      "Example: takt panel run config/panels/smoke.yaml --out runs/smoke --workers 2\n"
      "Exit codes: 0 every rollout has its row, however it ended; 1 it could not be run or written;\n"
      "64 command line; 65 panel or robot file.");
  command->callback([options, &exit_code] { exit_code = run(*options); });
}

}  // namespace takt::cli

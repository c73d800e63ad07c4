// SPDX-License-Identifier: Apache-2.0
#include "lab/judge/audit.hpp"

#include <fmt/format.h>

#include <algorithm>
#include <array>
#include <filesystem>
#include <map>
#include <set>

#include "config/load.hpp"
#include "lab/artifact/confusion.hpp"
#include "lab/artifact/inputs.hpp"
#include "lab/artifact/rollout_parquet.hpp"
#include "lab/artifact/seal.hpp"
#include "lab/judge/post_mortem.hpp"
#include "monitor/record/bounded_file.hpp"
#include "monitor/record/run_manifest.hpp"

namespace takt::lab {
namespace {

using Promise = std::expected<PanelPromise, std::string>;

constexpr double kShortestPeriod_s = 1e-4, kLongestPeriod_s = 0.1;  // of control, as robot files have it
constexpr std::size_t kClaimWords = 3;                              // at least

void find_other_contracts(const std::string& method, const std::string& task, const TaskFacts& facts,
                          const PanelPromise& promise, std::vector<std::string>& missing) {
  const auto found = promise.contracts.find({method, task});
  if (found == promise.contracts.end()) {
    missing.push_back(fmt::format("panel.yaml has no method {} on {}", method, task));
    return;
  }
  const auto differs = [&](std::string_view what, const std::optional<double>& wanted, double said) {
    if (!wanted || *wanted == said) return;
    missing.push_back(fmt::format("panel.yaml gives method {} on {} {} {:g}, the manifest says {:g}", method, task,
                                  what, *wanted, said));
  };
  differs("max_age in ms", found->second.max_age_ms, facts.max_age_ms);
  differs("epsilon", found->second.epsilon, facts.epsilon);
  differs("confidence", found->second.confidence, facts.confidence);
}

AuditItem metric_contract(const Artifact& artifact, const Promise& promise) {
  AuditItem item{.name = "metric contract", .answer = {}, .missing = {}};
  for (const auto& [name, method] : artifact.manifest.methods) {
    for (const auto& [task, facts] : method.tasks) {
      item.answer +=
          fmt::format("{}{} on {}: Pr(age > {:g} ms) <= {:g} % at {:g} % confidence", item.answer.empty() ? "" : "; ",
                      name, task, facts.max_age_ms, 100 * facts.epsilon, 100 * facts.confidence);
      const bool stated = facts.max_age_ms > 0 && facts.epsilon > 0 && facts.confidence > 0;
      if (!stated) item.missing.push_back(fmt::format("method {} states no freshness contract on {}", name, task));
      if (promise) find_other_contracts(name, task, facts, *promise, item.missing);
    }
  }
  if (artifact.manifest.methods.empty()) item.missing.emplace_back("the manifest names no method");
  return item;
}

// Every method under every condition, or a comparison is not one row by row.
void find_holes(const Artifact& artifact, std::vector<std::string>& missing) {
  std::set<evidence::PairKey> keys;
  std::map<std::string, std::set<evidence::PairKey>> of_method;
  for (const evidence::RolloutRow& row : artifact.rows) {
    keys.insert(evidence::pair_key(row));
    of_method[row.method].insert(evidence::pair_key(row));
  }
  for (const auto& [name, facts] : artifact.manifest.methods) {
    const std::size_t holes = keys.size() - of_method[name].size();
    if (holes != 0) missing.push_back(fmt::format("method {} lacks {} of {} conditions", name, holes, keys.size()));
  }
}

// A method that was compared elsewhere, or that did badly.
void find_unshown(const Artifact& artifact, const PanelPromise& promise, std::vector<std::string>& missing) {
  for (const auto& [name, configuration] : promise.methods)
    if (!artifact.manifest.methods.contains(name))
      missing.push_back(fmt::format("not shown: method {} of panel.yaml", name));
}

// A condition that no row has is one that every method lacks, and that no comparison of rows shows.
void find_untried(const Artifact& artifact, const PanelPromise& promise, std::vector<std::string>& missing) {
  std::set<evidence::PairKey> ran, planned;
  for (const evidence::RolloutRow& row : artifact.rows) ran.insert(evidence::pair_key(row));
  for (const PanelPromise::Condition& one : promise.conditions)
    for (const std::uint64_t seed : artifact.manifest.seed_plan.seeds)
      planned.insert({one.task, one.perturbation, one.dose, seed});
  const auto count_without = [](const std::set<evidence::PairKey>& some, const std::set<evidence::PairKey>& others) {
    return std::ranges::count_if(some, [&](const evidence::PairKey& key) { return !others.contains(key); });
  };
  if (const auto untried = count_without(planned, ran); untried != 0) {
    const evidence::PairKey& first =
        *std::ranges::find_if(planned, [&](const evidence::PairKey& key) { return !ran.contains(key); });
    missing.push_back(
        fmt::format("no method ran {} of the {} conditions of panel.yaml, such as {}.{}@{:g} with seed {}", untried,
                    planned.size(), first.task, first.perturbation, first.dose, first.seed));
  }
  if (const auto strange = count_without(ran, planned); strange != 0)
    missing.push_back(fmt::format("{} conditions are not in panel.yaml", strange));
}

AuditItem perturbation_panel(const Artifact& artifact, const Promise& promise) {
  const ArtifactManifest& manifest = artifact.manifest;
  std::map<std::string, std::size_t> perturbations;
  for (const evidence::RolloutRow& row : artifact.rows) ++perturbations[row.perturbation];
  AuditItem item{.name = "perturbation panel",
                 .answer = fmt::format("{}, {} seeds ({}):", manifest.panel, manifest.seed_plan.seeds.size(),
                                       manifest.seed_plan.rule),
                 .missing = {}};
  if (!manifest.until_decided.empty()) item.answer.insert(item.answer.size() - 1, "; ends when success is decided");
  for (const auto& [name, count] : perturbations) item.answer += fmt::format(" {} {},", name, count);
  item.answer.back() = perturbations.empty() ? ' ' : '.';
  const bool any = std::ranges::any_of(perturbations, [](const auto& each) { return each.first != "none"; });
  if (!any) item.missing.emplace_back("no rollout was perturbed");
  if (!perturbations.contains("none")) item.missing.emplace_back("no rollout was nominal");
  const auto text = monitor::read_file(artifact.folder.panel());
  if (!text) {
    item.missing.emplace_back("panel.yaml is not in the folder");
  } else if (config::sha256_hex(*text) != manifest.panel_sha256) {
    item.missing.emplace_back("panel.yaml is not the panel that the manifest names");
  } else if (!promise) {
    item.missing.push_back(fmt::format("panel.yaml is no panel of this version: {}", promise.error()));
  } else {
    find_unshown(artifact, *promise, item.missing);
    find_untried(artifact, *promise, item.missing);
  }
  find_holes(artifact, item.missing);
  return item;
}

// Why the panel's rollouts do not end so; empty: they may. Robot files, which say the exact period, are elsewhere.
// `world_says`: a program outside may, at any time, that the task is done.
std::string impossible_end(const evidence::RolloutRow& row, const PanelPromise::Outcome& panel, bool world_says) {
  const auto ticks = static_cast<double>(row.ticks);
  if (const double most = panel.duration_s / kShortestPeriod_s + 1; ticks > most)
    return fmt::format("has {} ticks, and {:g} s have at most {:.0f}", row.ticks, panel.duration_s, most);
  if (!panel.bound_m || world_says) return {};
  // Half of them may be lost to whatever preempts the loop.
  if (const double least = panel.duration_s / kLongestPeriod_s / 2; row.success && ticks < least)
    return fmt::format("is a success of {} ticks, and {:g} s have at least {:.0f}", row.ticks, panel.duration_s, least);
  if (row.success && row.tracking_error_rms_m > *panel.bound_m)
    return fmt::format("is a success with {:g} m of error, and panel.yaml's bound is {:g} m", row.tracking_error_rms_m,
                       *panel.bound_m);
  if (row.failure_label == "tracking_error" && row.tracking_error_rms_m <= *panel.bound_m)
    return fmt::format("failed by an error of {:g} m, and panel.yaml's bound is {:g} m", row.tracking_error_rms_m,
                       *panel.bound_m);
  return {};
}

void find_impossible_ends(const Artifact& artifact, const PanelPromise& promise, std::vector<std::string>& missing) {
  const bool world_says = !artifact.manifest.outside.world.command.empty();
  for (std::size_t index = 0; index < artifact.rows.size(); ++index) {
    const evidence::RolloutRow& row = artifact.rows[index];
    const auto panel = promise.outcomes.find(row.task);
    if (panel == promise.outcomes.end()) continue;
    if (const std::string why = impossible_end(row, panel->second, world_says); !why.empty())
      missing.push_back(fmt::format("row {} {}", index + 1, why));
  }
}

AuditItem monitor_state(const Artifact& artifact, const Promise& promise) {
  AuditItem item{.name = "monitor state", .answer = {}, .missing = {}};
  std::map<std::string, std::size_t> ends;
  std::size_t unhashed = 0;
  if (promise) find_impossible_ends(artifact, *promise, item.missing);
  for (const evidence::RolloutRow& row : artifact.rows) {
    ++ends[row.final_mode == Mode::tracking ? std::string(name(row.final_mode))
                                            : fmt::format("{} ({})", name(row.final_mode), name(row.final_cause))];
    if (row.replay_hash.empty()) ++unhashed;
  }
  for (const auto& [end, count] : ends) {
    item.answer += fmt::format("{}{} {}", item.answer.empty() ? "ended in " : ", ", end, count);
  }
  if (artifact.rows.empty()) item.missing.emplace_back("there is no row");
  if (unhashed != 0) item.missing.push_back(fmt::format("{} rows have no replay hash", unhashed));
  return item;
}

AuditItem artifact_id(const Artifact& artifact) {
  const ArtifactManifest& manifest = artifact.manifest;
  AuditItem item{.name = "artifact id", .answer = manifest.artifact_id, .missing = {}};
  if (!manifest.complete) {
    item.missing.push_back(fmt::format("the panel is unfinished: {} of {} planned rollouts", artifact.rows.size(),
                                       manifest.planned_rollouts));
    return item;
  }
  if (manifest.script_source_sha256.empty()) {
    item.missing.emplace_back("the script is known by its version only, not by the hash of its sources");
  }
  if (monitor::read_file(artifact.folder.parquet()) != rollouts_parquet(artifact.rows, manifest.artifact_id)) {
    item.missing.emplace_back("rollouts.parquet does not hold the rows of rollouts.jsonl");
  }
  return item;
}

AuditItem run_folders(const Artifact& artifact) {
  AuditItem item{.name = "run folders", .answer = {}, .missing = {}};
  if (!artifact.manifest.complete) {
    item.answer = "not sealed before the panel is complete";
    return item;
  }
  SealedRuns runs = look_at_runs(artifact.folder);
  const auto kept =
      std::ranges::count_if(artifact.rows, [](const evidence::RolloutRow& row) { return !row.run_folder.empty(); });
  item.answer =
      kept == 0 ? "none was kept" : fmt::format("{} of {} rollouts, {} files", kept, artifact.rows.size(), runs.files);
  item.missing = std::move(runs.altered);
  return item;
}

AuditItem kept_inputs(const Artifact& artifact) {
  AuditItem item{.name = "inputs", .answer = "none kept: --recompute needs --panel", .missing = {}};
  if (!keeps_inputs(artifact.folder)) return item;
  item.missing = altered_inputs(artifact.folder);
  const auto inputs = read_inputs(artifact.folder);
  if (!inputs) return item;
  std::size_t files = 0;
  for (const auto& [task, kept] : inputs->tasks) files += kept.size();
  item.answer = fmt::format("{} files of {} tasks kept", files, inputs->tasks.size());
  if (!inputs->not_kept.empty())
    item.answer += fmt::format("; {} named only, such as {}", inputs->not_kept.size(), inputs->not_kept.begin()->first);
  return item;
}

AuditItem registration(const Artifact& artifact) {
  const bool is_kept = std::filesystem::exists(artifact.folder.registration());
  return {.name = "registration",
          .answer = is_kept ? "kept: --registered-by says whose, and what ran otherwise" : "none",
          .missing = {}};
}

AuditItem fault_verdicts(const Artifact& artifact) {
  AuditItem item{.name = "fault verdicts", .answer = {}, .missing = {}};
  for (const auto& [method, confusion] : confusions_of(artifact.rows)) {
    const auto recall = confusion.macro_recall();
    if (!recall) continue;
    item.answer += fmt::format("{}{}: macro recall {:.3f}, {} of {} nominal labelled", item.answer.empty() ? "" : "; ",
                               method, *recall, confusion.nominal_labelled(), confusion.nominal_rollouts());
  }
  if (item.answer.empty()) item.answer = "the panel plants no cause that the classifier names";
  const ArtifactManifest& manifest = artifact.manifest;
  if (!manifest.complete) return item;
  if (monitor::read_file(artifact.folder.confusion()) != confusion_file_text(manifest.artifact_id, artifact.rows)) {
    item.missing.emplace_back("confusion.json does not hold what the rows say");
  }
  return item;
}

// `text`: one of the claims. Without a panel file the manifest answers, and the panel's own item is not ready.
AuditItem claim(std::string_view name, const Artifact& artifact, const Promise& promise, std::string Claims::*text) {
  const std::string& said = artifact.manifest.claims.*text;
  AuditItem item{
      .name = fmt::format("{} claim", name), .answer = promise ? promise->claims.*text : said, .missing = {}};
  if (item.answer.empty()) item.missing.push_back(fmt::format("the panel file has no claims.{}", name));
  if (!item.answer.empty() && words_in(item.answer) < kClaimWords)
    item.missing.push_back(fmt::format("claims.{} claims nothing in {} words", name, words_in(item.answer)));
  if (item.answer != said) item.missing.push_back(fmt::format("the manifest claims otherwise: {}", said));
  return item;
}

AuditItem post_mortems(const Artifact& artifact) {
  AuditItem item{.name = "post-mortems", .answer = {}, .missing = {}};
  std::size_t failed = 0, completed = 0;
  for (std::size_t index = 0; index < artifact.rows.size(); ++index) {
    const evidence::RolloutRow& row = artifact.rows[index];
    if (row.success) continue;
    ++failed;
    switch (post_mortem_state(artifact, row)) {
      case PostMortemState::completed:
        ++completed;
        break;
      case PostMortemState::signed_only:
        item.missing.push_back(fmt::format("row {} failed ({}) and postmortems/{}.md has a name and no conclusion",
                                           index + 1, row.failure_label, evidence::rollout_id(row)));
        break;
      case PostMortemState::drafted:
        item.missing.push_back(fmt::format("row {} failed ({}) and postmortems/{}.md is not completed", index + 1,
                                           row.failure_label, evidence::rollout_id(row)));
        break;
      case PostMortemState::missing:
        item.missing.push_back(fmt::format("row {} failed ({}) and postmortems/{}.md does not exist", index + 1,
                                           row.failure_label, evidence::rollout_id(row)));
        break;
    }
  }
  item.answer = failed == 0 ? "no rollout failed" : fmt::format("{} of {} failed rollouts", completed, failed);
  return item;
}

using Registration = std::expected<Registered, std::string>;

std::string registered_lines(const Registration& registered) {
  if (!registered) return fmt::format("{:<20}differs: {}\n", "registered", registered.error());
  std::string text = fmt::format("{:<20}{} by {}; the first row is not older than {}\n", "registered",
                                 monitor::utc_text(registered->unix_ns),
                                 registered->stamped_by.empty() ? "the signer's clock" : registered->stamped_by,
                                 monitor::utc_text(registered->first_row_unix_ns));
  if (!registered->comparison.empty()) text += fmt::format("{:<20}to decide: {}\n", "", registered->comparison);
  if (!registered->is_older()) text += fmt::format("{:<20}differs: the panel had begun\n", "");
  for (const std::string& one : registered->differences) text += fmt::format("{:<20}differs: {}\n", "", one);
  return text;
}

std::string registered_rests(const Registration& registered) {
  if (!registered) return "not registered by that key";
  if (!registered->is_older()) return "registered after the panel began";
  if (!registered->differences.empty()) return "registered otherwise than it ran";
  return "registered by " + registered->key;
}

nlohmann::ordered_json registered_json(const Registration& registered) {
  if (!registered) return {{"refusal", registered.error()}};
  return {{"key", registered->key},
          {"utc", monitor::utc_text(registered->unix_ns)},
          {"stamped_by", registered->stamped_by},
          {"first_row_utc", monitor::utc_text(registered->first_row_unix_ns)},
          {"older", registered->is_older()},
          {"comparison", registered->comparison},
          {"differences", registered->differences}};
}

}  // namespace

bool Audit::is_consistent() const {
  return std::ranges::all_of(items, [](const AuditItem& item) { return item.missing.empty(); }) &&
         (!recomputed || recomputed->differences.empty()) && vouching.holds() &&
         (!registered || (registered->has_value() && (*registered)->holds()));
}

bool Audit::is_ready() const {
  return is_consistent() && ((recomputed && recomputed->rows > 0) || vouching.is_signed() || registered);
}

Audit audit(const Artifact& artifact, const Promise& promise) {
  return {.artifact_id = artifact.manifest.artifact_id,
          .items = {metric_contract(artifact, promise), perturbation_panel(artifact, promise),
                    monitor_state(artifact, promise), artifact_id(artifact), run_folders(artifact),
                    kept_inputs(artifact), registration(artifact), fault_verdicts(artifact),
                    claim("conceptual", artifact, promise, &Claims::conceptual),
                    claim("systems", artifact, promise, &Claims::systems),
                    claim("evidence", artifact, promise, &Claims::evidence), post_mortems(artifact)},
          .recomputed = {},
          .vouching = {},
          .registered = {}};
}

std::string audit_text(const Audit& audit) {
  constexpr std::size_t kListed = 20;
  std::string text;
  std::size_t missing = 0;
  for (const AuditItem& item : audit.items) {
    text += fmt::format("{:<20}{}\n", item.name, item.answer.empty() ? "none" : item.answer);
    for (std::size_t index = 0; index < std::min(kListed, item.missing.size()); ++index) {
      text += fmt::format("{:<20}missing: {}\n", "", item.missing[index]);
    }
    if (item.missing.size() > kListed) text += fmt::format("{:<20}and {} more\n", "", item.missing.size() - kListed);
    missing += item.missing.size();
  }
  std::string rests = missing == 0 ? "consistent" : fmt::format("{} missing", missing);
  if (audit.recomputed) {
    rests += fmt::format("; {} of {} rows computed anew", audit.recomputed->rows, audit.recomputed->of);
    for (const std::string& difference : audit.recomputed->differences)
      text += fmt::format("{:<20}differs: {}\n", "recomputed", difference);
    if (!audit.recomputed->differences.empty())
      rests += fmt::format(", {} came out otherwise", audit.recomputed->differences.size());
  } else {
    rests += "; no row computed anew";
  }
  text += vouching_lines(audit.vouching);
  if (audit.vouching.signed_by) rests += "; " + vouching_rests(audit.vouching);
  if (audit.registered) {
    text += registered_lines(*audit.registered);
    rests += "; " + registered_rests(*audit.registered);
  }
  text += fmt::format("{:<20}{}\n", "rests on", rests);
  if (audit.is_ready()) return text + "audit-ready\n";
  if (audit.is_consistent())
    return text + "consistent: nothing is missing; --recompute, --signed-by or --registered-by makes it audit-ready\n";
  return text + "not audit-ready\n";
}

std::string audit_text(const evidence::Attestation& attestation, const std::optional<Recomputed>& recomputed) {
  std::string text = fmt::format("{:<20}{} of {}\n{:<20}{}\n", "attestation", attestation.of, attestation.robot, "says",
                                 evidence::what_it_shows(attestation));
  std::string rests = "consistent; no rollout computed anew";
  if (recomputed) rests = fmt::format("consistent; {} of {} rollouts computed anew", recomputed->rows, recomputed->of);
  if (recomputed && !recomputed->differences.empty()) {
    for (const std::string& one : recomputed->differences)
      text += fmt::format("{:<20}differs: {}\n", "recomputed", one);
    rests += fmt::format(", {} came out otherwise", recomputed->differences.size());
  }
  text += fmt::format("{:<20}{}\n", "rests on", rests);
  if (!recomputed) return text + "consistent: --recompute with --robot makes it audit-ready\n";
  return text + (recomputed->differences.empty() ? "audit-ready\n" : "not audit-ready\n");
}

nlohmann::ordered_json to_json(const Audit& audit) {
  nlohmann::ordered_json json{{"schema", kAuditSchema},
                              {"artifact_id", audit.artifact_id},
                              {"consistent", audit.is_consistent()},
                              {"audit_ready", audit.is_ready()},
                              {"recomputed", nullptr},
                              {"items", nlohmann::ordered_json::array()}};
  if (audit.recomputed)
    json["recomputed"] = {
        {"rows", audit.recomputed->rows}, {"of", audit.recomputed->of}, {"differences", audit.recomputed->differences}};
  add_vouching(audit.vouching, json);
  json["registered"] = nullptr;
  if (audit.registered) json["registered"] = registered_json(*audit.registered);
  for (const AuditItem& item : audit.items) {
    json["items"].push_back({{"name", item.name}, {"answer", item.answer}, {"missing", item.missing}});
  }
  return json;
}

}  // namespace takt::lab

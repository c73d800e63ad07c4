// SPDX-License-Identifier: Apache-2.0
#include "lab/artifact/artifact_manifest.hpp"

#include <fmt/format.h>

#include <algorithm>
#include <cmath>
#include <initializer_list>
#include <set>
#include <string_view>

#include "config/load.hpp"
#include "config/printable.hpp"
#include "monitor/judge/freshness_statistics.hpp"
#include "monitor/record/json_error.hpp"
#include "monitor/record/run_manifest.hpp"

namespace takt::lab {
namespace {

using Json = nlohmann::ordered_json;

// First key of `json` that is not in `keys`, or of `keys` that is not in `json`; thrown so that nested calls stay
// short.
struct BadManifest {
  std::string sentence;
};

void check_object(const Json& json, std::string_view what, std::initializer_list<std::string_view> keys,
                  std::initializer_list<std::string_view> optional = {}) {
  if (!json.is_object()) throw BadManifest{fmt::format("{} is not an object", what)};
  for (const std::string_view key : keys) {
    if (!json.contains(key)) throw BadManifest{fmt::format("{}.{} is missing", what, key)};
  }
  for (const auto& [key, value] : json.items()) {
    if (std::ranges::find(keys, key) == keys.end() && std::ranges::find(optional, key) == optional.end())
      throw BadManifest{fmt::format("{}.{} is unknown", what, key)};
  }
}

Json moment(std::int64_t unix_ns) {
  if (unix_ns == 0) return nullptr;
  return {{"utc", monitor::utc_text(unix_ns)}, {"unix_ns", unix_ns}};
}

std::int64_t moment_of(const Json& json, std::string_view what) {
  if (json.is_null()) return 0;
  check_object(json, what, {"utc", "unix_ns"});
  return json.at("unix_ns").get<std::int64_t>();
}

Json method_json(const MethodFacts& method) {
  Json tasks = Json::object();
  for (const auto& [task, facts] : method.tasks) {
    tasks[task] = {{"config_sha256", facts.config_sha256},
                   {"policy_sha256", facts.policy_sha256},
                   {"metric_contract",
                    {{"max_age_ms", facts.max_age_ms}, {"epsilon", facts.epsilon}, {"confidence", facts.confidence}}}};
  }
  return {{"description", method.description}, {"tasks", std::move(tasks)}};
}

TaskFacts task_facts_of(const Json& json, const std::string& what) {
  check_object(json, what, {"config_sha256", "policy_sha256", "metric_contract"});
  const Json& contract = json.at("metric_contract");
  check_object(contract, what + ".metric_contract", {"max_age_ms", "epsilon", "confidence"});
  return {.config_sha256 = json.at("config_sha256"),
          .policy_sha256 = json.at("policy_sha256"),
          .max_age_ms = contract.at("max_age_ms"),
          .epsilon = contract.at("epsilon"),
          .confidence = contract.at("confidence")};
}

MethodFacts method_of(const Json& json, const std::string& name) {
  const std::string what = "methods." + name;
  check_object(json, what, {"description", "tasks"});
  MethodFacts method{.description = json.at("description"), .tasks = {}};
  for (const auto& [task, facts] : json.at("tasks").items())
    method.tasks[task] = task_facts_of(facts, fmt::format("{}.tasks.{}", what, task));
  return method;
}

// Left out where there was none.
constexpr const char *kOutside = "outside", *kUntilDecided = "until_decided";

Json program_json(const OutsideProgram& program) {
  if (program.command.empty()) return nullptr;
  return {{"command", program.command}, {"files", Json(program.files)}};
}

OutsideProgram program_of(const Json& json, const std::string& what) {
  if (json.is_null()) return {};
  check_object(json, what, {"command", "files"});
  OutsideProgram program{.command = json.at("command"), .files = {}};
  for (const auto& [file, sha256] : json.at("files").items()) program.files[file] = sha256;
  return program;
}

Timing timing_of(const Json& json) {
  const auto found = std::ranges::find(kTimingNames, json.get<std::string>());
  if (found == kTimingNames.end()) throw BadManifest{fmt::format("timing {} is unknown", json.dump())};
  return static_cast<Timing>(found - kTimingNames.begin());
}

ArtifactManifest read(const Json& json) {
  check_object(json, "manifest",
               {"schema", "artifact_id", "complete", "timing", "panel", "seed_plan", "script", "row_schema_sha256",
                "plants", "methods", "claims", "planned_rollouts", "shard", "merged_from", "host", "started", "ended"},
               {kOutside, kUntilDecided});
  ArtifactManifest manifest;
  manifest.artifact_id = json.at("artifact_id");
  manifest.complete = json.at("complete");
  manifest.timing = timing_of(json.at("timing"));
  const Json& panel = json.at("panel");
  check_object(panel, "panel", {"id", "sha256"});
  manifest.panel = panel.at("id");
  manifest.panel_sha256 = panel.at("sha256");
  const Json& plan = json.at("seed_plan");
  check_object(plan, "seed_plan", {"rule", "seeds"});
  plan.at("rule").get_to(manifest.seed_plan.rule);
  plan.at("seeds").get_to(manifest.seed_plan.seeds);
  const Json& script = json.at("script");
  check_object(script, "script", {"version", "source_sha256"});
  manifest.script_version = script.at("version");
  manifest.script_source_sha256 = script.at("source_sha256");
  manifest.schema_sha256 = json.at("row_schema_sha256");
  for (const auto& [task, sha256] : json.at("plants").items()) manifest.plants[task] = sha256;
  for (const auto& [name, facts] : json.at("methods").items()) manifest.methods[name] = method_of(facts, name);
  const Json& claims = json.at("claims");
  check_object(claims, "claims", {"conceptual", "systems", "evidence"});
  manifest.claims = {claims.at("conceptual"), claims.at("systems"), claims.at("evidence")};
  if (json.contains(kOutside)) {
    const Json& outside = json.at(kOutside);
    check_object(outside, kOutside, {"world", "policy_host"});
    manifest.outside = {program_of(outside.at("world"), "outside.world"),
                        program_of(outside.at("policy_host"), "outside.policy_host")};
  }
  manifest.planned_rollouts = json.at("planned_rollouts");
  const Json& shard = json.at("shard");
  check_object(shard, "shard", {"index", "count"});
  manifest.shard = {shard.at("index"), shard.at("count")};
  if (json.contains(kUntilDecided)) json.at(kUntilDecided).get_to(manifest.until_decided);
  json.at("merged_from").get_to(manifest.merged_from);
  manifest.host = json.at("host");
  manifest.started_unix_ns = moment_of(json.at("started"), "started");
  manifest.ended_unix_ns = moment_of(json.at("ended"), "ended");
  return manifest;
}

std::string_view short_hash(const std::string& sha256) {
  constexpr std::size_t kShown = 12;
  return sha256.empty() ? std::string_view("not known") : std::string_view(sha256).substr(0, kShown);
}

std::string plan_text(const SeedPlan& plan) {
  return fmt::format("{} seeds, \"{}\"", plan.seeds.size(), plan.rule);
}

std::string plant_difference(const ArtifactManifest& a, const ArtifactManifest& b, const std::string& name_a,
                             const std::string& name_b) {
  for (const auto& [task, sha256] : a.plants) {
    const auto other = b.plants.find(task);
    if (other == b.plants.end()) return fmt::format("the plant of task {} is only in {}", task, name_a);
    if (other->second != sha256) {
      return fmt::format("the plant of task {} differs: {} has {}, {} has {}", task, name_a, short_hash(sha256), name_b,
                         short_hash(other->second));
    }
  }
  for (const auto& [task, sha256] : b.plants) {
    if (!a.plants.contains(task)) return fmt::format("the plant of task {} is only in {}", task, name_b);
  }
  return {};
}

}  // namespace

SeedPlan seed_plan_of(std::uint64_t first, std::uint64_t count) {
  SeedPlan plan{.rule = fmt::format("seeds {} to {}, the same for every method", first, first + count - 1),
                .seeds = {}};
  for (std::uint64_t seed = 0; seed < count; ++seed) plan.seeds.push_back(first + seed);
  return plan;
}

std::string contents_of(const OutsideProgram& program) {
  std::set<std::string> hashes;
  for (const auto& [file, sha256] : program.files) hashes.insert(sha256);
  std::string text;
  for (const std::string& sha256 : hashes) text += sha256;
  return hashes.size() < 2 ? text : config::sha256_hex(text);
}

Json to_json(const ArtifactManifest& manifest) {
  Json json;
  json["schema"] = kArtifactSchema;
  json["artifact_id"] = manifest.artifact_id;
  json["complete"] = manifest.complete;
  json["timing"] = kTimingNames[static_cast<std::size_t>(manifest.timing)];
  json["panel"] = {{"id", manifest.panel}, {"sha256", manifest.panel_sha256}};
  json["seed_plan"] = {{"rule", manifest.seed_plan.rule}, {"seeds", manifest.seed_plan.seeds}};
  json["script"] = {{"version", manifest.script_version}, {"source_sha256", manifest.script_source_sha256}};
  json["row_schema_sha256"] = manifest.schema_sha256;
  json["plants"] = Json(manifest.plants);
  json["methods"] = Json::object();
  for (const auto& [name, facts] : manifest.methods) json["methods"][name] = method_json(facts);
  json["claims"] = {{"conceptual", manifest.claims.conceptual},
                    {"systems", manifest.claims.systems},
                    {"evidence", manifest.claims.evidence}};
  if (!manifest.outside.world.command.empty() || !manifest.outside.policy_host.command.empty())
    json[kOutside] = {{"world", program_json(manifest.outside.world)},
                      {"policy_host", program_json(manifest.outside.policy_host)}};
  json["planned_rollouts"] = manifest.planned_rollouts;
  json["shard"] = {{"index", manifest.shard.index}, {"count", manifest.shard.count}};
  if (!manifest.until_decided.empty()) json[kUntilDecided] = manifest.until_decided;
  json["merged_from"] = manifest.merged_from;
  json["host"] = manifest.host;
  json["started"] = moment(manifest.started_unix_ns);
  json["ended"] = moment(manifest.ended_unix_ns);
  return json;
}

std::expected<ArtifactManifest, std::string> artifact_manifest_of(const Json& json) {
  try {
    if (const std::string schema = json.at("schema"); schema != kArtifactSchema) {
      return std::unexpected(fmt::format("manifest.json has schema {}, this version reads {}",
                                         config::printable(schema), kArtifactSchema));
    }
    return read(json);
  } catch (const BadManifest& bad) {
    return std::unexpected(
        fmt::format("manifest.json is not an artifact's manifest: {}", config::printable(bad.sentence)));
  } catch (const nlohmann::json::exception& error) {
    return std::unexpected(
        fmt::format("manifest.json is not an artifact's manifest: {}", config::printable(monitor::sentence_of(error))));
  }
}

std::string difference_between(const ArtifactManifest& a, const ArtifactManifest& b, const std::string& name_a,
                               const std::string& name_b) {
  const auto differ = [&](std::string_view what, std::string_view in_a, std::string_view in_b) {
    return fmt::format("the {} differs: {} has {}, {} has {}", what, name_a, in_a, name_b, in_b);
  };
  if (a.schema_sha256 != b.schema_sha256) {
    return differ("row schema", short_hash(a.schema_sha256), short_hash(b.schema_sha256));
  }
  if (a.timing != b.timing) {
    return differ("timing", kTimingNames[static_cast<std::size_t>(a.timing)],
                  kTimingNames[static_cast<std::size_t>(b.timing)]);
  }
  if (a.panel != b.panel || a.panel_sha256 != b.panel_sha256) {
    return differ("panel", fmt::format("{} {}", a.panel, short_hash(a.panel_sha256)),
                  fmt::format("{} {}", b.panel, short_hash(b.panel_sha256)));
  }
  if (a.seed_plan != b.seed_plan) return differ("seed plan", plan_text(a.seed_plan), plan_text(b.seed_plan));
  if (a.script_version != b.script_version || a.script_source_sha256 != b.script_source_sha256) {
    return differ("script", fmt::format("takt {} {}", a.script_version, short_hash(a.script_source_sha256)),
                  fmt::format("takt {} {}", b.script_version, short_hash(b.script_source_sha256)));
  }
  if (std::string reason = plant_difference(a, b, name_a, name_b); !reason.empty()) return reason;
  if (const auto in_a = contents_of(a.outside.world), in_b = contents_of(b.outside.world); in_a != in_b)
    return differ("world's program", short_hash(in_a), short_hash(in_b));
  return {};
}

std::string misfit(const evidence::RolloutRow& row, const ArtifactManifest& manifest) {
  if (row.panel != manifest.panel || row.panel_sha256 != manifest.panel_sha256) return "comes from another panel";
  if (row.script_version != manifest.script_version || row.script_source_sha256 != manifest.script_source_sha256) {
    return "comes from another script";
  }
  if (std::ranges::find(manifest.seed_plan.seeds, row.seed) == manifest.seed_plan.seeds.end()) {
    return fmt::format("has seed {}, which is not in the seed plan", row.seed);
  }
  const auto plant = manifest.plants.find(row.task);
  if (plant == manifest.plants.end()) return fmt::format("has task {}, which is not in the manifest", row.task);
  if (plant->second != row.plant_sha256) return "comes from another plant";
  const auto method = manifest.methods.find(row.method);
  if (method == manifest.methods.end()) return fmt::format("has method {}, which is not in the manifest", row.method);
  const auto facts = method->second.tasks.find(row.task);
  if (facts == method->second.tasks.end())
    return fmt::format("has task {}, which the manifest does not know of method {}", row.task, row.method);
  if (facts->second.config_sha256 != row.config_sha256) return "comes from another configuration of its method";
  if (facts->second.policy_sha256 != row.policy_sha256) return "comes from another policy file of its method";
  for (const auto& [name, misses] :
       {std::pair{"misses_per_command", &row.misses_per_command}, std::pair{"misses_per_tick", &row.misses_per_tick}}) {
    const monitor::MissRate of_parts = monitor::miss_rate(misses->misses, misses->count, misses->effective_count,
                                                          facts->second.epsilon, facts->second.confidence);
    if (std::abs(misses->upper_bound - of_parts.upper_bound) > 1e-9)
      return fmt::format("has {}.upper_bound {}, and {} of {} have {}", name, misses->upper_bound, misses->misses,
                         misses->count, of_parts.upper_bound);
  }
  return {};
}

}  // namespace takt::lab

// SPDX-License-Identifier: Apache-2.0
// manifest.json of an artifact: what its rows were computed from. Two artifacts may be compared or merged only where
// difference_between() finds nothing; the rows of one artifact must all agree with its manifest.
#pragma once

#include <array>
#include <cstdint>
#include <expected>
#include <map>
#include <nlohmann/json.hpp>
#include <string>
#include <string_view>
#include <vector>

#include "evidence/rollout/rollout_row.hpp"

namespace takt::lab {

// How the rollouts' time passed: computed, or lived through by real processes; in the latter case with the real-time
// guarantees of the executive's set-up, or knowingly without (`--allow-non-realtime`).
enum class Timing : std::uint8_t { virtual_time, real, real_without_guarantees };
inline constexpr std::array<std::string_view, 3> kTimingNames{"virtual", "real", "real_without_guarantees"};

inline constexpr const char* kProgramHash = "program_sha256";  // in `host`: of the executable that computed the rows

inline constexpr const char* kArtifactSchema = "takt.artifact/4";

// Every rollout's seed comes from here, whatever the method: that is what makes rows pairs.
struct SeedPlan {
  std::string rule;                  // in words: "seeds 1 to 20, the same for every method"
  std::vector<std::uint64_t> seeds;  // in plan order
  friend bool operator==(const SeedPlan&, const SeedPlan&) = default;
};
// `count` > 0 seeds from `first` on.
SeedPlan seed_plan_of(std::uint64_t first, std::uint64_t count);

// A method on one task: its configuration is that task's robot, with what the method says otherwise.
struct TaskFacts {
  std::string config_sha256;
  std::string policy_sha256;  // empty: none
  // Its freshness contract: Pr(age > max_age) <= epsilon, at this confidence.
  double max_age_ms = 0, epsilon = 0, confidence = 0;
  friend bool operator==(const TaskFacts&, const TaskFacts&) = default;
  [[nodiscard]] bool has_contract_of(const TaskFacts& other) const {
    return max_age_ms == other.max_age_ms && epsilon == other.epsilon && confidence == other.confidence;
  }
};

struct MethodFacts {
  std::string description;
  std::map<std::string, TaskFacts> tasks;  // by name: every task of the panel
  friend bool operator==(const MethodFacts&, const MethodFacts&) = default;
};

// From the panel file's `claims:`; empty texts are claims not made.
struct Claims {
  std::string conceptual;  // why the method should help
  std::string systems;     // which interface it changes
  std::string evidence;    // which measurement would convince a sceptical builder
  friend bool operator==(const Claims&, const Claims&) = default;
};

// Which part of the panel's plan an artifact holds: every count-th rollout, from the index-th (from 1).
struct ShardFacts {
  std::uint64_t index = 1, count = 1;
  friend bool operator==(const ShardFacts&, const ShardFacts&) = default;
};

// A command of the user's that played a part, and the files that it names, by their contents. What those load in turn
// is not known.
struct OutsideProgram {
  std::string command;                       // empty: none
  std::map<std::string, std::string> files;  // as the command names them -> SHA-256
};
struct OutsidePrograms {
  OutsideProgram world, policy_host;
};

struct ArtifactManifest {
  std::string artifact_id;  // artifact_id_of() all rows; empty until complete
  Timing timing = Timing::virtual_time;
  std::string panel, panel_sha256;
  SeedPlan seed_plan;
  std::string script_version, script_source_sha256;
  std::string schema_sha256;                   // of rollout_schema()
  std::map<std::string, std::string> plants;   // task -> SHA-256 of the plant's text
  std::map<std::string, MethodFacts> methods;  // by name
  Claims claims;
  OutsidePrograms outside;
  std::uint64_t planned_rollouts = 0;  // of its shard
  ShardFacts shard;
  // Both methods, where the panel ends as soon as their success is decided (sequential_decision.hpp).
  std::vector<std::string> until_decided;
  bool complete = false;                                // every planned rollout has its row
  std::vector<std::string> merged_from;                 // artifact ids
  nlohmann::ordered_json host = nullptr;                // of the machine that computed it, and of the program
  std::int64_t started_unix_ns = 0, ended_unix_ns = 0;  // 0: not yet
};

// One hash of all of the files, whatever they are called; empty: the command names none.
std::string contents_of(const OutsideProgram& program);

nlohmann::ordered_json to_json(const ArtifactManifest& manifest);
// Strict: a missing, unknown or wrongly typed key is one sentence.
std::expected<ArtifactManifest, std::string> artifact_manifest_of(const nlohmann::ordered_json& json);

// Why rows of the two must not stand side by side: schema, timing, panel, seed plan, script, plant, world, in this
// order.
// Empty: they may. `a` and `b` are how the sentence names the two.
std::string difference_between(const ArtifactManifest& a, const ArtifactManifest& b, const std::string& name_a = "A",
                               const std::string& name_b = "B");
// Why the row cannot belong to the artifact; empty: it can.
std::string misfit(const evidence::RolloutRow& row, const ArtifactManifest& manifest);

}  // namespace takt::lab

// SPDX-License-Identifier: Apache-2.0
// The artifact of a panel: one folder that carries success, failure, latency, safety and robustness together.
//
//   manifest.json         what the rows were computed from (artifact_manifest.hpp)
//   panel.yaml            the panel file, byte for byte
//   rollout.schema.json   JSON Schema of a row
//   rollouts.jsonl        one line per rollout, appended as they end, each on the medium before the next begins
//   rollouts.sha256       the seal of each row; seal.json: of all files, once finished (seal.hpp)
//   rollouts.parquet      the same rows as columns; written when the panel is complete
//   confusion.json        planted causes against the fault classifier's verdicts; written with the Parquet file
//   inputs.json, inputs/  what the rows were computed from, by content (inputs.hpp)
//   registration.dsse.json, registration.tsr   what the panel was to show, where it was registered before it ran
//   postmortems/ID.md     one per failed rollout
//
// Errors are one sentence with the row's number, counted from 1. Thread rule: one thread at a time.
#pragma once

#include <expected>
#include <memory>
#include <set>
#include <span>
#include <string>
#include <string_view>
#include <vector>

#include "evidence/rollout/rollout_row.hpp"
#include "lab/artifact/artifact_manifest.hpp"

namespace takt::lab {

class ArtifactFolder {
 public:
  static constexpr const char *kRegistration = "registration.dsse.json", *kRegistrationStamp = "registration.tsr";
  explicit ArtifactFolder(std::string path) : path_(std::move(path)) {}
  [[nodiscard]] const std::string& path() const { return path_; }
  [[nodiscard]] std::string manifest() const { return path_ + "/manifest.json"; }
  [[nodiscard]] std::string panel() const { return path_ + "/panel.yaml"; }
  [[nodiscard]] std::string schema() const { return path_ + "/rollout.schema.json"; }
  [[nodiscard]] std::string rows() const { return path_ + "/rollouts.jsonl"; }
  [[nodiscard]] std::string row_seals() const { return path_ + "/rollouts.sha256"; }
  [[nodiscard]] std::string seal() const { return path_ + "/seal.json"; }
  [[nodiscard]] std::string lock() const { return path_ + "/.writer.lock"; }
  [[nodiscard]] std::string parquet() const { return path_ + "/rollouts.parquet"; }
  [[nodiscard]] std::string confusion() const { return path_ + "/confusion.json"; }
  [[nodiscard]] std::string inputs_file() const { return path_ + "/inputs.json"; }
  [[nodiscard]] std::string inputs() const { return path_ + "/inputs"; }
  [[nodiscard]] std::string registration() const { return path_ + "/" + kRegistration; }
  [[nodiscard]] std::string registration_stamp() const { return path_ + "/" + kRegistrationStamp; }
  [[nodiscard]] std::string post_mortems() const { return path_ + "/postmortems"; }
  [[nodiscard]] std::string post_mortem(const evidence::RolloutRow& row) const;

  [[nodiscard]] std::expected<ArtifactManifest, std::string> read_manifest() const;
  [[nodiscard]] std::expected<void, std::string> write_manifest(const ArtifactManifest& manifest) const;

 private:
  std::string path_;
};

struct Artifact {
  ArtifactFolder folder;
  ArtifactManifest manifest;
  std::vector<evidence::RolloutRow> rows;
};

// Reads an artifact, finished or not. Refuses rows that do not fit the manifest or that were not written as they are
// (seal.hpp), a rollout that is there twice, one rollout under two seeds, another row schema than this program's, and a
// finished artifact with a file that is not the one sealed, whose rows, contracts or seed plan are no longer those it
// was named after, or that has other rows than it plans.
std::expected<Artifact, std::string> open_artifact(const std::string& path);
// The same, and refuses one that is not finished: for decisions by it.
std::expected<Artifact, std::string> open_finished_artifact(const std::string& path);

// "smoke-3f9a2c41d07b": panel, and the first digits of the SHA-256 over panel hash, timing, seed plan, the methods'
// freshness contracts, and all rows without host fields, in whatever order. The same rollouts give the same id on any
// machine, and merged from any shards.
std::string artifact_id_of(const ArtifactManifest& manifest, std::span<const evidence::RolloutRow> rows);

// What confusion.json holds (confusion.hpp), a function of the rows and the id.
std::string confusion_file_text(const std::string& artifact_id, std::span<const evidence::RolloutRow> rows);

struct DescriptorCloser {
  void operator()(const int* fd) const;
};
using Descriptor = std::unique_ptr<int, DescriptorCloser>;

// Writes an artifact row by row, alone: another writer is refused. A process killed at any instant leaves whole rows
// and at most one that is torn or has no seal, which resume() cuts off.
class ArtifactWriter {
 public:
  // The folder must not hold an artifact yet; parents are made. Schema hash, start time and host facts that `manifest`
  // leaves empty are filled in.
  static std::expected<ArtifactWriter, std::string> create(const std::string& path, ArtifactManifest manifest,
                                                           std::string_view panel_text);
  // Goes on with an unfinished artifact; refuses one that was begun with another panel, script, plant or method, and
  // one with rows that were not written as they are.
  static std::expected<ArtifactWriter, std::string> resume(const std::string& path, const ArtifactManifest& manifest);

  // Rows already there, and whether a rollout is among them: what a resumed panel need not run again.
  [[nodiscard]] const std::vector<evidence::RolloutRow>& rows() const { return artifact_.rows; }
  [[nodiscard]] bool has(const evidence::RolloutRow& row) const { return ids_.contains(evidence::rollout_id(row)); }
  [[nodiscard]] const ArtifactFolder& folder() const { return artifact_.folder; }

  // The row is on the medium when this returns.
  std::expected<void, std::string> append(const evidence::RolloutRow& row);
  // Success was decided after so many seeds of the plan (`manifest.until_decided`): they are the plan from now on, and
  // their rows the planned ones.
  void end_plan_after(std::uint64_t seeds);
  // All planned rollouts are there: writes rollouts.parquet and confusion.json, names the artifact and closes the
  // manifest.
  std::expected<ArtifactManifest, std::string> finish();

 private:
  ArtifactWriter(Artifact artifact, Descriptor rows, Descriptor seals, Descriptor lock, std::string last_seal);
  static std::expected<ArtifactWriter, std::string> open_writer(Artifact artifact, Descriptor lock,
                                                                std::string last_seal);
  Artifact artifact_;
  std::set<std::string> ids_;
  Descriptor rows_fd_, seals_fd_;  // of rollouts.jsonl and rollouts.sha256, at their ends
  Descriptor lock_;                // of .writer.lock, held
  std::string last_seal_;          // empty: no row yet
};

}  // namespace takt::lab

// SPDX-License-Identifier: Apache-2.0
// Who changed what on a robot PC, and to what: starts, requests of operators, deployments. Append-only, apart from
// runs, which are deleted sooner (docs/duties.md).
//
//   FOLDER/2026.jsonl         a line for each intervention of that year (UTC), in the order in which they came
//   FOLDER/robots/SHA256.yaml each resolved robot file that was started, by its hash
//
// `before` of a line is the SHA-256 of the line before it, line end included, over the end of a year too: a line that
// was altered, taken out or put in shows. Empty: nothing was before.
//
// The log is kept where FOLDER is there; nothing waits for it but its writer, for the disk and at most kLockPatience
// for another writer. When a year begins, all but the newest kYearsKept files before it go. A request that is made
// again and again with the same answer is one line, and `repeated` of the next line says how often more. Lines are
// bounded: kMostAtOnce, then one in kLinePeriod; `left_out` of the next line counts the others.
//
// Errors: failure(). Thread rule: one thread; several processes may append to one log.
#pragma once

#include <cstdint>
#include <expected>
#include <nlohmann/json.hpp>
#include <optional>
#include <string>
#include <string_view>

#include "executive/contract/mono_time.hpp"
#include "executive/contract/operator_word.hpp"
#include "monitor/record/run_manifest.hpp"
#include "monitor/record/token_bucket.hpp"

namespace takt::monitor {

inline constexpr std::size_t kYearsKept = 5;  // beside the one that is written
// "/var/lib/takt/interventions" of "/var/lib/takt/runs": beside the folder of the runs.
std::string intervention_folder(const std::string& record_directory);

struct Deployment {
  std::string what;                          // "deploy", "rollback"
  std::string before, after;                 // in use: their names; empty: nothing
  std::string robot, config_sha256, policy;  // of `after`; policy: SHA-256 of its file, empty: it has none
  std::string how;                           // "on probation", "proven: tracked for 30 s"
};

class InterventionLog {
 public:
  static constexpr std::uint32_t kMostAtOnce = 100;
  static constexpr Duration kLinePeriod = seconds(60);
  static constexpr Duration kLockPatience = milliseconds(100);

  // Without a folder there, every note is left out.
  explicit InterventionLog(std::string folder) : folder_(std::move(folder)) {}
  [[nodiscard]] bool is_kept() const;

  // An executive runs from now on: which programs, robot file and policies; `changed`: keys of the robot file that
  // differ from the newest start of a robot of this name.
  void note_start(const RunManifest& manifest, const config::RobotConfig& robot, std::int64_t unix_ns);
  // A mark is none: it changes nothing.
  void note(const OperatorWord& word, const std::string& robot, std::int64_t unix_ns);
  // By this process.
  void note(const Deployment& deployment, std::int64_t unix_ns);

  // Why the newest note is not in the log; empty: it is, or none is kept.
  [[nodiscard]] const std::string& failure() const { return failure_; }

 private:
  bool append(nlohmann::ordered_json line, std::int64_t unix_ns);  // false: it is not in the log
  std::string folder_;
  std::string failure_;
  std::optional<OperatorWord> newest_request_;  // none: another line came behind it
  std::uint64_t repeated_ = 0;
  TokenBucket budget_{kLinePeriod, kMostAtOnce};
  std::uint64_t left_out_ = 0;
};

struct ChangedKey {
  std::string key;            // "joints.elbow.position.max": items of a list by their name, else by their number
  std::string before, after;  // as the files have them; empty: not there
  friend bool operator==(const ChangedKey&, const ChangedKey&) = default;
};
// Of two resolved robot files, by key. Empty where one of them is none.
std::vector<ChangedKey> changed_keys(std::string_view before, std::string_view after);

}  // namespace takt::monitor

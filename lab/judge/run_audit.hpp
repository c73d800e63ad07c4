// SPDX-License-Identifier: Apache-2.0
// What a run folder shows by itself, and to whom has the signer's key: its files are those that were recorded, and the
// recorded decisions are those that come out of the recorded inputs again. Thread rule: any thread.
#pragma once

#include <expected>
#include <nlohmann/json.hpp>
#include <string>

#include "evidence/review/replay.hpp"
#include "lab/judge/vouching.hpp"
#include "monitor/record/recorded_run.hpp"
#include "monitor/record/run_seal.hpp"

namespace takt::lab {

inline constexpr const char* kRunAuditSchema = "takt.run_audit/1";

struct RunAudit {
  std::string run_id;
  std::expected<monitor::CheckedSeal, std::string> seal;
  std::expected<evidence::ReplayReport, std::string> replay;
  Vouching vouching;
  // Sealed to its end, no file altered, every judged tick reproduces, with every output of it. A forger who edits every
  // file gets here.
  [[nodiscard]] bool is_consistent() const;
  // And the named key signed it.
  [[nodiscard]] bool is_ready() const;
};

RunAudit audit_run(const monitor::RecordedRun& run);
// Ends with what the verdict rests on.
std::string audit_text(const RunAudit& audit);
nlohmann::ordered_json to_json(const RunAudit& audit);

}  // namespace takt::lab

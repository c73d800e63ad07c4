// Is an artifact's claim ready to be audited? Names the metric contract, the perturbation panel, the monitor state, the
// artifact id, the fault verdicts and the three claims, and lists what is missing; a failed rollout without a completed
// post-mortem is.
#pragma once

#include <expected>
#include <nlohmann/json.hpp>
#include <string>
#include <vector>

#include "evidence/artifact/artifact.hpp"

namespace takt::panel {

inline constexpr const char* kAuditSchema = "takt.audit/1";

struct AuditItem {
  std::string name;                  // "metric contract"
  std::string answer;                // what the artifact says; empty: nothing
  std::vector<std::string> missing;  // sentences; empty: the item is ready
};

struct Audit {
  std::string artifact_id;  // empty: unfinished
  std::vector<AuditItem> items;
  [[nodiscard]] bool is_ready() const;
};

Audit audit(const Artifact& artifact);
std::string audit_text(const Audit& audit);
nlohmann::ordered_json to_json(const Audit& audit);

}  // namespace takt::panel

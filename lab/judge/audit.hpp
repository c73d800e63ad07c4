// SPDX-License-Identifier: Apache-2.0
// Is an artifact's claim ready to be audited? What the panel is meant to show, and under which conditions, the panel
// file says, whose hash the rows carry; the manifest is held against it. Names the metric contract, the perturbation
// panel, the monitor state, the artifact id, the fault verdicts and the three claims, and lists what is missing; a
// failed rollout without a completed post-mortem is. Consistent is what the artifact can show by itself; audit-ready is
// one of which rows were computed anew, or that is signed or registered by a key that the reader names.
#pragma once

#include <compare>
#include <expected>
#include <map>
#include <nlohmann/json.hpp>
#include <optional>
#include <string>
#include <utility>
#include <vector>

#include "evidence/attestation/attestation.hpp"
#include "lab/artifact/artifact.hpp"
#include "lab/judge/vouching.hpp"

namespace takt::lab {

inline constexpr const char* kAuditSchema = "takt.audit/1";

struct AuditItem {
  std::string name;                  // "metric contract"
  std::string answer;                // what the artifact says; empty: nothing
  std::vector<std::string> missing;  // sentences; empty: the item is ready
};

// Rows that were computed anew, of those drawn; the first that came out otherwise, in a sentence, or none.
struct Recomputed {
  std::size_t rows = 0, of = 0;
  std::vector<std::string> differences;
};

// What was registered before the panel ran (lab/panel/registration.hpp), by the key that the reader named.
struct Registered {
  std::string key;                       // its id
  std::int64_t unix_ns = 0;              // when: by an authority that the reader named, or by the signer's clock
  std::string stamped_by;                // that authority; empty: the signer's clock
  std::int64_t first_row_unix_ns = 0;    // no row is older
  std::string comparison;                // that was to decide; empty: none
  std::vector<std::string> differences;  // sentences: what ran otherwise
  [[nodiscard]] bool is_older() const { return unix_ns <= first_row_unix_ns; }
  [[nodiscard]] bool holds() const { return is_older() && differences.empty(); }
};

struct Audit {
  std::string artifact_id;  // empty: unfinished
  std::vector<AuditItem> items;
  std::optional<Recomputed> recomputed;  // none: nothing was computed anew
  Vouching vouching;
  // Else why not. None: no key was named.
  std::optional<std::expected<Registered, std::string>> registered;
  // Nothing is missing and nothing contradicts itself. A forger who recomputes every hash gets here.
  [[nodiscard]] bool is_consistent() const;
  // And rows drawn at random came out the same, or the named key signed or registered it.
  [[nodiscard]] bool is_ready() const;
};

// What a panel file says of its artifacts.
struct PanelPromise {
  struct Condition {
    std::string task, perturbation;
    double dose = 0;
    friend auto operator<=>(const Condition&, const Condition&) = default;
  };
  // Of the freshness contract; empty: what the robot file says, which is not in the artifact.
  struct Contract {
    std::optional<double> max_age_ms, epsilon, confidence;
  };
  // Of a rollout of the task. `bound_m`: a success has no more error; empty: its world says what one is.
  struct Outcome {
    std::optional<double> bound_m;
    double duration_s = 0;
  };
  // What a method says otherwise than the robot file: key -> value, as it is written.
  using Configuration = std::map<std::string, std::string>;
  Claims claims;
  std::map<std::string, Configuration> methods;
  std::vector<Condition> conditions;                                  // each over every seed
  std::map<std::string, Outcome> outcomes;                            // by task
  std::map<std::pair<std::string, std::string>, Contract> contracts;  // by method and task
};

// `promise`: of the artifact's panel.yaml, or why it has none (lab/panel/panel_promise.hpp).
Audit audit(const Artifact& artifact, const std::expected<PanelPromise, std::string>& promise);
// Ends with what the verdict rests on.
std::string audit_text(const Audit& audit);
nlohmann::ordered_json to_json(const Audit& audit);
// Of an attestation, which is consistent where it can be read.
std::string audit_text(const evidence::Attestation& attestation, const std::optional<Recomputed>& recomputed);

}  // namespace takt::lab

// SPDX-License-Identifier: Apache-2.0
// What a panel showed of one way in which a robot that can fall is to stay on its feet: a stop by holding, or
// by the fallback policy, or what degraded mode falls back to. A small file that a robot file names in `shown_by`.
//
// It is made of an artifact's rows (lab/judge/attest.hpp), and says of which robot, panel, method, perturbations and
// seeds; of every trial how it ended, the hash over all of its ticks and the seal of its row, so that its rollouts can
// be computed again from it and the robot file alone, and compared. It is believed (standing_of) only where it is
// intact, written by this release of Takt, of this robot as its file says it today, and where in every condition the
// one-sided Clopper-Pearson bound of the share that stood is at least kLeastShown. Bounds are counted anew from the
// trials, never read. Where other sources of the same release computed it, its line says so.
//
// Errors are one sentence. Pure but for standing_of(), which reads files.
#pragma once

#include <cstdint>
#include <expected>
#include <string>
#include <string_view>
#include <vector>

#include "config/robot_config.hpp"

namespace takt::evidence {

inline constexpr std::string_view kStops = "stops.";  // what is attested begins with it, unless it is a fallback
inline constexpr const char* kAttestationSchema = "takt.attestation/1";
inline constexpr double kLeastShown = 0.9;  // lower bound of the share that stood
inline constexpr double kShownConfidence = 0.95;
inline constexpr double kLeastStopped_s = 5, kLeastDegraded_s = 1;

// When the panel's task said that a robot had fallen. A task that says so later than these does not show much.
struct FallRule {
  double least_height = 0;  // share of the base's height at the start
  double most_tilt = 0;     // rad, of the base from upright
  friend bool operator==(const FallRule&, const FallRule&) = default;
};
inline constexpr FallRule kLaxest{.least_height = 0.5, .most_tilt = 1.2};

struct AttestedTrial {
  std::uint64_t seed = 0;
  std::string replay_hash;  // as in its row
  // Of the row's text without `host`, and with moving_parts_sha256() for config_sha256: a robot file names in shown_by
  // what was made of it.
  std::string row_sha256;
  double seconds = 0;  // in the stop, or degraded
  bool stood = false;
};

struct AttestedCondition {
  std::string perturbation;
  double dose = 0;
  std::vector<AttestedTrial> trials;  // by seed; never empty
  [[nodiscard]] std::uint64_t stood() const;
  [[nodiscard]] double lower_bound() const;
};

struct Attestation {
  std::string of;            // as the robot file has it: "stops.operator_stop", "fallbacks.crouch"
  std::string robot;         // name
  std::string parts_sha256;  // moving_parts_sha256()
  std::string artifact_id, panel, panel_text, task, method;  // panel_text: the panel file
  std::string timing;                                        // kTimingNames
  std::string script_version, script_source_sha256;
  FallRule fall;
  std::vector<AttestedCondition> conditions;  // never empty
};

// Over what decides how a robot moves: its file with every default written out, without what only records or tells,
// without `shown_by`; its policies and its MuJoCo model by their contents, wherever they lie.
std::expected<std::string, std::string> moving_parts_sha256(const config::RobotConfig& robot);

// The file's text; its last key is the hash over the others.
std::string attestation_text(const Attestation& attestation);
std::expected<Attestation, std::string> attestation_of(std::string_view text);

// "30 of 30 stood under operator_stop, 30 of 30 under bad_actions_nan 1: at least 0.90 at 95 % confidence".
std::string what_it_shows(const Attestation& attestation);
// Why it is no evidence for that robot's `of`; empty: it is.
std::string shortcoming(const Attestation& attestation, const config::RobotConfig& robot, const std::string& of);

// Of all that a robot that can fall is to stay on its feet by, one line each: what is shown, and what is not, with why.
struct Standing {
  std::vector<std::string> shown, not_shown;
};
Standing standing_of(const config::RobotConfig& robot);

}  // namespace takt::evidence

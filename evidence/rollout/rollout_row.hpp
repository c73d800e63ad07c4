// SPDX-License-Identifier: Apache-2.0
// One rollout of a panel, as one row: what ran, how it ended, and every number that a comparison may use. Success,
// failure, latency, safety and robustness stand together because one script computed them from the same recorded ticks.
//
// A plain value. What each field is called in a file, its unit, its range and its meaning are declared once, in
// rollout_fields.cpp; the JSON Lines, the JSON Schema and the Parquet columns all come from there.
//
// Everything outside `host` is a function of panel, method, seed and program: the same rollout gives the same bytes on
// any machine. `host` holds what this machine measured while computing it and is left out of every comparison.
#pragma once

#include <array>
#include <compare>
#include <cstdint>
#include <optional>
#include <string>

#include "config/chunk_score.hpp"
#include "executive/contract/intervention.hpp"
#include "executive/contract/mode.hpp"
#include "monitor/judge/fault_classifier.hpp"

namespace takt::evidence {

inline constexpr const char* kRolloutSchema = "takt.rollout/1";

// Exclusive quantiles (monitor/judge/freshness_statistics.hpp), ms; all empty when there was no sample, which is not
// age 0.
struct AgeQuantiles {
  std::optional<double> p50_ms, p95_ms, p99_ms;
  friend bool operator==(const AgeQuantiles&, const AgeQuantiles&) = default;
};

// total = sense + queue + infer + publish + hold in every sample, though not in the quantiles.
struct AgeRow {
  AgeQuantiles total, sense, queue, infer, publish, hold;
  friend bool operator==(const AgeRow&, const AgeRow&) = default;
};

// As MissRate: without samples the rate is 0 and its bound 1.
struct MissRow {
  std::uint64_t misses = 0;
  std::uint64_t count = 0;     // commands, or ticks that relied on the policy
  double rate = 0;             // 0..1
  double effective_count = 0;  // independent ones that say as much, at most count
  double upper_bound = 1.0;    // one-sided Clopper-Pearson of those, at the robot's freshness confidence
  friend bool operator==(const MissRow&, const MissRow&) = default;
};

struct SafetyEvents {
  std::uint64_t entered_degraded = 0;       // transitions into the mode
  std::uint64_t entered_damped_stop = 0;    //
  std::uint64_t entered_fault_latched = 0;  //
  std::uint64_t envelope_violations = 0;    // ticks with a measured value outside the hard envelope
  friend bool operator==(const SafetyEvents&, const SafetyEvents&) = default;
};

struct HostMeasured {
  double wall_s = 0;
  double cpu_s = 0;
  std::uint64_t peak_rss_kib = 0;
  double realtime_factor = 0;  // simulated time / wall time
};

struct RolloutRow {
  std::string schema = kRolloutSchema;

  // What ran. panel, task, method, perturbation: a-z 0-9 _ - . only, never empty ("none" is the nominal perturbation).
  std::string panel;
  std::string panel_sha256;  // of the panel file's bytes
  std::string task;
  std::string method;
  std::uint64_t seed = 0;  // below 2^53, so that every reader keeps it exact
  std::string perturbation;
  double dose = 0;  // in the perturbation's own unit; 0 for the nominal one
  std::string config_sha256;
  std::string policy_sha256;         // empty: the method has no policy file
  std::string plant_sha256;          // of the plant's text
  std::string script_version;        // of takt
  std::string script_source_sha256;  // of the sources it was built from; empty: not known

  // How it ended.
  bool success = false;
  std::string failure_label;        // a-z 0-9 _; empty exactly on success
  bool fell = false;                // or lost what it balances, at any time, whatever the label says first
  Mode final_mode = Mode::standby;  // monitor state at the end
  Cause final_cause = Cause::none;  // of the last transition
  std::optional<double>
      recovery_s;             // end of perturbation -> back in tracking; empty: nothing to recover from, or never
  std::string leading_fault;  // the classifier's costliest verdict; empty: it had no reason for one
  std::uint64_t fault_verdicts = 0;  // of stretches of trouble, one for each cause
  std::array<std::optional<double>, monitor::kFaultCount> fault_shares{};  // of troubled ticks; empty: an earlier row
  std::array<double, config::kChunkScoreCount>
      chunk_levels{};                           // monitor/judge/chunk_monitors.hpp; 0: no answer was watched
  std::uint64_t catch_votes = 0, catch_of = 0;  // answers: the rule behind levels and catches
  std::uint64_t catches = 0;                    // of the chunk monitors
  std::uint64_t rearms = 0;                     // times the operator armed the robot again
  double tracking_error_rms_m = 0;              // of the task's controlled point, over the scored ticks
  double tracking_error_p95_m = 0;              //
  std::uint64_t constraint_violations = 0;      // ticks outside the task's own constraints

  // Latency.
  std::uint64_t ticks = 0;                  // of the rollout
  std::optional<double> inference_mean_ms;  // of accepted commands; empty: there was none
  AgeRow age_per_command;                   // at first use: hold is zero
  AgeRow age_per_tick;                      // at every tick that relied on the policy
  MissRow misses_per_command;
  MissRow misses_per_tick;

  // Safety and resources.
  SafetyEvents safety;
  std::array<std::uint64_t, kInterventionCount> interventions{};  // joint-ticks by kind
  std::array<double, kModeCount> mode_share{};                    // share of ticks, 0..1
  double energy_J = 0;                                            // integral of |torque * velocity|
  // Of the rest a slide's are its motor's.
  double peak_torque_Nm = 0;
  double torque_rate_Nm_s = 0;         // mean |change of torque| per time, of all joints together
  double peak_reference_jerk = 0;      // rad/s^3, of any joint's reference while the policy was played
  double peak_join_velocity_step = 0;  // rad/s, of any joint's reference in a tick in which a new command took over

  // Evidence.
  std::string replay_hash;  // over all tick records; lower-case hex
  std::string run_folder;   // relative to the artifact's folder; empty: none was kept

  HostMeasured host;
};

// What makes two rows of different methods comparable one to one.
struct PairKey {
  std::string task, perturbation;
  double dose = 0;
  std::uint64_t seed = 0;
  friend auto operator<=>(const PairKey&, const PairKey&) = default;
};
PairKey pair_key(const RolloutRow& row);

// "reach.slow_infer@0.5.fast.s7": names the row's post-mortem; unique within an artifact and safe as a file name.
std::string rollout_id(const RolloutRow& row);

}  // namespace takt::evidence

// SPDX-License-Identifier: Apache-2.0
// How much command age, and how large a share of misses, the task tolerates: rollouts in virtual time, from which a
// freshness contract is proposed. Steps 1 and 2 of multirate control integration: the stabiliser's margin is known, now
// the policy's age budget is chosen.
//
//   age      every command is published later by the same dose, and no gate refuses it. Tolerated: the one-sided
//            Clopper-Pearson lower bound of the success rate is at least `success`. The age that the task then lived
//            with is the median over ticks.
//   misses   the proposed max_age gates; once per second an inference stalls for a dose, so that the gate refuses and
//            the robot brakes. Tolerated as above; the share of ticks that missed is measured.
//   silence  the policy stands still once, for a dose; the proposed max_age gates, and nothing stops the robot.
//   recovery the proposed contract as it is to be, with every pair of recover_after and flap_memory of a short list:
//            stalls beyond max_age, and a delay that brings the age to max_age.
//   rule     max_age = safety * tolerated age, rounded down to 5 ms; epsilon = safety * tolerated share, rounded down
//            to two digits; stop_after = safety * tolerated silence, rounded down to 5 ms, where it exceeds max_age.
//            recover_after and flap_memory: of those that succeed most often, which have the fewest ticks in violation
//            (a tenth and one tick more count as equal), those that enter degraded mode least often.
// Larger doses are presumed to be no easier. Same setup, same result, whatever the number of workers.
#pragma once

#include <cstddef>
#include <cstdint>
#include <expected>
#include <functional>
#include <optional>
#include <string>
#include <vector>

#include "evidence/rollout/outside_processes.hpp"
#include "evidence/rollout/rollout.hpp"
#include "executive/contract/mono_time.hpp"

namespace takt::study {

inline constexpr double kConfidence = 0.95;
inline constexpr std::uint64_t kLeastSeeds = 59;  // fewer cannot show a success rate of 0.95, even without a failure

struct ToleranceProgress {
  std::size_t rollouts = 0, at_most = 0;  // done, of the most that the search can need
  std::string dose;                       // looked at now
};

struct ToleranceSetup {
  std::string robot_file;
  evidence::Task task = evidence::Task::arm_tracking;
  evidence::BaseVelocityTask base_velocity = {};  // of that task only
  std::uint64_t seeds = 60;                       // enough to show `success`
  double success = 0.95;                          // (0, 1): rate that has to be shown
  std::size_t workers = 1;
  double safety = 0.8;  // (0, 1]
  double bound_m = 0.02;
  Duration duration = seconds(8), scored = seconds(2);
  std::function<void(const ToleranceProgress& progress)> on_progress = {};
  evidence::OutsideProcesses outside = {};
};

// One dose. With failures enough to be refused, the remaining seeds were left out.
struct TolerancePoint {
  double dose_ms = 0;
  std::uint64_t rollouts = 0, successes = 0;
  double success_lower = 0, success_upper = 1;  // one-sided bounds of the success rate, each of kConfidence
  double age_p50_ms = 0, age_p99_ms = 0;        // per tick; medians over the rollouts
  double miss_share = 0;                        // of ticks, mean over the rollouts
  bool tolerated = false;
};

// One way to come back from degraded mode, under both troubles together.
struct RecoveryPoint {
  Duration recover_after, flap_memory;
  std::uint64_t rollouts = 0, successes = 0;
  double violated_ticks = 0, entries = 0;  // into degraded mode; means per rollout
};

struct AgeTolerance {
  std::vector<TolerancePoint> ages, misses, silences;  // by dose
  std::vector<RecoveryPoint> recoveries;               // empty: nothing was gated
  std::optional<RecoveryPoint> recovery;               // proposed
  double tolerated_age_ms = 0;                         // median age at the largest tolerated delay
  double nominal_p99_ms = 0;                           // age without any added delay
  double max_age_ms = 0;                               // proposed
  std::optional<double> tolerated_share;               // of misses; absent: none was tolerated, or none came about
  std::optional<double> epsilon;                       // proposed
  std::optional<double> tolerated_silence_ms;          // absent: not even the shortest
  std::optional<double> stop_after_ms;                 // proposed; absent: it would not exceed max_age
  // The largest dose tried was tolerated.
  bool age_is_open = false, share_is_open = false, silence_is_open = false;
};

// The error: what the robot file lacks, one problem per line, or that the task fails without any delay.
std::expected<AgeTolerance, std::string> age_tolerance(const ToleranceSetup& setup);

}  // namespace takt::study

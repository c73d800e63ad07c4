// SPDX-License-Identifier: Apache-2.0
// Which protection costs what on this robot: the same rollouts as the robot file says, by a plain loop, and with one
// protection after the other switched off (evidence/rollout/method.hpp). Without a fault, and with a policy that stands
// still once; a protection whose absence makes the first better is one that this robot pays for. The same setup gives
// the same table, whatever the number of workers.
#pragma once

#include <cstdint>
#include <expected>
#include <functional>
#include <nlohmann/json_fwd.hpp>
#include <string>
#include <vector>

#include "evidence/rollout/rollout.hpp"
#include "executive/contract/mono_time.hpp"

namespace takt::study {

struct AblationSetup {
  std::string robot_file;
  evidence::Task task = evidence::Task::arm_tracking;
  evidence::BaseVelocityTask base_velocity = {};  // of that task only
  std::uint64_t seeds = 20;
  std::size_t workers = 1;
  double bound_m = 0.02;
  Duration duration = seconds(12), scored = seconds(2);
  Duration frozen_at = seconds(5), frozen_for = milliseconds(300);
  std::function<void(std::size_t done, std::size_t of)> on_progress = {};
};

// Means over the rollouts of one method under one condition.
struct AblationRow {
  std::string name, meaning;  // meaning: what the protection does that is off; of takt and plain, what they are
  std::uint64_t rollouts = 0, successes = 0, fell = 0;
  std::uint64_t only_this = 0, only_takt = 0;  // of the pairs with takt: which alone succeeded
  double tracking_error_m = 0;                 // rms over the scored part
  double torque_rate_Nm_s = 0, energy_J = 0;
  double marks = 0;  // interventions per joint and tick
};

struct Ablation {
  std::vector<AblationRow> nominal{}, frozen{};  // takt first, then plain, then without each protection
  Duration frozen_for;
};

// The error: what the robot file lacks, one problem per line.
std::expected<Ablation, std::string> ablate(const AblationSetup& setup);

std::string ablation_text(const Ablation& ablation);
nlohmann::ordered_json to_json(const Ablation& ablation);

}  // namespace takt::study

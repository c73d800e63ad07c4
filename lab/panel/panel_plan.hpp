// SPDX-License-Identifier: Apache-2.0
// What a panel amounts to: every rollout in one order, and everything a rollout needs loaded and checked once. Nothing
// runs before every robot, override and policy of the panel is known to be good.
#pragma once

#include <cstdint>
#include <expected>
#include <memory>
#include <string>
#include <vector>

#include "config/robot_config.hpp"
#include "evidence/rollout/outside_processes.hpp"
#include "evidence/rollout/policy_process.hpp"
#include "evidence/rollout/rollout_row.hpp"
#include "evidence/rollout/virtual_policy.hpp"
#include "lab/artifact/artifact_manifest.hpp"
#include "lab/judge/post_mortem.hpp"
#include "lab/panel/panel_file.hpp"
#include "monitor/judge/chunk_monitors.hpp"
#include "monitor/judge/fault_classifier.hpp"
#include "monitor/judge/run_metrics.hpp"
#include "policy_host/policy.hpp"

namespace takt::lab {

// Indices into the panel's lists.
struct PlannedRollout {
  std::size_t task = 0, perturbation = 0, method = 0;
  std::uint64_t seed = 0;
};

// Part `index` (from 1) of `count`: every count-th rollout of the plan, so that parts take equally long.
struct Shard {
  std::size_t index = 1, count = 1;
};
// Task by task, perturbation by perturbation, method by method, seed by seed.
std::vector<PlannedRollout> plan_of(const Panel& panel, const Shard& shard);

// One method on one task.
struct Contestant {
  config::RobotConfig robot;
  std::unique_ptr<policy_host::Policy> policy;       // null: a program
  std::unique_ptr<evidence::PolicyProcess> program;  // null: a network
  std::unique_ptr<evidence::FallbackHost> fallback;  // null: the robot has none
  std::uint64_t policy_hash = 0;
  std::string policy_sha256, plant_sha256;
};

struct RanRollout {
  evidence::RolloutRow row;  // whole, host fields too
  std::string post_mortem;   // draft (post_mortem.hpp); empty on success
};

// What a rollout's ticks say besides its measures: faults by name, and the scene of a failure.
class RolloutWatch {
 public:
  explicit RolloutWatch(const config::RobotConfig& robot);
  void command(const CommandChunk& chunk) {
    classifier_.command(chunk);
    monitors_.command(chunk);
  }
  void command(const monitor::RecordedCommand& command) {
    classifier_.command(command);
    monitors_.command(command);
  }
  void shown(const evidence::ShownSample& shown);
  void input(const monitor::RecordedPolicyInput& input) { classifier_.input(input); }
  void image(const monitor::ShownImage& image) { classifier_.image(image); }
  void tick(const TickRecord& record) {
    failure_.tick(record.header);
    classifier_.tick(record);
    monitors_.tick(record.header);
    if (auto incident = incidents_.tick(record); incident && told_.size() < monitor::kListedIncidents)
      told_.push_back(std::move(*incident));
  }

 private:
  friend class Contest;
  FailureWatch failure_;
  monitor::FaultClassifier classifier_;
  monitor::ChunkMonitors monitors_;
  incident::IncidentWatch incidents_;
  std::vector<incident::Incident> told_;
};

class Contest {
 public:
  // `outside`: for every method. World and policy are asked whether they play with these robots. The error: one problem
  // per line, each naming panel, method and key.
  static std::expected<Contest, std::string> prepare(Panel panel, const evidence::OutsideProcesses& outside = {});

  [[nodiscard]] const Panel& panel() const { return panel_; }
  // Of an artifact that holds `planned` rollouts of the panel.
  [[nodiscard]] ArtifactManifest manifest(std::size_t planned) const;
  // The error is one sentence.
  std::expected<RanRollout, std::string> run(const PlannedRollout& planned);
  // Of what run() started: a process leaves nothing behind.
  void clean_up();
  // As run() fills it, before anything has run: names the rollout.
  [[nodiscard]] evidence::RolloutRow identity(const PlannedRollout& planned) const;
  [[nodiscard]] const Contestant& contestant(const PlannedRollout& planned) const {
    return contestants_[planned.task * panel_.methods.size() + planned.method];
  }
  // A row that is whole but for its verdicts, and what was watched besides: verdicts and the draft are added.
  // `end`: of the world that played it, a sentence, or empty.
  [[nodiscard]] RanRollout conclude(evidence::RolloutRow row, RolloutWatch& watch, const std::string& end = {}) const;

 private:
  explicit Contest(Panel panel) : panel_(std::move(panel)) {}
  [[nodiscard]] evidence::RolloutSetup setup_of(const PlannedRollout& planned) const;
  Panel panel_;
  evidence::OutsideProcesses outside_;
  std::unique_ptr<simulation::WorldProcess> world_;  // null: none
  std::vector<Contestant> contestants_;              // task by task
};

}  // namespace takt::lab

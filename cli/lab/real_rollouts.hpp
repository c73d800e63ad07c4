// SPDX-License-Identifier: Apache-2.0
// The rollouts of a panel with real processes, one robot at a time: each is one `takt run`, whose run folder the row is
// computed from and names. OUT/runs/ID/ holds everything of one rollout:
//
//   robot.yaml       the robot file as the method wants it (and a link to its policy)
//   plant.yaml       what goes wrong in the simulator, where something does
//   command.txt      the command line, and what it printed: run.log
//   truth.jsonl      what the simulated robot really did
//   run/             the run folder
//
// Errors are one sentence. Thread rule: one thread.
#pragma once

#include <expected>
#include <string>

#include "lab/panel/panel_plan.hpp"

namespace takt::cli {

class RealRollouts {
 public:
  // Refuses a panel that cannot be run so, naming every perturbation and method without a mechanism. `contest` outlives
  // this. Of `outside` the policy: as `takt run` has it; empty: takt-policy-host.
  static std::expected<RealRollouts, std::string> make(const lab::Contest& contest, std::string out,
                                                       evidence::OutsideProcesses outside, bool allow_non_realtime);
  // What an interrupted attempt left behind is removed first.
  [[nodiscard]] std::expected<lab::RanRollout, std::string> run(const lab::PlannedRollout& planned) const;

 private:
  RealRollouts(const lab::Contest& contest, std::string out, evidence::OutsideProcesses outside,
               bool allow_non_realtime)
      : contest_(contest),
        out_(std::move(out)),
        outside_(std::move(outside)),
        allow_non_realtime_(allow_non_realtime) {}
  [[nodiscard]] std::expected<void, std::string> live_through(const lab::PlannedRollout& planned,
                                                              const std::string& folder) const;
  const lab::Contest& contest_;
  std::string out_;
  evidence::OutsideProcesses outside_;
  bool allow_non_realtime_;
};

}  // namespace takt::cli

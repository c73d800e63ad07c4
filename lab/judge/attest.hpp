// SPDX-License-Identifier: Apache-2.0
// An attestation (evidence/attestation/attestation.hpp), made of what a panel showed. Pure; errors are one sentence.
//
// A trial is a rollout that came to the stop in question (was degraded for a second at least, of a fallback), or that
// fell or latched without. It stood where the robot did not fall, and was in the stop for five seconds at least, or by
// its fallback without a latched fault. Conditions in which no rollout came to it are left out.
#pragma once

#include <expected>
#include <string>
#include <string_view>

#include "evidence/attestation/attestation.hpp"
#include "evidence/rollout/rollout_row.hpp"
#include "lab/artifact/artifact.hpp"

namespace takt::lab {

// How one rollout bears on what is attested.
struct Bearing {
  double seconds = 0;  // in the stop, or degraded
  bool came_to_it = false, is_trial = false, stood = false;
};
Bearing bearing_of(const evidence::RolloutRow& row, std::string_view of, const config::RobotConfig& robot);

// The seal of a trial's row, as attestations carry it. `parts`: moving_parts_sha256() of its robot.
std::string row_sha256(const evidence::RolloutRow& row, const std::string& parts);

// What `artifact` shows of `of`. `panel_text`: its panel.yaml. `robot`: as the method ran it; its rows must be that
// robot's.
std::expected<evidence::Attestation, std::string> attest(const Artifact& artifact, const std::string& panel_text,
                                                         const config::RobotConfig& robot, const std::string& of,
                                                         const std::string& method, const evidence::FallRule& fall);

}  // namespace takt::lab

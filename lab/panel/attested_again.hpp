// SPDX-License-Identifier: Apache-2.0
// An attestation's trials, computed anew from the panel that it holds: who invents trials, or leaves out those that
// fell, is found by rollouts that the caller draws. Drawn are rollouts of the whole panel, not trials, so that one that
// is left out is as likely to be found.
//
// Errors are one sentence. Thread rule: call from a process of one thread.
#pragma once

#include <cstddef>
#include <expected>
#include <string>
#include <vector>

#include "evidence/attestation/attestation.hpp"
#include "lab/judge/audit.hpp"
#include "lab/panel/panel_plan.hpp"

namespace takt::lab {

// Its panel, with its method, its task and every seed that it names. The robot is still to be named.
std::expected<Panel, std::string> attested_panel(const evidence::Attestation& attestation);

// Outcomes are compared; hashes over all ticks only where this program is of the same sources. Refused where the
// contest's robot is not the attested one.
std::expected<Recomputed, std::string> recompute(const evidence::Attestation& attestation, Contest& contest,
                                                 const std::vector<PlannedRollout>& drawn, std::size_t workers);

}  // namespace takt::lab

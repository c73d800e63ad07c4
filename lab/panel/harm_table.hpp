// SPDX-License-Identifier: Apache-2.0
// Does Takt make anything worse? Per condition, the success of method takt against each built-in rival of the panel,
// paired by seed, and whether it keeps the margin. Pure.
#pragma once

#include <span>
#include <string>

#include "evidence/rollout/rollout_row.hpp"

namespace takt::lab {

inline constexpr double kHarmMargin = 0.02;  // of success: what takt may fall short of a rival by

// One line per task, perturbation and rival, then two per rival over all nominal cells and over all others. The verdict
// reads the 95 % interval of takt's success less the rival's: `holds` where all of it lies above minus the margin,
// `fails` where all of it lies below, else `open`; `better` where it lies above zero. Empty where the rows hold no
// method takt, or none of its rivals.
std::string harm_table(std::span<const evidence::RolloutRow> rows);

}  // namespace takt::lab

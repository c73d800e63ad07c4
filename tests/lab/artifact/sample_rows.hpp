// SPDX-License-Identifier: Apache-2.0
// Rows for tests: valid, with a value of its own in every field.
#pragma once

#include "evidence/rollout/rollout_row.hpp"

namespace takt::lab {

// Success, no perturbation. Differs by method and seed as rows of one artifact do.
evidence::RolloutRow sample_row(const std::string& method = "method-a", std::uint64_t seed = 1);
// The same, failed by a lost command.
evidence::RolloutRow failed_row(const std::string& method = "method-a", std::uint64_t seed = 1);

}  // namespace takt::lab

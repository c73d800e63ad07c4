// SPDX-License-Identifier: Apache-2.0
#include "evidence/rollout/rollout_row.hpp"

#include <fmt/format.h>

namespace takt::evidence {

PairKey pair_key(const RolloutRow& row) {
  return {row.task, row.perturbation, row.dose, row.seed};
}

std::string rollout_id(const RolloutRow& row) {
  return fmt::format("{}.{}@{}.{}.s{}", row.task, row.perturbation, row.dose, row.method, row.seed);
}

}  // namespace takt::evidence

// SPDX-License-Identifier: Apache-2.0
#include "policy_host/bad_actions.hpp"

#include <algorithm>
#include <limits>

namespace takt::policy_host {
namespace {

constexpr float kFarOff = 10.0F;  // rad

void shift_joints(CommandChunk& chunk, std::size_t places) {
  const std::size_t joints = chunk.header.joint_count;
  for (std::size_t step = 0; step < chunk.header.step_count; ++step) {
    float* const first = &chunk.values[value_index(chunk.header, CommandField::q, step, 0)];
    std::rotate(first, first + (joints - places % joints), first + joints);
  }
}

}  // namespace

void spoil(CommandChunk& chunk, const BadActions& bad, const Luck& luck) {
  const std::size_t value = value_index(chunk.header, CommandField::q, luck.step, luck.joint);
  if (luck.share < bad.nan_share) chunk.values[value] = std::numeric_limits<float>::quiet_NaN();
  if (luck.share < bad.range_share) chunk.values[value] += kFarOff;
  if (bad.joint_shift > 0) shift_joints(chunk, bad.joint_shift);
}

}  // namespace takt::policy_host

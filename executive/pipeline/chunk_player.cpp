// SPDX-License-Identifier: Apache-2.0
#include "executive/pipeline/chunk_player.hpp"

#include <algorithm>

namespace takt::pipeline {

std::uint8_t play(const JoinState& join, const Timed& path, MonoTime now, const TickConfig& config,
                  std::span<JointTarget> targets) {
  const Place place = place_of(path.chunk.header, now - path.begins, config.interpolation);
  const bool remains = join.joined_at.is_set();
  for (std::size_t j = 0; j < config.joint_count; ++j) {
    const JointConfig& joint = config.joints[j];
    PathReader reader(path.chunk, place, j, joint.limits);
    PathPoint point = reader.position(config.interpolation);
    if (remains) point = point + remainder_after(join.remainder[j], now - join.joined_at, config.join);
    const bool holds_dq = config.interpolation == Interpolation::hold && reader.has(CommandField::dq);
    JointTarget& target = targets[j];
    target.q = point.q;
    target.dq = point.dq;
    target.kp = reader.blend(CommandField::kp, joint.kp);
    target.kd = reader.blend(CommandField::kd, joint.kd);
    target.tau_ff = reader.blend(CommandField::tau_ff, 0.0F);
    target.dq_held = holds_dq ? std::clamp(reader.here(CommandField::dq), -target.speed, target.speed) : 0.0F;
    target.out_of_range = reader.out_of_range();
  }
  return static_cast<std::uint8_t>(place.step);
}

}  // namespace takt::pipeline

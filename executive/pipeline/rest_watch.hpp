// SPDX-License-Identifier: Apache-2.0
// Whether a robot rests: judged by how far its joints get, not by their estimated speed, in which every step of a
// coarse encoder is a spike. Pure; part of the tick's state.
#pragma once

#include <cmath>
#include <cstddef>
#include <span>

#include "executive/contract/joints.hpp"
#include "executive/contract/mono_time.hpp"
#include "executive/contract/tick_record.hpp"

namespace takt::pipeline {

// A robot rests once every joint that is asked has been slow for this long: an instant at rest is a turning point.
inline constexpr Duration kRestDwell = milliseconds(100);

class RestWatch {
 public:
  // One tick. `asked`: the joints that count; the others' estimates may be anything. rest_velocity(j) in rad/s, of a
  // slide m/s: at a steady speed below it joint j rests. What turns round meanwhile is slower than twice as much when
  // it is said to rest.
  template <class RestVelocity>
  void follow(MonoTime now, std::span<const JointRecord> joints, JointMask asked, RestVelocity rest_velocity) {
    const bool still = still_since_.is_set() && are_near(joints, asked, rest_velocity);
    if (still && now - anchored_at_ < kStretch) return;
    if (!still) still_since_ = now;
    anchored_at_ = now;
    for (std::size_t j = 0; j < joints.size(); ++j) anchor_[j] = joints[j].q_estimate;
  }

  void forget() { still_since_ = {}; }

  [[nodiscard]] bool rests(MonoTime now) const { return still_since_.is_set() && now - still_since_ >= kRestDwell; }

 private:
  static constexpr Duration kStretch = nanoseconds(kRestDwell.ns / 2);

  // No joint that is asked went further since the anchors were set than it may at rest. Not a number is no rest.
  template <class RestVelocity>
  [[nodiscard]] bool are_near(std::span<const JointRecord> joints, JointMask asked, RestVelocity rest_velocity) const {
    for (std::size_t j = 0; j < joints.size(); ++j) {
      const float within = rest_velocity(j) * static_cast<float>(kStretch.seconds());
      if ((asked & bit_of_joint(j)) != 0 && !(std::abs(joints[j].q_estimate - anchor_[j]) <= within)) return false;
    }
    return true;
  }

  MonoTime still_since_;  // unset: a joint moves, or none was watched
  MonoTime anchored_at_;
  float anchor_[kMaxJoints] = {};  // rad, where each joint was at anchored_at_
};

}  // namespace takt::pipeline

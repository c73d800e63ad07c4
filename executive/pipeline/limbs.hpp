// SPDX-License-Identifier: Apache-2.0
// Which joints share a limb, and which of them hang on others: how far the loss of one drive reaches.
//
// The limb of a joint is the serial piece of the kinematic tree that it is part of, and everything beyond: from the
// nearest branching below the joint's own base up to it, and all that hangs on it. An arm of a two-armed robot is a
// limb of its own; a torso's limb is the torso and both arms, but an arm's limb leaves the torso out. In a robot
// without a tree (no gravity model) nothing says what carries what: it is one limb, in which no joint is known to hang
// on another; with a free base (an IMU) each is taken to hang on every other, as stiff joints do not keep it on its
// feet. Made once from the configuration. Pure.
#pragma once

#include <array>
#include <cstdint>

#include "executive/contract/joints.hpp"
#include "executive/pipeline/tick_config.hpp"

namespace takt::pipeline {

class Limbs {
 public:
  Limbs() = default;
  explicit Limbs(const TickConfig& config);

  // The limbs of all of `joints`, themselves included.
  [[nodiscard]] JointMask of(JointMask joints) const;
  // `joints` and what hangs on them.
  [[nodiscard]] JointMask beyond(JointMask joints) const;

 private:
  std::array<JointMask, kMaxJoints> limb_{}, beyond_{};
};

}  // namespace takt::pipeline

// SPDX-License-Identifier: Apache-2.0
// What a policy's action sets at each joint, and in which unit. Known to all rooms that read a policy's chunks.
#pragma once

#include "config/joint_units.hpp"

namespace takt::config {

struct ActionTarget {
  CommandField field = CommandField::q;
  JointQuantity quantity;
};

constexpr ActionTarget target_of(ActionKind kind) {
  switch (kind) {
    case ActionKind::joint_position:
      return {CommandField::q, kJointPosition};
    case ActionKind::joint_velocity:
      return {CommandField::dq, kJointVelocity};
    case ActionKind::joint_torque:
      return {CommandField::tau_ff, kJointTorque};
  }
  return {};
}

}  // namespace takt::config

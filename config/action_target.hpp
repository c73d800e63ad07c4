// SPDX-License-Identifier: Apache-2.0
// What a policy's action sets at each joint, and in which unit. Known to all rooms that read a policy's chunks.
#pragma once

#include <string_view>

#include "config/robot_config.hpp"

namespace takt::config {

struct ActionTarget {
  CommandField field = CommandField::q;
  std::string_view unit;  // "rad", "rad/s", "Nm"
};

constexpr ActionTarget target_of(ActionKind kind) {
  switch (kind) {
    case ActionKind::joint_position:
      return {CommandField::q, "rad"};
    case ActionKind::joint_velocity:
      return {CommandField::dq, "rad/s"};
    case ActionKind::joint_torque:
      return {CommandField::tau_ff, "Nm"};
  }
  return {};
}

}  // namespace takt::config

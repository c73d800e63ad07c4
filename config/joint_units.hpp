// SPDX-License-Identifier: Apache-2.0
// Which units a joint's numbers are in: a hinge's in radians and newton metres, a slide's in metres and newtons.
#pragma once

#include <algorithm>
#include <string_view>

#include "config/robot_config.hpp"
#include "config/units.hpp"

namespace takt::config {

struct JointQuantity {
  Dimension hinge, slide;
  [[nodiscard]] constexpr Dimension of(JointKind kind) const { return kind == JointKind::slide ? slide : hinge; }
  // "rad", or "m".
  [[nodiscard]] std::string_view unit(JointKind kind) const { return base_symbol(of(kind)); }
};

inline constexpr JointQuantity kJointPosition{Dimension::angle, Dimension::length};
inline constexpr JointQuantity kJointVelocity{Dimension::angular_velocity, Dimension::velocity};
inline constexpr JointQuantity kJointAcceleration{Dimension::angular_acceleration, Dimension::acceleration};
inline constexpr JointQuantity kJointTorque{Dimension::torque, Dimension::force};
inline constexpr JointQuantity kJointTorqueRate{Dimension::torque_rate, Dimension::force_rate};
inline constexpr JointQuantity kJointStiffness{Dimension::stiffness, Dimension::linear_stiffness};
inline constexpr JointQuantity kJointDamping{Dimension::damping, Dimension::linear_damping};
inline constexpr JointQuantity kJointInertia{Dimension::inertia, Dimension::mass};
inline constexpr JointQuantity kJointGear{Dimension::none, Dimension::angle_per_length};

inline bool has_slides(const RobotConfig& robot) {
  return std::ranges::find(robot.joints, JointKind::slide, &Joint::kind) != robot.joints.end();
}

}  // namespace takt::config

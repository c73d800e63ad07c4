// SPDX-License-Identifier: Apache-2.0
// Which units a joint's numbers are in: a hinge's in radians and newton metres, a slide's in metres and newtons.
#pragma once

#include <algorithm>
#include <span>
#include <string>
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
// Of one joint's torque per another's position or velocity: by the kind of the first, then of the second.
inline constexpr JointQuantity kTorquePerAngle{Dimension::stiffness, Dimension::torque_per_length};
inline constexpr JointQuantity kForcePerAngle{Dimension::force_per_angle, Dimension::linear_stiffness};
inline constexpr JointQuantity kTorquePerVelocity{Dimension::damping, Dimension::torque_per_velocity};
inline constexpr JointQuantity kForcePerVelocity{Dimension::force_per_angular_velocity, Dimension::linear_damping};
inline constexpr JointQuantity kJointGear{Dimension::none, Dimension::angle_per_length};

// Of some joints of a robot: "rad", "m", or "rad (slides: m)". `joints`: by number; empty: all.
inline std::string unit_of_joints(const RobotConfig& robot, std::span<const std::size_t> joints,
                                  const JointQuantity& quantity) {
  std::string hinge(quantity.unit(JointKind::hinge)), slide(quantity.unit(JointKind::slide));
  const auto slides = [&robot](std::size_t joint) { return robot.joints[joint].kind == JointKind::slide; };
  const auto all = std::ranges::count(robot.joints, JointKind::slide, &Joint::kind);
  const auto count = joints.empty() ? all : std::ranges::count_if(joints, slides);
  if (count == 0) return hinge;
  if (static_cast<std::size_t>(count) == (joints.empty() ? robot.joints.size() : joints.size())) return slide;
  return hinge + " (slides: " + slide + ")";
}

inline bool has_slides(const RobotConfig& robot) {
  return std::ranges::find(robot.joints, JointKind::slide, &Joint::kind) != robot.joints.end();
}

}  // namespace takt::config

// SPDX-License-Identifier: Apache-2.0
#include "executive/pipeline/brake.hpp"

#include <algorithm>
#include <array>
#include <cmath>

namespace takt::pipeline {
namespace {

constexpr double kGentler = 0.9;         // of what torque allows, where the stop that was tried asks for more
constexpr double kPlaceRounding = 1e-9;  // rad

double braking_inertia(const JointConfig& joint) {
  return static_cast<double>(std::max(joint.inertia, joint.inertia_max));
}

double braking_torque(const JointConfig& joint) {
  return static_cast<double>(kBrakeTorque * joint.limits.torque);
}

double acceleration_of(const JointConfig& joint) {
  return static_cast<double>(joint.limits.acceleration);
}

bool is_scarce(JointMask scarce, std::size_t joint) {
  return (scarce & bit_of_joint(joint)) != 0;
}

// How far each joint still moves, and what that may do to gravity's torques.
struct Sway {
  std::array<float, kMaxJoints> moves, swing;  // uninitialised: joint_count entries are used
  void find(const GravityModel& gravity, const TickConfig& config) {
    if (config.gravity_compensation) return gravity.swing(moves, swing);
    std::fill_n(swing.begin(), config.joint_count, 0.0F);
  }
};

// Where the joint comes to stand lies inside its limits, or not further out than it is.
bool stands_inside(const Stopping& joint, double distance, const JointLimits& limits) {
  if (joint.from.dq > 0.0) return joint.from.q + distance <= static_cast<double>(limits.q_max) + kPlaceRounding;
  if (joint.from.dq < 0.0) return joint.from.q - distance >= static_cast<double>(limits.q_min) - kPlaceRounding;
  return true;
}

}  // namespace

JointMask scarce_joints(const TickConfig& config, const GravityModel& gravity) {
  if (config.without.brake_reserve) return 0;
  JointMask scarce = 0;
  for (std::size_t j = 0; j < config.joint_count; ++j) {
    const JointConfig& joint = config.joints[j];
    const bool by_gains = joint.loop == LoopAt::drive || joint.loop == LoopAt::host_torque;
    const bool ours = by_gains && !plays_held_targets(config, joint);
    const double load = config.gravity_compensation ? static_cast<double>(gravity.most(j)) : 0.0;
    const bool ample = braking_inertia(joint) * acceleration_of(joint) + load <= braking_torque(joint);
    if (ours && !joint.passive && !ample) scarce |= bit_of_joint(j);
  }
  return scarce;
}

void find_rates(const TickRecord& record, JointMask scarce, const GravityModel& gravity, const TickConfig& config,
                std::span<Rates> rates) {
  Sway sway;
  for (std::size_t j = 0; j < config.joint_count; ++j) {
    const JointConfig& joint = config.joints[j];
    rates[j] = {acceleration_of(joint), acceleration_of(joint)};
    const double speed = std::abs(static_cast<double>(record.joints[j].dq_estimate));
    // A scarce joint's stop takes longer; how much is what is being asked. Half is a guess that can_stop() judges.
    const double braking = (is_scarce(scarce, j) ? 0.5 : 1.0) * acceleration_of(joint);
    sway.moves[j] = static_cast<float>(speed * speed / (2.0 * braking));
  }
  if (scarce == 0) return;
  sway.find(gravity, config);
  for (std::size_t j = 0; j < config.joint_count; ++j) {
    if (!is_scarce(scarce, j)) continue;
    const JointConfig& joint = config.joints[j];
    const double load = static_cast<double>(record.joints[j].tau_gravity);
    const double left = braking_torque(joint) - static_cast<double>(sway.swing[j]);
    rates[j].up = std::clamp((left - load) / braking_inertia(joint), 0.0, acceleration_of(joint));
    rates[j].down = std::clamp((left + load) / braking_inertia(joint), 0.0, acceleration_of(joint));
  }
}

bool can_stop(std::span<Stopping> joints, const TickRecord& record, JointMask scarce, const GravityModel& gravity,
              const TickConfig& config) {
  const double dt = config.period.seconds();
  std::array<double, kMaxJoints> distance;  // uninitialised, as the moves
  Sway sway;
  for (std::size_t j = 0; j < config.joint_count; ++j) joints[j].deceleration = acceleration_of(config.joints[j]);
  for (int round = 1; round <= kBrakeRounds; ++round) {
    for (std::size_t j = 0; j < config.joint_count; ++j) {
      const double speed = std::abs(joints[j].from.dq);
      distance[j] = stopping_distance(speed, joints[j].deceleration, dt) - speed * dt;
      const double off = std::abs(joints[j].from.q - static_cast<double>(record.joints[j].q_estimate));
      sway.moves[j] = static_cast<float>(off + distance[j]);
    }
    sway.find(gravity, config);
    bool fits = true;
    for (std::size_t j = 0; j < config.joint_count; ++j) {
      if (!joints[j].is_braked || !is_scarce(scarce, j)) continue;
      const JointConfig& joint = config.joints[j];
      const double load = static_cast<double>(record.joints[j].tau_gravity);
      const double left = braking_torque(joint) - static_cast<double>(sway.swing[j]);
      if (std::abs(load) > left) return false;  // it could not even hold
      if (joints[j].from.dq == 0.0) continue;
      const double possible = (left + std::copysign(load, load * joints[j].from.dq)) / braking_inertia(joint);
      if (joints[j].deceleration <= possible) continue;
      if (possible <= 0.0) return false;
      joints[j].deceleration = kGentler * possible;
      fits = false;
    }
    if (!fits) continue;
    for (std::size_t j = 0; j < config.joint_count; ++j)
      if (joints[j].is_braked && is_scarce(scarce, j) &&
          !stands_inside(joints[j], distance[j], config.joints[j].limits))
        return false;
    return true;
  }
  return false;
}

}  // namespace takt::pipeline

// How many numbers the policy is shown and how many it gives. Precondition everywhere: robot.policy.
#pragma once

#include <cstddef>

#include "config/robot_config.hpp"

namespace takt::config {

std::size_t observed_joints(const RobotConfig& robot);   // length of every joint term
std::size_t outputs_per_step(const RobotConfig& robot);  // joints the policy drives
// Numbers of one instant of a term, bytes of an image; 0 for a sensor that is not declared.
std::size_t term_width(const RobotConfig& robot, const ObservationTerm& term);
// Width of the model's input: every term times its history.
std::size_t observation_width(const RobotConfig& robot);
// What a sampler is shown besides (policy_host/flow/flow_context.hpp); 0: the policy has none.
std::size_t flow_context_width(const RobotConfig& robot);

// Bytes of the largest policy_input.hpp that a host of this robot publishes; 0: its policies' inputs are not recorded,
// because `record` says so, because they hold images, or because they are larger than kMaxPolicyInputBytes. The same
// for the fallback policy. Here alone the robot may be without a policy.
std::size_t largest_policy_input(const RobotConfig& robot);

// The robot as its fallback policy's host sees it: `policy` is the fallback, which reads its own constant command.
RobotConfig seen_by_fallback(const RobotConfig& robot, const Fallback& fallback);
// The policy reads sensors outside the executive, so that its commands must say when those sensed.
bool reads_sensors(const Policy& policy);

}  // namespace takt::config

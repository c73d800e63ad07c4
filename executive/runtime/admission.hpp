// SPDX-License-Identifier: Apache-2.0
// May this policy command this robot? A policy is admitted when what it claims is what the executive was configured
// with; otherwise one sentence names both values. A claim of 0 for the configuration's hash means "not claimed". Pure.
#pragma once

#include <cstdint>
#include <string>

#include "config/robot_config.hpp"
#include "executive/contract/session.hpp"

namespace takt::runtime {

struct AdmissionRules {
  std::uint64_t config_hash = 0;
  std::uint64_t policy_hash = 0;  // 0: any policy
  std::uint64_t joint_names_hash = 0;
  std::uint32_t joint_count = 0;
  std::uint32_t step_count = 0;  // 0: any
  std::string policy_file;       // for messages
  std::string signed_by;         // key that a policy's file has to be signed by; empty: none
};

// `robot`: as the policy's host sees it.
AdmissionRules admission_rules(const config::RobotConfig& robot, std::uint64_t policy_hash);
// Empty: admitted.
std::string refusal_of_policy(const Hello& hello, const AdmissionRules& rules);
// `in_charge`: hash of the candidate that is in charge of the robot; 0: none is. Only that one may come back then.
std::string refusal_of_candidate(const Hello& hello, const AdmissionRules& rules, std::uint64_t in_charge);
std::string refusal_of_monitor(const Hello& hello, const AdmissionRules& rules);

}  // namespace takt::runtime

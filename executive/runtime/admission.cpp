// SPDX-License-Identifier: Apache-2.0
#include "executive/runtime/admission.hpp"

#include <fmt/format.h>

#include "config/load.hpp"

namespace takt::runtime {
namespace {

std::string refusal_of_config(const Hello& hello, const AdmissionRules& rules) {
  if (hello.config_hash == 0 || hello.config_hash == rules.config_hash) return {};
  return fmt::format(
      "configuration hash {:016x} is not the executive's {:016x}: start both with the same robot file, and restart "
      "the executive after changing it",
      hello.config_hash, rules.config_hash);
}

}  // namespace

AdmissionRules admission_rules(const config::RobotConfig& robot, std::uint64_t policy_hash) {
  return {robot.hash,
          policy_hash,
          config::joint_names_hash(robot),
          static_cast<std::uint32_t>(robot.joints.size()),
          robot.policy ? robot.policy->steps : 0,
          robot.policy ? robot.policy->file : std::string(),
          robot.policy && robot.policy->names_key() ? robot.policy->signed_by : std::string()};
}

std::string refusal_of_policy(const Hello& hello, const AdmissionRules& rules) {
  if (auto sentence = refusal_of_config(hello, rules); !sentence.empty()) return sentence;
  if (rules.policy_hash != 0 && hello.policy_hash != rules.policy_hash) {
    return fmt::format(
        "policy hash {:016x} is not that of the configured {}, {:016x}: serve that file, or name yours in the robot "
        "file and restart the executive",
        hello.policy_hash, rules.policy_file, rules.policy_hash);
  }
  if (hello.joint_count != rules.joint_count) {
    return fmt::format("the policy commands {} joints, the robot has {}: use a policy made for this robot",
                       hello.joint_count, rules.joint_count);
  }
  if (hello.joint_names_hash != rules.joint_names_hash) {
    return fmt::format(
        "joint names hash {:016x} is not the robot's {:016x}: the policy's joints must have the robot's names, in its "
        "order",
        hello.joint_names_hash, rules.joint_names_hash);
  }
  if (rules.step_count != 0 && hello.step_count != rules.step_count) {
    return fmt::format("the policy's chunks have {} steps, policy.steps says {}: correct the robot file or the policy",
                       hello.step_count, rules.step_count);
  }
  return {};
}

std::string refusal_of_candidate(const Hello& hello, const AdmissionRules& rules, std::uint64_t in_charge) {
  if (hello.policy_hash == 0)
    return "a candidate has to say which policy it is: set policy_hash to the first 8 bytes of its file's SHA-256";
  if (!rules.signed_by.empty())
    return fmt::format(
        "this robot takes policies signed by {} only, and a candidate shows no signature: deploy it instead",
        rules.signed_by);
  if (in_charge != 0 && hello.policy_hash != in_charge) {
    return fmt::format(
        "candidate {:016x} is in charge of the robot, and {:016x} may not take its place: `takt policy back` first",
        in_charge, hello.policy_hash);
  }
  AdmissionRules any_policy = rules;
  any_policy.policy_hash = 0;
  return refusal_of_policy(hello, any_policy);
}

std::string refusal_of_monitor(const Hello& hello, const AdmissionRules& rules) {
  return refusal_of_config(hello, rules);
}

}  // namespace takt::runtime

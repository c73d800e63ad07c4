// SPDX-License-Identifier: Apache-2.0
#include "policy_host/policy_fit.hpp"

#include <fmt/format.h>

#include <algorithm>
#include <vector>

#include "config/observation_shape.hpp"
#include "executive/contract/joints.hpp"

namespace takt::policy_host {
namespace {

using config::ObservationTerm;
using config::outputs_per_step;
using config::RobotConfig;
using config::term_width;

std::string term_name(const ObservationTerm& term) {
  const std::string kind(config::name(term.kind));
  return term.sensor.empty() ? kind : kind + " " + term.sensor;
}

std::unexpected<std::string> refuse(const RobotConfig& robot, const std::string& what) {
  return std::unexpected(robot.file + ": " + what);
}

// A list of joint indices: within range, none twice.
bool is_selection(const std::vector<std::size_t>& joints, std::size_t joint_count) {
  std::vector<bool> seen(joint_count, false);
  for (const std::size_t joint : joints) {
    if (joint >= joint_count || seen[joint]) return false;
    seen[joint] = true;
  }
  return true;
}

bool one_or(std::size_t count, std::size_t wanted) {
  return count == 1 || count == wanted;
}

std::expected<void, std::string> check_term(const RobotConfig& robot, const ObservationTerm& term) {
  const std::string name = term_name(term);
  const bool known = std::ranges::any_of(robot.sensors, [&](const auto& sensor) { return sensor.name == term.sensor; });
  if (!term.sensor.empty() && !known) {
    return refuse(robot, fmt::format("policy.observation uses sensor '{}', which `sensors` does not list; add it there",
                                     term.sensor));
  }
  if (term.history < 1) return refuse(robot, fmt::format("policy.observation {}: history must be at least 1", name));
  const std::size_t width = term_width(robot, term);
  if (width == 0) return refuse(robot, fmt::format("policy.observation {} has no values; give some or drop it", name));
  if (std::ranges::any_of(term.joints, [&](std::size_t joint) { return joint >= robot.joints.size(); }))
    return refuse(robot, fmt::format("policy.observation {} names a joint beyond the robot's {}; list its own", name,
                                     robot.joints.size()));
  const std::size_t scales = config::scales_of(robot, term);
  if (!one_or(term.scale.size(), scales)) {
    return refuse(robot, fmt::format("policy.observation {} has {} scales for {} {}; give one, or one each", name,
                                     term.scale.size(), scales,
                                     config::image_of(robot, term) != nullptr ? "channels" : "values"));
  }
  return {};
}

std::expected<void, std::string> check_action(const RobotConfig& robot) {
  const config::Action& action = robot.policy->action;
  const std::size_t outputs = outputs_per_step(robot);
  if (!is_selection(action.joint_of_output, robot.joints.size())) {
    return refuse(robot, fmt::format("policy.action names a joint twice or one beyond the robot's {}; list each once",
                                     robot.joints.size()));
  }
  if (!one_or(action.scale.size(), outputs)) {
    return refuse(robot, fmt::format("policy.action has {} scales for {} outputs; give one, or one per output",
                                     action.scale.size(), outputs));
  }
  if (action.offset == config::OffsetKind::values && action.offset_values.size() != outputs) {
    return refuse(robot, fmt::format("policy.action has {} offsets for {} outputs; give one per output",
                                     action.offset_values.size(), outputs));
  }
  return {};
}

}  // namespace

std::expected<void, std::string> check_policy_section(const RobotConfig& robot) {
  if (!robot.policy) return refuse(robot, "there is no `policy` section; a policy host needs one");
  const config::Policy& policy = *robot.policy;
  if (robot.joints.empty() || robot.joints.size() > kMaxJoints) {
    return refuse(robot, fmt::format("{} joints; a command chunk holds 1 to {}", robot.joints.size(), kMaxJoints));
  }
  if (policy.steps < 1 || policy.steps > kMaxChunkSteps) {
    return refuse(robot,
                  fmt::format("policy.steps is {}; a command chunk holds 1 to {}", policy.steps, kMaxChunkSteps));
  }
  if (!is_selection(policy.joint_order, robot.joints.size())) {
    return refuse(robot,
                  fmt::format("policy.joint_order names a joint twice or one beyond the robot's {}; list each once",
                              robot.joints.size()));
  }
  for (const ObservationTerm& term : policy.observation) {
    if (auto fine = check_term(robot, term); !fine) return fine;
  }
  const auto same_history = [&](const auto& term) { return term.history == policy.observation.front().history; };
  if (policy.history_layout == "by_time" && !std::ranges::all_of(policy.observation, same_history)) {
    return refuse(robot, "policy.history_layout by_time needs the same history in every term; make them equal");
  }
  return check_action(robot);
}

std::expected<void, std::string> check_fit(const RobotConfig& robot, const Policy& policy) {
  const config::Policy& section = *robot.policy;
  if (section.requests_in_flight > 1 && policy.is_recurrent())
    return refuse(robot, fmt::format("policy.requests_in_flight is {}, and {} is recurrent: each answer needs the one "
                                     "before; write 1",
                                     section.requests_in_flight, section.file));
  const std::size_t context = config::flow_context_width(robot), input = config::observation_width(robot) + context;
  std::string sum;
  for (const ObservationTerm& term : section.observation) {
    const std::size_t width = term_width(robot, term);
    sum += fmt::format("{}{} {}", sum.empty() ? "" : " + ", term_name(term), width);
    if (term.history > 1) sum += fmt::format(" x {}", term.history);
  }
  if (context > 0) sum += fmt::format("{}sampler {}", sum.empty() ? "" : " + ", context);
  if (input != policy.input_size()) {
    return std::unexpected(
        fmt::format("{}: {} wants {} values, the configuration's terms give {}: {}; correct "
                    "policy.observation in {}",
                    section.file, section.input, policy.input_size(), input, sum, robot.file));
  }
  const std::size_t output = config::output_width(robot);
  if (output != policy.output_size()) {
    const std::size_t tensors = config::named_outputs(section).size();
    // Of one step, as actors give it: a distribution, or actions for other joints.
    const bool twice = section.steps == 1 && policy.output_size() == 2 * output;
    const char* const cure = twice ? "export the mean alone if the rest are deviations, or correct policy.action"
                             : section.steps == 1 ? "correct policy.action"
                                                  : "correct policy.steps or policy.action";
    return std::unexpected(
        fmt::format("{}: {} gives {} values, the configuration wants {}: {} steps x {} outputs{}; {} in {}",
                    section.file, section.output, policy.output_size(), output, section.steps, outputs_per_step(robot),
                    tensors > 1 ? fmt::format(" x {} tensors", tensors) : "", cure, robot.file));
  }
  return {};
}

}  // namespace takt::policy_host

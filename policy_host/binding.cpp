// SPDX-License-Identifier: Apache-2.0
#include "policy_host/binding.hpp"

#include <fmt/format.h>

#include <algorithm>
#include <optional>
#include <span>

#include "config/observation_shape.hpp"
#include "config/robot_text.hpp"
#include "config/units.hpp"
#include "policy_host/bound_terms.hpp"
#include "policy_host/policy_tensors.hpp"

namespace takt::policy_host {
namespace {

using config::ObservationTerm;
using config::RobotConfig;
using config::TermKind;
using Result = std::expected<void, std::string>;

struct Bound {
  const DescribedInput* input;
  std::span<const ObservationTerm> terms;
};

std::string tensor_of(const std::string& port) {
  const std::size_t slash = port.rfind('/');
  return slash == std::string::npos ? port : port.substr(slash + 1);
}

// The inputs in the robot file's order, each with its terms.
std::vector<Bound> bound_inputs(const DescribedPolicy& said, const RobotConfig& robot) {
  const config::Policy& section = *robot.policy;
  std::vector<const DescribedInput*> order;
  for (const std::string& name : split_names(section.input)) {
    const auto found = std::ranges::find_if(said.inputs, [&](const DescribedInput& input) {
      return input.name == name || tensor_of(input.name) == tensor_of(name);
    });
    if (found != said.inputs.end()) order.push_back(&*found);
  }
  if (section.input.empty())
    for (const DescribedInput& input : said.inputs) order.push_back(&input);
  std::vector<Bound> bound;
  auto term = section.observation.begin();
  for (const DescribedInput* const input : order) {
    const auto first = term;
    for (std::size_t filled = 0; filled < input->width && term != section.observation.end(); ++term)
      filled += config::term_width(robot, *term) * term->history;
    bound.push_back({input, {first, term}});
  }
  return bound;
}

std::vector<std::string> names_of(const RobotConfig& robot, const std::vector<std::size_t>& joints) {
  std::vector<std::string> names;
  for (const std::size_t joint : joints) names.push_back(robot.joints[joint].name);
  if (joints.empty())
    for (const config::Joint& joint : robot.joints) names.push_back(joint.name);
  return names;
}

std::unexpected<std::string> refuse(const RobotConfig& robot, const std::string& what) {
  return std::unexpected(fmt::format("{}: {}; correct policy in {}", robot.policy->file, what, robot.file));
}

// Joints are known by name and stand in their places. `of`: "input q is of".
Result check_joints(const RobotConfig& robot, const std::string& of, const std::vector<std::string>& in_export,
                    const std::vector<std::string>& has) {
  const std::vector<std::string> said = config::joint_names_of(in_export);
  if (said.empty()) return {};
  const auto is_unknown = [&](const std::string& name) {
    return std::ranges::find(robot.joints, name, &config::Joint::name) == robot.joints.end();
  };
  if (const auto unknown = std::ranges::count_if(said, is_unknown); unknown != 0)
    return std::unexpected(fmt::format(
        "{}: {} {} joints that {} does not have, the first is {}; call the robot's joints there as the policy does",
        robot.policy->file, of, unknown, robot.file, *std::ranges::find_if(said, is_unknown)));
  if (said.size() != has.size())
    return refuse(robot, fmt::format("{} {} joints, {} in the robot's file", of, said.size(), has.size()));
  const auto [wrong, instead] = std::ranges::mismatch(said, has);
  if (wrong == said.end()) return {};
  return refuse(
      robot, fmt::format("{} {} at place {}, {} in the robot's file", of, *wrong, wrong - said.begin() + 1, *instead));
}

std::string_view order_of(const ObservationTerm& term) {
  return term.order == config::QuaternionOrder::wxyz ? "wxyz" : "xyzw";
}

bool is_as_it_is(const ObservationTerm& term) {
  const auto all = [](const std::vector<double>& values, double wanted) {
    return std::ranges::all_of(values, [&](double value) { return value == wanted; });
  };
  return all(term.scale, 1) && all(term.mean, 0) && all(term.standard_deviation, 1) && term.clip.empty();
}

// "m/s^2" is "m/s2", and "N,Nm" is "N, Nm".
bool is_unit(std::string unit, std::string other) {
  for (std::string* const text : {&unit, &other}) std::erase_if(*text, [](char c) { return c == ' ' || c == '^'; });
  return unit == other;
}

bool is_sensor_for(const DescribedInput& input, const RobotConfig& robot, const ObservationTerm& term) {
  const auto sensor = std::ranges::find(robot.sensors, term.sensor, &config::Sensor::name);
  if (term.kind != TermKind::sensor || sensor == robot.sensors.end()) return false;
  const auto is_its = [&](const std::string& unit) { return is_unit(unit, sensor->unit); };
  if (!input.units.empty() && std::ranges::none_of(input.units, is_its)) return false;
  return input.frame.empty() || input.frame == sensor->frame;
}

// The robot's own term for a meaning; nothing: it has none, and a sensor stands for it.
std::optional<TermKind> own_term(Meaning meaning) {
  switch (meaning) {
    case Meaning::joint_position:
      return TermKind::joint_position;
    case Meaning::joint_velocity:
      return TermKind::joint_velocity;
    case Meaning::joint_torque:
      return TermKind::joint_torque;
    case Meaning::base_orientation:
      return TermKind::base_orientation;
    case Meaning::base_angular_velocity:
      return TermKind::base_angular_velocity;
    case Meaning::projected_gravity:
      return TermKind::projected_gravity;
    case Meaning::command:
      return TermKind::command;
    case Meaning::unsaid:
    case Meaning::base_linear_velocity:
    case Meaning::sensor:
      return std::nullopt;
  }
  return std::nullopt;
}

// What may stand for an input, in words; empty: it does.
std::string not_fitting(const DescribedInput& input, const RobotConfig& robot, const ObservationTerm& term) {
  const std::optional<TermKind> own = own_term(input.meaning);
  if (own && term.kind == *own) return {};
  std::string own_name = own ? fmt::format("a term {}", config::name(*own)) : "";
  if (input.meaning == Meaning::joint_velocity)
    return term.kind == TermKind::drive_velocity ? "" : own_name + " or drive_velocity";
  if (input.meaning == Meaning::command) return term.kind == TermKind::constant ? "" : own_name + " or constant";
  if (own && config::is_of_joints(*own)) return own_name;
  if (is_sensor_for(input, robot, term)) return {};
  return (own ? own_name + ", or " : "") + sensor_for(input);
}

// Whose it is the exporter does not say, but the quantity: no term of another one may fill it.
Result check_quantity(const RobotConfig& robot, const Bound& bound) {
  const DescribedInput& input = *bound.input;
  if (input.units.empty()) return {};
  const auto is_in = [&](std::string_view unit) { return std::ranges::find(input.units, unit) != input.units.end(); };
  for (const ObservationTerm& term : bound.terms) {
    const bool fits = term.kind == TermKind::constant || is_sensor_for(input, robot, term) ||
                      (term.kind == TermKind::base_angular_velocity && is_in("rad/s")) ||
                      (term.kind == TermKind::base_orientation && is_in(order_of(term)));
    if (!fits)
      return refuse(robot, fmt::format("input {} is {}, and wants {}", input.name, input.word, sensor_for(input)));
  }
  return {};
}

Result check_input(const RobotConfig& robot, const Bound& bound) {
  const DescribedInput& input = *bound.input;
  if (input.meaning == Meaning::unsaid) return check_quantity(robot, bound);
  const auto says = fmt::format("input {} is {} ({})", input.name, name(input.meaning), input.word);
  if (bound.terms.size() != 1)
    return refuse(robot, fmt::format("{}, and wants one term, not {}", says, bound.terms.size()));
  const ObservationTerm& term = bound.terms.front();
  if (const std::string wants = not_fitting(input, robot, term); !wants.empty())
    return refuse(robot, fmt::format("{}, and wants {}", says, wants));
  if (!is_as_it_is(term))
    return refuse(robot, fmt::format("{}, and wants it as it is: drop scale, clip, mean and std", says));
  if (term.kind == TermKind::base_orientation && !input.quaternion.empty()) {
    if (order_of(term) != input.quaternion)
      return refuse(robot, fmt::format("{} in the order {}, the term says {}", says, input.quaternion, order_of(term)));
  }
  if (!config::is_of_joints(term.kind)) return {};
  return check_joints(robot, says + ", of", input.joints,
                      names_of(robot, term.joints.empty() ? robot.policy->joint_order : term.joints));
}

std::string bound_name(const config::Policy& section, CommandField field) {
  for (const config::NamedOutput& output : config::named_outputs(section))
    if (output.field == field) return output.name;
  return {};
}

std::string_view key_of(CommandField field, bool is_action) {
  if (is_action) return "policy.output";
  switch (field) {
    case CommandField::q:
      return "policy.output";
    case CommandField::dq:
      return "policy.action.outputs.velocity";
    case CommandField::kp:
      return "policy.action.outputs.kp";
    case CommandField::kd:
      return "policy.action.outputs.kd";
    case CommandField::tau_ff:
      return "policy.action.outputs.torque";
  }
  return "";
}

Result check_output(const RobotConfig& robot, const DescribedOutput& output) {
  const config::Policy& section = *robot.policy;
  if (!output.field)
    return refuse(robot, fmt::format("output {} ({}) is nothing that a joint can be told; export the policy without it",
                                     output.name, output.word.empty() ? "no kind" : output.word));
  const CommandField action = config::named_outputs(section).front().field;
  const std::string has = bound_name(section, *output.field);
  if (tensor_of(has) != tensor_of(output.name))
    return refuse(robot, fmt::format("output {} ({}) goes nowhere: name it in {}", output.name, output.word,
                                     key_of(*output.field, *output.field == action)));
  const std::vector<std::string> driven =
      names_of(robot, section.action.joint_of_output.empty() ? section.joint_order : section.action.joint_of_output);
  if (auto fine = check_joints(robot, fmt::format("output {} is of", output.name), output.joints, driven); !fine)
    return fine;
  if (output.steps != section.steps)
    return refuse(robot,
                  fmt::format("output {} has {} steps, policy.steps is {}", output.name, output.steps, section.steps));
  if (output.step_period.ns != 0 && output.step_period.ns != section.step_period.ns)
    return refuse(
        robot, fmt::format("the steps of output {} are {} apart, policy.step_period is {}", output.name,
                           config::format_duration(output.step_period), config::format_duration(section.step_period)));
  return {};
}

}  // namespace

Result check_binding(const DescribedPolicy& said, const RobotConfig& robot) {
  const config::Policy& section = *robot.policy;
  for (const Bound& bound : bound_inputs(said, robot))
    if (auto fine = check_input(robot, bound); !fine) return fine;
  for (const DescribedOutput& output : said.outputs)
    if (auto fine = check_output(robot, output); !fine) return fine;
  const config::Action& action = section.action;
  const bool scaled = std::ranges::any_of(action.scale, [](double scale) { return scale != 1; });
  if (scaled || action.offset != config::OffsetKind::zero)
    return refuse(robot, fmt::format("the {} gives targets as they are: write policy.action scale 1 and offset zero",
                                     said.format));
  if (said.period.ns != 0 && said.period.ns != section.period.ns)
    return refuse(robot, fmt::format("it was exported to infer every {}, policy.period is {}",
                                     config::format_duration(said.period), config::format_duration(section.period)));
  return {};
}

std::vector<std::string> binding_lines(const DescribedPolicy& said, const RobotConfig& robot) {
  std::vector<FilledTensor> tensors;
  for (const Bound& bound : bound_inputs(said, robot)) tensors.push_back({bound.input->name, bound.input->width});
  return bound_lines(tensors, robot);
}

}  // namespace takt::policy_host

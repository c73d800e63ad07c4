#include "policy_host/binding.hpp"

#include <fmt/format.h>
#include <fmt/ranges.h>

#include <algorithm>
#include <span>

#include "config/observation_shape.hpp"
#include "config/units.hpp"
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

// Names that the robot does not know may be the exporter's own; one that it knows must stand in its place.
std::string misplaced(const RobotConfig& robot, const std::vector<std::string>& said,
                      const std::vector<std::string>& has) {
  if (said.empty()) return {};
  if (said.size() != has.size()) return fmt::format("{} joints, {} in the robot's file", said.size(), has.size());
  for (std::size_t i = 0; i < said.size(); ++i) {
    const bool known =
        std::ranges::any_of(robot.joints, [&](const config::Joint& joint) { return joint.name == said[i]; });
    if (said[i] != has[i] && known)
      return fmt::format("{} at place {}, {} in the robot's file", said[i], i + 1, has[i]);
  }
  return {};
}

std::unexpected<std::string> refuse(const RobotConfig& robot, const std::string& what) {
  return std::unexpected(fmt::format("{}: {}; mend policy in {}", robot.policy->file, what, robot.file));
}

bool is_as_it_is(const ObservationTerm& term) {
  const auto all = [](const std::vector<double>& values, double wanted) {
    return std::ranges::all_of(values, [&](double value) { return value == wanted; });
  };
  return all(term.scale, 1) && all(term.mean, 0) && all(term.standard_deviation, 1) && term.clip.empty();
}

std::string unit_of_sensor(const RobotConfig& robot, const ObservationTerm& term) {
  const auto sensor = std::ranges::find(robot.sensors, term.sensor, &config::Sensor::name);
  return sensor == robot.sensors.end() ? "" : sensor->unit;
}

// What may stand for a meaning, in words; empty: it does.
std::string not_fitting(Meaning meaning, const RobotConfig& robot, const ObservationTerm& term) {
  const auto sensor_in = [&](std::string_view unit) {
    return term.kind == TermKind::sensor && unit_of_sensor(robot, term) == unit;
  };
  switch (meaning) {
    case Meaning::unsaid:
      return {};
    case Meaning::joint_position:
      return term.kind == TermKind::joint_position ? "" : "a term joint_position";
    case Meaning::joint_velocity:
      return term.kind == TermKind::joint_velocity || term.kind == TermKind::drive_velocity
                 ? ""
                 : "a term joint_velocity or drive_velocity";
    case Meaning::joint_torque:
      return term.kind == TermKind::joint_torque ? "" : "a term joint_torque";
    case Meaning::base_orientation:
      return term.kind == TermKind::base_orientation ? "" : "a term base_orientation";
    case Meaning::base_angular_velocity:
      return term.kind == TermKind::base_angular_velocity || sensor_in("rad/s")
                 ? ""
                 : "a term base_angular_velocity, or a sensor whose unit is rad/s";
    case Meaning::base_linear_velocity:
      return sensor_in("m/s") ? "" : "a sensor whose unit is m/s (`sensors: - { unit: m/s }`)";
    case Meaning::command:
      return term.kind == TermKind::command || term.kind == TermKind::constant ? "" : "a term command or constant";
    case Meaning::sensor:
      return term.kind == TermKind::sensor ? "" : "a term sensor";
  }
  return {};
}

Result check_input(const RobotConfig& robot, const Bound& bound) {
  const DescribedInput& input = *bound.input;
  if (input.meaning == Meaning::unsaid) return {};
  const auto says = fmt::format("input {} is {} ({})", input.name, name(input.meaning), input.word);
  if (bound.terms.size() != 1)
    return refuse(robot, fmt::format("{}, and wants one term, not {}", says, bound.terms.size()));
  const ObservationTerm& term = bound.terms.front();
  if (const std::string wants = not_fitting(input.meaning, robot, term); !wants.empty())
    return refuse(robot, fmt::format("{}, and wants {}", says, wants));
  if (!is_as_it_is(term))
    return refuse(robot, fmt::format("{}, and wants it as it is: drop scale, clip, mean and std", says));
  if (term.kind == TermKind::base_orientation && !input.quaternion.empty()) {
    const std::string order = term.order == config::QuaternionOrder::wxyz ? "wxyz" : "xyzw";
    if (order != input.quaternion)
      return refuse(robot, fmt::format("{} in the order {}, the term says {}", says, input.quaternion, order));
  }
  if (!config::is_of_joints(term.kind)) return {};
  const std::string wrong =
      misplaced(robot, input.joints, names_of(robot, term.joints.empty() ? robot.policy->joint_order : term.joints));
  if (!wrong.empty()) return refuse(robot, fmt::format("{}, of {}", says, wrong));
  return {};
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
  if (const std::string wrong = misplaced(robot, output.joints, driven); !wrong.empty())
    return refuse(robot, fmt::format("output {} is of {}", output.name, wrong));
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
    return refuse(
        robot, fmt::format("a {} gives targets as they are: write policy.action scale 1 and offset zero", said.format));
  if (said.period.ns != 0 && said.period.ns != section.period.ns)
    return refuse(robot, fmt::format("it was exported to infer every {}, policy.period is {}",
                                     config::format_duration(said.period), config::format_duration(section.period)));
  return {};
}

namespace {

std::string source_text(const RobotConfig& robot, const ObservationTerm& term) {
  const std::size_t width = config::term_width(robot, term);
  switch (term.kind) {
    case TermKind::joint_position:
      return fmt::format("joint_position of {} joints, rad", width);
    case TermKind::joint_position_relative:
      return fmt::format("joint_position_relative of {} joints, rad", width);
    case TermKind::joint_velocity:
      return fmt::format("joint_velocity of {} joints, rad/s", width);
    case TermKind::drive_velocity:
      return fmt::format("drive_velocity of {} joints, rad/s", width);
    case TermKind::joint_torque:
      return fmt::format("joint_torque of {} joints, Nm", width);
    case TermKind::base_orientation:
      return fmt::format("base_orientation by sensor {}, base in world, {}", robot.imu ? robot.imu->sensor : "none",
                         term.order == config::QuaternionOrder::wxyz ? "w x y z" : "x y z w");
    case TermKind::base_angular_velocity:
      return fmt::format("base_angular_velocity by sensor {}, rad/s, base frame",
                         robot.imu ? robot.imu->sensor : "none");
    case TermKind::projected_gravity:
      return "projected_gravity, base frame";
    case TermKind::sensor:
      return fmt::format("sensor {}, {} values, {}", term.sensor, width, unit_of_sensor(robot, term));
    case TermKind::command:
      return fmt::format("command {}, {} values", term.sensor, width);
    case TermKind::last_action:
      return "last_action";
    case TermKind::constant:
      return fmt::format("constant [{}]", fmt::join(term.constant, ", "));
    case TermKind::gait_phase:
      return "gait_phase";
    case TermKind::motion_reference:
      return "motion_reference " + term.output;
  }
  return {};
}

}  // namespace

std::vector<std::string> binding_lines(const DescribedPolicy& said, const RobotConfig& robot) {
  std::vector<std::string> lines;
  for (const auto& [input, terms] : bound_inputs(said, robot)) {
    std::string sources;
    for (const ObservationTerm& term : terms) sources += (sources.empty() ? "" : " + ") + source_text(robot, term);
    lines.push_back(fmt::format("{}: {}", input->name, sources));
  }
  return lines;
}

}  // namespace takt::policy_host

// SPDX-License-Identifier: Apache-2.0
#include "policy_host/described_import.hpp"

#include <fmt/format.h>
#include <fmt/ranges.h>

#include <algorithm>
#include <cmath>
#include <limits>
#include <set>

#include "config/robot_text.hpp"

namespace takt::policy_host {
namespace {

using config::DeployFile;
using config::DeployTensors;
using config::DeployTerm;
using Names = std::vector<std::string>;

// A tensor's name as a sensor may be called.
std::string identifier_of(const std::string& tensor) {
  return config::as_identifier(tensor.substr(tensor.rfind('/') + 1), "input_");
}

// The policy's joints: of the input with their positions, else as the exporter lists them.
Names joints_of(const DescribedPolicy& policy) {
  for (const DescribedInput& input : policy.inputs)
    if (input.meaning == Meaning::joint_position && !input.joints.empty()) return input.joints;
  for (const DescribedInput& input : policy.inputs)
    if (!input.joints.empty()) return input.joints;
  return policy.joints.joints;
}

class Writer {
 public:
  Writer(const DescribedPolicy& policy, const Names& robot, Names order)
      : policy_(policy), robot_(robot), order_(std::move(order)) {}

  DeployFile write() {
    for (const std::string& joint : order_) file_.robot_joint.push_back(index_of(joint));
    for (std::size_t i = 0; i < order_.size(); ++i) file_.slot.push_back(i);
    file_.step_dt = policy_.period;
    file_.stiffness = of_joints(policy_.joints.stiffness, robot_);
    file_.damping = of_joints(policy_.joints.damping, robot_);
    file_.default_position = of_joints(policy_.joints.default_position, order_);
    for (const DescribedInput& input : policy_.inputs) add_input(input);
    add_outputs();
    file_.remarks.insert(file_.remarks.end(), policy_.notes.begin(), policy_.notes.end());
    file_.tensors = std::move(tensors_);
    return std::move(file_);
  }

 private:
  [[nodiscard]] std::size_t index_of(const std::string& joint) const {
    return static_cast<std::size_t>(std::ranges::find(robot_, joint) - robot_.begin());
  }

  [[nodiscard]] std::vector<double> of_joints(const std::vector<double>& said, const Names& joints) const {
    if (said.empty()) return {};
    std::vector<double> values;
    for (const std::string& joint : joints) {
      const auto found = std::ranges::find(policy_.joints.joints, joint);
      values.push_back(found == policy_.joints.joints.end()
                           ? std::numeric_limits<double>::quiet_NaN()
                           : said[static_cast<std::size_t>(found - policy_.joints.joints.begin())]);
    }
    return values;
  }

  void add_term(std::string text, std::string comment) {
    DeployTerm term;
    term.text = std::move(text);
    term.comment = std::move(comment);
    file_.terms.push_back(std::move(term));
  }

  void add_joint_term(const char* kind, const DescribedInput& input) {
    std::string joints;
    if (input.joints.empty())
      joints = ", joints: FILL_IN";
    else if (input.joints != order_)
      joints = fmt::format(", joints: [{}]", fmt::join(config::joint_names_of(input.joints), ", "));
    add_term(kind + joints, input.name);
  }

  void add_command(const DescribedInput& input) {
    const std::string sensor = identifier_of(input.name);
    std::string low = "FILL_IN", high = low, absent = low;
    if (!input.ranges.empty()) {
      std::vector<double> lows, highs, still;
      for (const auto& [least, most] : input.ranges) {
        lows.push_back(least);
        highs.push_back(most);
        still.push_back(std::clamp(0.0, least, most));
      }
      low = fmt::format("[{}]", fmt::join(lows, ", "));
      high = fmt::format("[{}]", fmt::join(highs, ", "));
      absent = fmt::format("[{}]", fmt::join(still, ", "));
    }
    const std::string what = input.elements.empty() ? "which value is which the export does not say"
                                                    : fmt::format("{}", fmt::join(input.elements, ", "));
    tensors_.sensors.push_back(
        fmt::format("  - name: {}   # {}\n    values: {}\n    timeout: FILL_IN\n    command: {{ "
                    "minimum: {}, maximum: {}, when_absent: {} }}\n",
                    sensor, config::on_one_line(what), input.width, low, high, absent));
    add_term(fmt::format("command, sensor: {}", sensor), input.name);
  }

  void add_input(const DescribedInput& input) {
    tensors_.input += (tensors_.input.empty() ? "" : ", ") + input.name;
    const std::string what = fmt::format("{}, {} values: {}", input.name, input.width, input.word);
    switch (input.meaning) {
      case Meaning::unsaid:
        return add_term("FILL_IN", what + "; what it is the export does not say");
      case Meaning::joint_position:
        return add_joint_term("joint_position", input);
      case Meaning::joint_velocity:
        return add_joint_term("joint_velocity", input);
      case Meaning::joint_torque:
        return add_joint_term("joint_torque", input);
      case Meaning::base_orientation:
        tensors_.needs_imu = true;
        return add_term("base_orientation, order: " + (input.quaternion.empty() ? "FILL_IN" : input.quaternion),
                        input.name);
      case Meaning::base_angular_velocity:
        tensors_.needs_imu = true;
        return add_term("base_angular_velocity", input.name);
      case Meaning::projected_gravity:
        tensors_.needs_imu = true;
        return add_term("projected_gravity", input.name);
      case Meaning::command:
        return add_command(input);
      case Meaning::base_linear_velocity:
      case Meaning::sensor:
        return add_term("sensor, sensor: FILL_IN", what + "; no robot says it of itself: name " + sensor_for(input));
    }
  }

  [[nodiscard]] const DescribedOutput* output_of(CommandField field) const {
    const auto found = std::ranges::find(policy_.outputs, std::optional(field), &DescribedOutput::field);
    return found == policy_.outputs.end() ? nullptr : &*found;
  }

  void add_outputs() {
    const DescribedOutput* action = nullptr;
    for (const auto& [field, kind] :
         {std::pair{CommandField::q, "joint_position"}, std::pair{CommandField::dq, "joint_velocity"},
          std::pair{CommandField::tau_ff, "joint_torque"}}) {
      if (action != nullptr) break;
      action = output_of(field);
      tensors_.action_kind = kind;
    }
    if (action == nullptr) {
      tensors_.output = tensors_.action_kind = "FILL_IN";
      return;
    }
    tensors_.output = action->name;
    tensors_.steps = static_cast<std::uint32_t>(action->steps);
    tensors_.step_period = action->step_period;
    if (action->joints != order_)
      for (const std::string& joint : action->joints) tensors_.action_joints.push_back(index_of(joint));
    for (const auto& [field, key] : {std::pair{CommandField::dq, "velocity"}, std::pair{CommandField::tau_ff, "torque"},
                                     std::pair{CommandField::kp, "kp"}, std::pair{CommandField::kd, "kd"}})
      if (const DescribedOutput* const output = output_of(field); output != nullptr && output != action)
        tensors_.outputs.emplace_back(key, output->name);
    for (const DescribedOutput& output : policy_.outputs)
      if (!output.field)
        file_.notes.push_back(fmt::format("output {}: {} is nothing that a joint can be told", output.name,
                                          output.word.empty() ? "no kind" : output.word));
  }

  const DescribedPolicy& policy_;
  const Names& robot_;
  Names order_;
  DeployFile file_;
  DeployTensors tensors_;
};

}  // namespace

std::expected<DeployFile, std::string> deploy_file_of(const DescribedPolicy& policy, Names& robot_joints) {
  Names order = joints_of(policy);
  if (order.empty()) return std::unexpected("names no joints; write the robot file by hand (docs/policies.md)");
  if (robot_joints.empty()) robot_joints = order;
  const std::set<std::string> robot(robot_joints.begin(), robot_joints.end());
  const auto is_known = [&](const std::string& joint) { return robot.contains(joint); };
  const auto all_known = [&](const Names& joints) { return std::ranges::all_of(joints, is_known); };
  bool fits = std::set<std::string>(order.begin(), order.end()) == robot && order.size() == robot_joints.size();
  for (const DescribedInput& input : policy.inputs) fits = fits && all_known(input.joints);
  for (const DescribedOutput& output : policy.outputs) fits = fits && all_known(output.joints);
  if (!fits)
    return std::unexpected(fmt::format("joints {}; the robot's are {}: name all and no others", fmt::join(order, ", "),
                                       fmt::join(robot_joints, ", ")));
  return Writer(policy, robot_joints, std::move(order)).write();
}

}  // namespace takt::policy_host

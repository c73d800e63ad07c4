// SPDX-License-Identifier: Apache-2.0
#include "policy_host/leapp/leapp_description.hpp"

#include <fmt/format.h>

#include <algorithm>
#include <array>
#include <cmath>
#include <functional>
#include <map>
#include <numeric>

namespace takt::policy_host {
namespace {

using Names = std::vector<std::string>;

std::size_t elements(const LeappTensor& tensor) {
  return static_cast<std::size_t>(
      std::accumulate(tensor.shape.begin(), tensor.shape.end(), std::int64_t{1}, std::multiplies<>()));
}

// Of the values of one instant; empty: the file does not say, or not of all.
Names names_of_values(const LeappTensor& tensor, std::size_t width) {
  for (const Names& names : tensor.element_names)
    if (names.size() == width) return names;
  return {};
}

const LeappTensor& tensor_at(const LeappBundle& bundle, const LeappPort& port, bool input) {
  const auto node = std::ranges::find(bundle.nodes, port.node, &LeappNode::name);
  const auto& tensors = input ? node->inputs : node->outputs;
  return *std::ranges::find(tensors, port.tensor, &LeappTensor::name);
}

// "root_quat_w" of "state:robot:root_quat_w".
std::string quantity_of(const std::string& connection) {
  return connection.substr(connection.rfind(':') + 1);
}

bool is_of_root(const std::string& quantity, std::string_view frame) {
  return quantity.starts_with("root_") && quantity.ends_with(frame);
}

std::string quaternion_order(const Names& names) {
  if (names == Names{"qx", "qy", "qz", "qw"} || names == Names{"x", "y", "z", "w"}) return "xyzw";
  if (names == Names{"qw", "qx", "qy", "qz"} || names == Names{"w", "x", "y", "z"}) return "wxyz";
  return {};
}

bool is_xyz(const Names& names) {
  return names == Names{"x", "y", "z"};
}

// What a kind is in, whichever body's; empty: the kind does not say.
Names units_of(const std::string& kind, const std::string& quaternion) {
  static const std::map<std::string, Names, std::less<>> kUnits{{"state/body/position", {"m"}},
                                                                {"state/body/velocity", {"m/s, rad/s"}},
                                                                {"state/body/acceleration", {"m/s2, rad/s2"}},
                                                                {"state/body/linear_velocity", {"m/s"}},
                                                                {"state/body/angular_velocity", {"rad/s"}},
                                                                {"state/body/linear_acceleration", {"m/s2"}},
                                                                {"state/body/angular_acceleration", {"rad/s2"}},
                                                                {"state/wrench", {"N, Nm"}}};
  Names orders = quaternion.empty() ? Names{"xyzw", "wxyz"} : Names{quaternion};
  if (kind == "state/body/rotation") return orders;
  if (kind == "state/body/pose") {
    Names units;
    for (const std::string& order : orders) units.push_back("m, " + order);
    return units;
  }
  const auto found = kUnits.find(kind);
  return found == kUnits.end() ? Names{} : found->second;
}

// Isaac Lab's names end in the frame; that of another body than the root has no name of its own.
std::string frame_of(const LeappTensor& tensor) {
  const std::string quantity = quantity_of(tensor.connection);
  if (!tensor.kind.starts_with("state/") || tensor.kind.starts_with("state/joint/")) return {};
  if (quantity.ends_with("_w")) return "world";
  if (!quantity.ends_with("_b")) return {};
  return quantity.starts_with("root_") || quantity == "projected_gravity_b" ? "base" : "body";
}

Meaning meaning_of_body(const LeappTensor& tensor, const Names& names) {
  const std::string quantity = quantity_of(tensor.connection);
  if (tensor.connection.empty()) return Meaning::unsaid;
  if (tensor.kind == "state/body/rotation")
    return is_of_root(quantity, "_quat_w") && names.size() == 4 ? Meaning::base_orientation : Meaning::sensor;
  if (tensor.kind == "state/body/angular_velocity" && is_of_root(quantity, "_ang_vel_b"))
    return is_xyz(names) ? Meaning::base_angular_velocity : Meaning::unsaid;
  if (tensor.kind == "state/body/linear_velocity" && is_of_root(quantity, "_lin_vel_b"))
    return is_xyz(names) ? Meaning::base_linear_velocity : Meaning::unsaid;
  return Meaning::sensor;
}

Meaning meaning_of(const LeappTensor& tensor, const Names& names) {
  if (tensor.kind == "state/joint/position") return Meaning::joint_position;
  if (tensor.kind == "state/joint/velocity") return Meaning::joint_velocity;
  if (tensor.kind == "state/joint/effort") return Meaning::joint_torque;
  if (tensor.kind.starts_with("command/")) return Meaning::command;
  if (tensor.kind.starts_with("state/body/")) return meaning_of_body(tensor, names);
  if (tensor.kind == "state/vector3d" && quantity_of(tensor.connection) == "projected_gravity_b" &&
      (names.empty() || is_xyz(names)))
    return Meaning::projected_gravity;
  if (tensor.kind == "state/wrench" || tensor.kind == "state/vector3d") return Meaning::sensor;
  return Meaning::unsaid;
}

std::optional<CommandField> field_of(const std::string& kind) {
  if (kind == "target/joint/position") return CommandField::q;
  if (kind == "target/joint/velocity") return CommandField::dq;
  if (kind == "target/joint/torques" || kind == "target/joint/effort") return CommandField::tau_ff;
  if (kind == "kp") return CommandField::kp;
  if (kind == "kd") return CommandField::kd;
  return std::nullopt;
}

DescribedInput describe_input(const LeappBundle& bundle, const LeappPort& port) {
  const LeappTensor& tensor = tensor_at(bundle, port, true);
  DescribedInput input;
  input.name = bundle.nodes.size() == 1 ? port.tensor : port.node + "/" + port.tensor;
  input.width = elements(tensor);
  const Names names = names_of_values(tensor, input.width);
  input.meaning = tensor.temporal ? Meaning::unsaid : meaning_of(tensor, names);
  input.word = tensor.kind.empty() ? "no kind" : tensor.kind;
  if (tensor.kind.starts_with("state/joint/")) input.joints = names;
  if (tensor.kind == "state/body/rotation") input.quaternion = quaternion_order(names);
  if (!tensor.temporal) input.units = units_of(tensor.kind, input.quaternion);
  input.frame = frame_of(tensor);
  if (input.meaning == Meaning::command) input.elements = names;
  return input;
}

std::string nameless(const std::string& tensor, std::size_t width) {
  return fmt::format("{}: no names for {} values; which is which the file does not say", tensor, width);
}

DescribedOutput describe_output(const LeappBundle& bundle, const LeappPort& port, DescribedPolicy& policy) {
  const LeappTensor& tensor = tensor_at(bundle, port, false);
  DescribedOutput output;
  output.name = bundle.nodes.size() == 1 ? port.tensor : port.node + "/" + port.tensor;
  output.field = field_of(tensor.kind);
  output.word = tensor.kind;
  if (tensor.temporal && tensor.time_axis) {
    output.steps = static_cast<std::size_t>(tensor.shape[*tensor.time_axis]);
    // Steps one after the other: every axis before time's has one entry.
    for (std::size_t axis = 0; axis < *tensor.time_axis; ++axis)
      if (tensor.shape[axis] != 1) output.field.reset();
  } else if (tensor.temporal) {
    policy.notes.push_back(fmt::format("{}: which axis is time the file does not say", tensor.name));
    output.field.reset();
  }
  if (tensor.temporal_period_ms) output.step_period = {std::llround(*tensor.temporal_period_ms * 1e6)};
  output.width = elements(tensor) / std::max<std::size_t>(output.steps, 1);
  output.joints = names_of_values(tensor, output.width);
  if (output.field && output.width > 1 && tensor.element_names.empty())
    policy.notes.push_back(nameless(tensor.name, output.width));
  return output;
}

}  // namespace

DescribedPolicy describe_leapp(const LeappBundle& bundle) {
  DescribedPolicy policy;
  policy.format = "LEAPP bundle";
  policy.notes = bundle.notes;
  if (bundle.frequency_hz && *bundle.frequency_hz > 0) policy.period = {std::llround(1e9 / *bundle.frequency_hz)};
  for (const LeappPort& port : bundle.inputs) {
    const DescribedInput& input = policy.inputs.emplace_back(describe_input(bundle, port));
    const LeappTensor& tensor = tensor_at(bundle, port, true);
    const bool needs_names = input.meaning == Meaning::command || tensor.kind.starts_with("state/joint/");
    if (needs_names && input.width > 1 && tensor.element_names.empty())
      policy.notes.push_back(nameless(input.name, input.width));
  }
  for (const LeappPort& port : bundle.outputs) policy.outputs.push_back(describe_output(bundle, port, policy));
  if (bundle.articulation)
    policy.joints = {bundle.articulation->joint_names, bundle.articulation->stiffness, bundle.articulation->damping,
                     bundle.articulation->default_position};
  return policy;
}

}  // namespace takt::policy_host

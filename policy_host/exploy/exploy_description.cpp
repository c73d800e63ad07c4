// SPDX-License-Identifier: Apache-2.0
#include "policy_host/exploy/exploy_description.hpp"

#include <fmt/format.h>

#include <algorithm>
#include <array>
#include <cmath>
#include <functional>
#include <nlohmann/json.hpp>
#include <numeric>
#include <set>

#include "config/exported_name.hpp"

namespace takt::policy_host {
namespace {

using nlohmann::json;
using onnx_engine::Metadata;
using onnx_engine::TensorInfo;

constexpr const char* kStepCount = "ctx.step_count";

std::size_t elements(const TensorInfo& tensor) {
  return static_cast<std::size_t>(
      std::accumulate(tensor.shape.begin(), tensor.shape.end(), std::int64_t{1}, std::multiplies<>()));
}

std::vector<std::string> parts_of(const std::string& name) {
  std::vector<std::string> parts{""};
  for (const char c : name) {
    if (c == '.')
      parts.emplace_back();
    else
      parts.back() += c;
  }
  return parts;
}

class Reader {
 public:
  explicit Reader(const Metadata& metadata) : metadata_(metadata) {}

  DescribedPolicy read(std::span<const TensorInfo> inputs, std::span<const TensorInfo> outputs) {
    DescribedPolicy policy;
    policy.format = "exploy policy";
    policy.period = period(inputs);
    bases_ = value_of("base_names").value_or(json::object());
    for (const TensorInfo& tensor : inputs)
      if (const std::vector<std::string> parts = parts_of(tensor.name); is_of_imu(parts)) imus_.insert(parts[2]);
    for (const TensorInfo& tensor : inputs)
      if (!tensor.name.starts_with("memory.") && tensor.name != kStepCount) policy.inputs.push_back(input_of(tensor));
    for (const TensorInfo& tensor : outputs)
      if (tensor.name.starts_with("output.")) policy.outputs.push_back(output_of(tensor, policy.joints));
    return policy;
  }

 private:
  // Throws json::exception where it is none.
  [[nodiscard]] std::optional<json> value_of(const std::string& key) const {
    const auto found = std::ranges::find(metadata_, key, &Metadata::value_type::first);
    if (found == metadata_.end()) return std::nullopt;
    return json::parse(found->second);
  }

  // `update_rate` is that of the simulation's steps. A file with a step count decides by it which of them infer; one
  // without does so every time, and is to be called every `decimation` steps.
  [[nodiscard]] Duration period(std::span<const TensorInfo> inputs) const {
    const auto number = [this](const char* key) {
      const auto said = value_of(key);
      return said && said->is_number() ? said->get<double>() : 0.0;
    };
    const double rate = number("update_rate");
    if (!(rate > 0)) return {};
    const bool counts = std::ranges::find(inputs, kStepCount, &TensorInfo::name) != inputs.end();
    return {std::llround(1e9 / rate * (counts ? 1.0 : std::max(number("decimation"), 1.0)))};
  }

  [[nodiscard]] std::vector<std::string> joints_of(const std::string& group, const char* key) const {
    const auto said = value_of(group);
    return said && said->contains(key) ? said->at(key).get<std::vector<std::string>>() : std::vector<std::string>{};
  }

  static bool is_of_imu(const std::vector<std::string>& parts) {
    return parts.size() == 4 && parts[0] == "sensor" && parts[1] == "imu";
  }

  [[nodiscard]] bool is_robots_imu(const std::string& imu) const {
    if (imus_.size() == 1) return true;
    return bases_.is_object() && std::ranges::any_of(bases_, [&](const json& base) { return base == imu; });
  }

  [[nodiscard]] bool is_base(const std::string& articulation, const std::string& body) const {
    return bases_.is_object() && bases_.contains(articulation) && bases_.at(articulation) == body;
  }

  void read_object(const std::vector<std::string>& parts, DescribedInput& input) const {
    const std::string& quantity = parts[3];
    if (parts[2] == "joints") {
      input.joints = joints_of(fmt::format("obj.{}.joints", parts[1]), "joint_names");
      input.meaning = quantity == "pos"   ? Meaning::joint_position
                      : quantity == "vel" ? Meaning::joint_velocity
                                          : Meaning::unsaid;
      return;
    }
    read_motion(quantity, parts[2], is_base(parts[1], parts[2]), input);
  }

  // Of a body or an IMU, `of_base`: the base's own.
  static void read_motion(const std::string& quantity, const std::string& body, bool of_base, DescribedInput& input) {
    input.meaning = Meaning::sensor;
    input.frame = of_base ? "base" : body;
    if (quantity == "w_Q_b") {
      input.quaternion = "wxyz";
      input.units = {"wxyz"};
      input.frame = "world";
      if (of_base) input.meaning = Meaning::base_orientation;
    } else if (quantity == "pos_b_rt_w_in_w") {
      input.units = {"m"};
      input.frame = "world";
    } else if (quantity == "ang_vel_b_rt_w_in_b") {
      input.units = {"rad/s"};
      if (of_base) input.meaning = Meaning::base_angular_velocity;
    } else if (quantity == "lin_vel_b_rt_w_in_b") {
      input.units = {"m/s"};
      if (of_base) input.meaning = Meaning::base_linear_velocity;
    } else {
      input.frame.clear();
    }
  }

  void read_command(const std::string& name, const std::vector<std::string>& parts, DescribedInput& input) const {
    input.meaning = Meaning::command;
    const auto said = value_of(name);
    if (parts[1] == "se2_velocity" && input.width == 3) {
      input.elements = {"lin_vel_x", "lin_vel_y", "ang_vel_z"};
      if (!said || !said->contains("ranges") || !said->at("ranges").is_object()) return;
      for (const std::string& element : input.elements)
        input.ranges.push_back(said->at("ranges").at(element).get<std::pair<double, double>>());
    }
    if (parts[1] == "float" && said && said->contains("range") && said->at("range").is_array())
      input.ranges.push_back(said->at("range").get<std::pair<double, double>>());
    if (parts[1] == "joint_pos") input.elements = joints_of(name, "joint_names");
  }

  [[nodiscard]] DescribedInput input_of(const TensorInfo& tensor) const {
    DescribedInput input;
    input.name = input.word = tensor.name;
    input.width = elements(tensor);
    const std::vector<std::string> parts = parts_of(tensor.name);
    if (parts.size() == 4 && parts[0] == "obj") read_object(parts, input);
    if (parts.size() == 3 && parts[0] == "cmd") read_command(tensor.name, parts, input);
    if (parts.size() >= 3 && parts[0] == "sensor") input.meaning = Meaning::sensor;
    if (is_of_imu(parts)) read_motion(parts[3], parts[2], is_robots_imu(parts[2]), input);
    if (parts.size() == 4 && parts[1] == "ray_caster" && parts[3] == "height") input.units = {"m"};
    return input;
  }

  [[nodiscard]] DescribedOutput output_of(const TensorInfo& tensor, DescribedJoints& gains) const {
    DescribedOutput output;
    output.name = output.word = tensor.name;
    output.width = elements(tensor);
    const std::vector<std::string> parts = parts_of(tensor.name);
    if (parts.size() != 4 || parts[1] != "joint_targets") return output;
    if (parts[3] == "pos") output.field = CommandField::q;
    if (parts[3] == "vel") output.field = CommandField::dq;
    if (parts[3] == "effort") output.field = CommandField::tau_ff;
    const std::string group = "output.joint_targets." + parts[2];
    output.joints = joints_of(group, "names");
    if (const auto said = value_of(group); said && said->contains("stiffness") && said->contains("damping")) {
      gains.joints = output.joints;
      gains.stiffness = said->at("stiffness").get<std::vector<double>>();
      gains.damping = said->at("damping").get<std::vector<double>>();
    }
    return output;
  }

  const Metadata& metadata_;
  json bases_;
  std::set<std::string> imus_;  // by name
};

// Nothing: all of them are names.
std::string unfit_name(const DescribedPolicy& policy) {
  std::vector<std::string> names = policy.joints.joints;
  const auto add = [&](const auto& said) {
    names.push_back(said.name);
    names.insert(names.end(), said.joints.begin(), said.joints.end());
  };
  for (const DescribedInput& input : policy.inputs) {
    add(input);
    names.insert(names.end(), input.elements.begin(), input.elements.end());
  }
  for (const DescribedOutput& output : policy.outputs) add(output);
  for (const std::string& name : names)
    if (std::string why = config::why_no_name(name); !why.empty()) return why;
  return {};
}

// Lists that stand for joints have one entry each, as many as values.
std::string inconsistent(const DescribedPolicy& policy) {
  const auto differs = [](const auto& list, std::size_t count) { return !list.empty() && list.size() != count; };
  for (const DescribedInput& input : policy.inputs)
    if (differs(input.joints, input.width) || differs(input.ranges, input.width) ||
        differs(input.elements, input.width) ||
        std::ranges::any_of(input.ranges, [](const auto& range) { return range.first > range.second; }))
      return input.name;
  for (const DescribedOutput& output : policy.outputs)
    if (differs(output.joints, output.width)) return output.name;
  const std::size_t joints = policy.joints.joints.size();
  if (differs(policy.joints.stiffness, joints) || differs(policy.joints.damping, joints)) return "output.joint_targets";
  return {};
}

}  // namespace

std::expected<std::optional<DescribedPolicy>, std::string> describe_exploy(const Metadata& metadata,
                                                                           std::span<const TensorInfo> inputs,
                                                                           std::span<const TensorInfo> outputs) {
  if (std::ranges::find(metadata, "exploy_version", &Metadata::value_type::first) == metadata.end())
    return std::nullopt;
  try {
    DescribedPolicy policy = Reader(metadata).read(inputs, outputs);
    if (const std::string why = unfit_name(policy); !why.empty())
      return std::unexpected(fmt::format("metadata or tensors: {}; rename it and export the policy again", why));
    if (const std::string name = inconsistent(policy); !name.empty())
      return std::unexpected(
          fmt::format("metadata of {}: another number of entries than values, or a range whose ends are exchanged; "
                      "export the policy "
                      "again",
                      name));
    return policy;
  } catch (const json::exception&) {
    return std::unexpected("exploy's metadata is not the JSON that it should be; export the policy again");
  }
}

}  // namespace takt::policy_host

// SPDX-License-Identifier: Apache-2.0
#include "policy_host/leapp/leapp_bundle.hpp"

#include <fmt/format.h>

#include <algorithm>
#include <array>
#include <charconv>
#include <cmath>

#include "config/document.hpp"
#include "config/exported_name.hpp"

namespace takt::policy_host {
namespace {

using config::Entry;
using config::Node;
using config::Problems;
using Kind = config::Node::Kind;

constexpr std::string_view kTimeAxis = "__temporal_axis__";
constexpr std::int64_t kMostValues = 1 << 28;  // of a tensor: 1 GiB

const LeappTensor* find_tensor(const std::vector<LeappTensor>& tensors, std::string_view name) {
  const auto found = std::ranges::find(tensors, name, &LeappTensor::name);
  return found == tensors.end() ? nullptr : &*found;
}

class Reader {
 public:
  explicit Reader(Problems& problems) : problems_(problems) {}

  LeappBundle read(const Node& root) {
    if (const Node* models = need(root, "models", Kind::map)) {
      for (const Entry& entry : models->entries) bundle_.nodes.push_back(read_node(entry));
    }
    if (const Node* pipeline = need(root, "pipeline", Kind::map)) read_pipeline(*pipeline);
    if (const Node* system = root.find("system information"))
      bundle_.version = name_of(system->find("leapp config version"), "leapp config version");
    if (const Node* agile = root.find("agile")) read_articulation(*agile);
    note_unread(root, "the file", std::array<std::string_view, 4>{"models", "pipeline", "system information", "agile"});
    check_inputs(root);
    return std::move(bundle_);
  }

 private:
  const Node* need(const Node& map, std::string_view key, Kind kind) {
    const Node* node = map.find(key);
    if (node && node->kind == kind) return node;
    problems_.add(
        node ? node->place : map.place,
        fmt::format("`{}` is missing, or not {}; is this the YAML of a LEAPP bundle?", key, config::kind_name(kind)));
    return nullptr;
  }

  static std::string text_of(const Node* node) { return node && node->kind == Kind::scalar ? node->text : ""; }

  void refuse_unfit(const Node& node, std::string_view key) {
    if (const std::string why = config::why_no_name(node.text); !why.empty())
      problems_.add(node.place, fmt::format("{} {}", key, why));
  }

  // A name that the file need not give; "": it does not.
  std::string name_of(const Node* node, std::string_view key) {
    std::string text = text_of(node);
    if (!text.empty()) refuse_unfit(*node, key);
    return text;
  }

  std::string need_name(const Node& map, std::string_view key) {
    const Node* const node = need(map, key, Kind::scalar);
    if (node) refuse_unfit(*node, key);
    return text_of(node);
  }

  std::vector<std::string> names_of(const Node& list, std::string_view key) {
    std::vector<std::string> names;
    for (const Node& item : list.items) {
      refuse_unfit(item, key);
      names.push_back(item.text);
    }
    return names;
  }

  template <class Number>
  std::optional<Number> number(const Node* node) {
    if (!node || node->kind == Kind::null) return std::nullopt;
    Number value{};
    const std::string& text = node->text;
    const auto [end, error] = std::from_chars(text.data(), text.data() + text.size(), value);
    const bool read = node->kind == Kind::scalar && error == std::errc() && end == text.data() + text.size();
    if (read && std::isfinite(static_cast<double>(value))) return value;
    problems_.add(node->place, fmt::format("'{}' is not a number; export the bundle again", text));
    return std::nullopt;
  }

  std::optional<double> positive(const Node* node, std::string_view key) {
    const auto value = number<double>(node);
    if (!value || *value > 0) return value;
    problems_.add(node->place, fmt::format("{} is {}, and must be above 0; export the bundle again", key, node->text));
    return std::nullopt;
  }

  std::vector<std::int64_t> shape_of(const Node& list) {
    std::vector<std::int64_t> shape;
    std::int64_t values = 1;
    for (const Node& item : list.items) {
      const std::int64_t size = number<std::int64_t>(&item).value_or(1);
      const bool fits = size >= 1 && size <= kMostValues / values;
      if (!fits)
        problems_.add(item.place, fmt::format("a shape that cannot be: {} here; export the bundle again", size));
      shape.push_back(fits ? size : 1);
      values *= shape.back();
    }
    return shape;
  }

  void note_unread(const Node& map, const std::string& where, const auto& known) {
    for (const Entry& entry : map.entries) {
      if (std::ranges::find(known, entry.key.text) == known.end()) {
        refuse_unfit(entry.key, where);
        bundle_.notes.push_back(fmt::format("{}: `{}` is not read", where, entry.key.text));
      }
    }
  }

  LeappNode read_node(const Entry& entry) {
    LeappNode node;
    node.name = entry.key.text;
    refuse_unfit(entry.key, "models");
    if (const Node* inputs = need(entry.value, "inputs", Kind::sequence)) node.inputs = read_tensors(*inputs);
    if (const Node* outputs = need(entry.value, "outputs", Kind::sequence)) node.outputs = read_tensors(*outputs);
    if (const Node* parameters = need(entry.value, "parameters", Kind::map)) {
      node.model_path = need_name(*parameters, "model_path");
      node.backend = need_name(*parameters, "backend");
      node.sha256 = name_of(parameters->find("sha256sum"), "sha256sum");
      node.md5 = name_of(parameters->find("md5sum"), "md5sum");
      node.opset = number<int>(parameters->find("opset_version"));
      note_unread(*parameters, node.name,
                  std::array<std::string_view, 6>{"model_path", "backend", "sha256sum", "md5sum", "opset_version",
                                                  "tensorrt_compatible"});
    }
    return node;
  }

  std::vector<LeappTensor> read_tensors(const Node& list) {
    std::vector<LeappTensor> tensors;
    for (const Node& item : list.items) tensors.push_back(read_tensor(item));
    return tensors;
  }

  LeappTensor read_tensor(const Node& item) {
    LeappTensor tensor;
    tensor.name = need_name(item, "name");
    tensor.dtype = need_name(item, "dtype");
    if (const Node* shape = need(item, "shape", Kind::sequence)) tensor.shape = shape_of(*shape);
    tensor.kind = name_of(item.find("kind"), "kind");
    tensor.connection = name_of(item.find("isaaclab_connection"), "isaaclab_connection");
    tensor.temporal_period_ms = positive(item.find("temporal_period_ms"), "temporal_period_ms");
    if (const Node* names = item.find("element_names")) read_names(*names, tensor);
    note_unread(item, tensor.name,
                std::array<std::string_view, 8>{"name", "dtype", "shape", "type", "kind", "element_names",
                                                "temporal_period_ms", "isaaclab_connection"});
    return tensor;
  }

  void read_names(const Node& dimensions, LeappTensor& tensor) {
    // A flat list names one dimension.
    const bool flat = !dimensions.items.empty() && std::ranges::all_of(dimensions.items, [](const Node& name) {
      return name.kind == Kind::scalar && name.text != kTimeAxis;
    });
    if (flat) return name_dimension(dimensions, tensor);
    for (std::size_t i = 0; i < dimensions.items.size(); ++i) {
      const Node& dimension = dimensions.items[i];
      const bool wrapped = dimension.items.size() == 1 && dimension.items.front().text == kTimeAxis;
      if (dimension.text == kTimeAxis || wrapped) {
        tensor.temporal = true;
        if (dimensions.items.size() == tensor.shape.size()) tensor.time_axis = i;
      } else if (dimension.kind == Kind::sequence) {
        name_dimension(dimension, tensor);
      }
    }
  }

  void name_dimension(const Node& dimension, LeappTensor& tensor) {
    std::vector<std::string> names = names_of(dimension, "element_names");
    const auto size = static_cast<std::int64_t>(names.size());
    if (std::ranges::find(tensor.shape, size) == tensor.shape.end()) {
      bundle_.notes.push_back(fmt::format("{}: {} names for {} values; which is which the file does not say",
                                          tensor.name, size, tensor.shape.empty() ? 1 : tensor.shape.back()));
    }
    tensor.element_names.push_back(std::move(names));
  }

  std::vector<double> numbers(const Node* list, std::size_t count) {
    std::vector<double> values;
    if (!list) return values;
    for (const Node& item : list->items) values.push_back(number<double>(&item).value_or(0));
    if (values.size() != count)
      problems_.add(list->place, fmt::format("{} values for {} joints; export the bundle again", values.size(), count));
    return values;
  }

  // One robot's; of several it is not said which is which.
  void read_articulation(const Node& agile) {
    const Node* all = agile.find("articulations");
    if (!all || all->entries.size() != 1) return;
    const Node& one = all->entries.front().value;
    LeappArticulation articulation;
    if (const Node* joints = one.find("joint_names")) articulation.joint_names = names_of(*joints, "joint_names");
    const std::size_t joints = articulation.joint_names.size();
    articulation.default_position = numbers(one.find("default_joint_pos"), joints);
    articulation.stiffness = numbers(one.find("default_joint_stiffness"), joints);
    articulation.damping = numbers(one.find("default_joint_damping"), joints);
    bundle_.articulation = std::move(articulation);
  }

  void read_pipeline(const Node& pipeline) {
    if (const Node* flow = pipeline.find("data_flow")) read_flows(*flow, bundle_.data_flow);
    const Node* feedback = pipeline.find("feedback_flow");
    if (!feedback) feedback = pipeline.find("feedback_connections");
    if (feedback) read_flows(*feedback, bundle_.feedback);
    bundle_.initial_values = name_of(pipeline.find("initial_values"), "initial_values");
    if (const Node* ports = need(pipeline, "inputs", Kind::map)) read_ports(*ports, bundle_.inputs, true);
    if (const Node* ports = need(pipeline, "outputs", Kind::map)) read_ports(*ports, bundle_.outputs, false);
    if (const Node* configs = pipeline.find("configs"))
      bundle_.frequency_hz = positive(configs->find("frequency"), "frequency");
    if (!bundle_.feedback.empty() && bundle_.initial_values.empty()) {
      bundle_.notes.push_back("the feedback's start values are not given");
    }
    note_unread(pipeline, "pipeline",
                std::array<std::string_view, 7>{"data_flow", "feedback_flow", "feedback_connections", "initial_values",
                                                "inputs", "outputs", "configs"});
  }

  const LeappTensor* tensor_at(const Node& node, const LeappPort& port, bool input) {
    const auto found = std::ranges::find(bundle_.nodes, port.node, &LeappNode::name);
    const LeappTensor* tensor =
        found == bundle_.nodes.end() ? nullptr : find_tensor(input ? found->inputs : found->outputs, port.tensor);
    if (!tensor) {
      problems_.add(node.place, fmt::format("model '{}' has no {} '{}'; export the bundle again", port.node,
                                            input ? "input" : "output", port.tensor));
    }
    return tensor;
  }

  // A tensor's name holds no slash, a node's may.
  static LeappPort port_of(const std::string& text) {
    const std::size_t slash = text.rfind('/');
    return slash == std::string::npos ? LeappPort{text, ""} : LeappPort{text.substr(0, slash), text.substr(slash + 1)};
  }

  void read_flows(const Node& flows, std::vector<LeappFlow>& into) {
    for (const Entry& entry : flows.entries) {
      refuse_unfit(entry.key, "flow");
      const LeappPort from = port_of(entry.key.text);
      const LeappTensor* source = tensor_at(entry.key, from, false);
      for (const Node& target : entry.value.items) {
        refuse_unfit(target, "flow");
        const LeappPort to = port_of(target.text);
        const LeappTensor* sink = tensor_at(target, to, true);
        if (source && sink && source->shape != sink->shape) {
          problems_.add(target.place, fmt::format("'{}' and '{}' differ in shape; export the bundle again",
                                                  entry.key.text, target.text));
        }
        into.push_back({from, to});
      }
    }
  }

  void read_ports(const Node& nodes, std::vector<LeappPort>& into, bool input) {
    for (const Entry& entry : nodes.entries) {
      refuse_unfit(entry.key, input ? "inputs" : "outputs");
      for (const Node& tensor : entry.value.items) {
        refuse_unfit(tensor, input ? "inputs" : "outputs");
        const LeappPort port{entry.key.text, tensor.text};
        if (tensor_at(tensor, port, input)) into.push_back(port);
      }
    }
  }

  void check_inputs(const Node& root) {
    for (const LeappNode& node : bundle_.nodes) {
      for (const LeappTensor& input : node.inputs) {
        const LeappPort port{node.name, input.name};
        auto feeds = std::ranges::count(bundle_.inputs, port);
        feeds += std::ranges::count(bundle_.data_flow, port, &LeappFlow::to);
        feeds += std::ranges::count(bundle_.feedback, port, &LeappFlow::to);
        if (feeds == 1) continue;
        problems_.add(root.place, fmt::format("input '{}' of model '{}' is fed {}; a value would have to be guessed",
                                              input.name, node.name, feeds == 0 ? "by nothing" : "more than once"));
      }
    }
  }

  Problems& problems_;
  LeappBundle bundle_;
};

}  // namespace

bool is_leapp_bundle(std::string_view text) {
  Problems ignored("");
  const Node root = config::read_document(text, config::Tags::read_as_data, ignored);
  return root.find("models") != nullptr && root.find("pipeline") != nullptr;
}

std::expected<LeappBundle, std::string> read_leapp_bundle(std::string_view text, const std::string& name_for_messages) {
  Problems problems(name_for_messages);
  const Node root = config::read_document(text, config::Tags::refuse, problems);
  if (problems.empty() && root.kind != Kind::map)
    problems.add(root.place, "is no map; is it the YAML of a LEAPP bundle?");
  if (!problems.empty()) return std::unexpected(problems.text());
  LeappBundle bundle = Reader(problems).read(root);
  if (!problems.empty()) return std::unexpected(problems.text());
  return bundle;
}

}  // namespace takt::policy_host

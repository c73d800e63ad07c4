// SPDX-License-Identifier: Apache-2.0
#include "policy_host/leapp/leapp_graph.hpp"

#include <fmt/format.h>

#include <algorithm>
#include <cctype>
#include <filesystem>
#include <optional>
#include <utility>

#include "config/document.hpp"
#include "config/load.hpp"
#include "config/sha256.hpp"
#include "policy_host/leapp/beside.hpp"
#include "policy_host/leapp/initial_values.hpp"
#include "policy_host/policy_tensors.hpp"

namespace takt::policy_host {
namespace {

namespace fs = std::filesystem;

using onnx_engine::TensorInfo;
using Problem = std::optional<std::string>;

class Loader {
 public:
  Loader(std::string file, LeappBundle bundle) : file_(std::move(file)), bundle_(std::move(bundle)) {}

  std::expected<NetworkGraph, std::string> load(const std::string& input, const std::string& output,
                                                const LoadNetwork& load) {
    for (const LeappNode& node : bundle_.nodes)
      if (const Problem problem = load_node(node, load)) return std::unexpected(*problem);
    if (const Problem problem = connect()) return std::unexpected(*problem);
    if (const Problem problem = start_feedback()) return std::unexpected(*problem);
    if (const Problem problem = choose_inputs(input)) return std::unexpected(*problem);
    if (const Problem problem = choose_outputs(output)) return std::unexpected(*problem);
    return std::move(graph_);
  }

 private:
  std::string refusal(const std::string& what) const { return fmt::format("{}: {}", file_, what); }

  Problem load_node(const LeappNode& node, const LoadNetwork& load) {
    const auto path = checked_model_file(file_, node);
    if (!path) return path.error();
    auto network = load(*path);
    if (!network) return network.error();
    if (!(*network)->lost_states().empty())
      return fmt::format(
          "{}: {} begins every inference from the same state, so its memory is lost between "
          "observations; export the network with its state as feedback",
          *path, (*network)->lost_states().front());
    if (auto problem = compare(node, "input", node.inputs, (*network)->inputs())) return problem;
    if (auto problem = compare(node, "output", node.outputs, (*network)->outputs())) return problem;
    graph_.networks.push_back(*std::move(network));
    return {};
  }

  Problem compare(const LeappNode& node, const char* what, const std::vector<LeappTensor>& said,
                  std::span<const TensorInfo> has) const {
    if (said.size() != has.size())
      return refusal(fmt::format("model {} has {} {}s, {} has {}; export the bundle again", node.name, said.size(),
                                 what, node.model_path, has.size()));
    for (const LeappTensor& tensor : said) {
      const auto found = std::ranges::find(has, tensor.name, &TensorInfo::name);
      const std::string called = fmt::format("{} {} of model {}", what, tensor.name, node.name);
      if (found == has.end())
        return refusal(fmt::format("{} is not in {}; export the bundle again", called, node.model_path));
      if (tensor.dtype != "float32")
        return refusal(fmt::format("{} is {}; only float32 is read", called, tensor.dtype));
      if (found->shape != tensor.shape)
        return refusal(fmt::format("{} has another shape in {}; export the bundle again", called, node.model_path));
    }
    return {};
  }

  // Precondition: the reader found the port.
  Port port_of(const LeappPort& port, bool input) const {
    const auto node =
        static_cast<std::size_t>(std::ranges::find(bundle_.nodes, port.node, &LeappNode::name) - bundle_.nodes.begin());
    const Network& network = *graph_.networks[node];
    const auto tensors = input ? network.inputs() : network.outputs();
    const auto found = std::ranges::find(tensors, port.tensor, &TensorInfo::name);
    return {node, static_cast<std::size_t>(found - tensors.begin())};
  }

  Problem connect() {
    for (const LeappFlow& flow : bundle_.data_flow) {
      const Port from = port_of(flow.from, false), to = port_of(flow.to, true);
      if (from.network >= to.network)
        return refusal(fmt::format("data_flow goes from {} back to {}, which stands before it; that is feedback",
                                   flow.from.node, flow.to.node));
      graph_.wiring.flows.push_back({from, to});
    }
    return {};
  }

  Problem start_feedback() {
    if (bundle_.feedback.empty()) return {};
    if (bundle_.initial_values.empty())
      return refusal(
          "has feedback and no initial_values: what it starts with would have to be guessed; export it "
          "again");
    const auto beside = path_beside(file_, "initial_values", bundle_.initial_values);
    if (!beside) return beside.error();
    const auto values = read_initial_values(*beside);
    if (!values) return values.error();
    for (const LeappFlow& flow : bundle_.feedback) {
      const Port from = port_of(flow.from, false), to = port_of(flow.to, true);
      const auto start = values->find(flow.to.node + "/" + flow.to.tensor);
      if (start == values->end() || start->second.shape != graph_.networks[to.network]->inputs()[to.tensor].shape)
        return refusal(fmt::format("{} has no start value of its shape for {}/{}; export the bundle again",
                                   bundle_.initial_values, flow.to.node, flow.to.tensor));
      graph_.wiring.states.push_back({from, to, start->second.values});
    }
    return {};
  }

  // One of `ports` by "tensor" or "node/tensor".
  std::expected<LeappPort, std::string> named(const std::vector<LeappPort>& ports, const std::string& name,
                                              const char* what) const {
    std::string all;
    const LeappPort* found = nullptr;
    for (const LeappPort& port : ports) {
      all += (all.empty() ? "" : ", ") + (bundle_.nodes.size() == 1 ? port.tensor : port.node + "/" + port.tensor);
      if (port.node + "/" + port.tensor != name && port.tensor != name) continue;
      if (found != nullptr)
        return std::unexpected(
            refusal(fmt::format("{} {} is one of two nodes'; write node/{} in policy.{}", what, name, name, what)));
      found = &port;
    }
    if (found != nullptr) return *found;
    return std::unexpected(refusal(fmt::format("no {0} named {1}, it has {2}; correct policy.{0}", what, name, all)));
  }

  Problem choose_inputs(const std::string& list) {
    std::vector<LeappPort> chosen = bundle_.inputs;
    if (!list.empty()) {
      chosen.clear();
      for (const std::string& name : split_names(list)) {
        const auto port = named(bundle_.inputs, name, "input");
        if (!port) return port.error();
        if (std::ranges::find(chosen, *port) != chosen.end())
          return refusal(fmt::format("input {} is named twice; correct policy.input", name));
        chosen.push_back(*port);
      }
    }
    for (const LeappPort& port : bundle_.inputs)
      if (std::ranges::find(chosen, port) == chosen.end())
        return refusal(
            fmt::format("input {} is bound to nothing; list it in policy.input, and give it a term in "
                        "policy.observation",
                        port.tensor));
    for (const LeappPort& port : chosen) graph_.wiring.observation.push_back(port_of(port, true));
    if (graph_.wiring.observation.empty()) return refusal("no input comes from the robot; this is no policy");
    return {};
  }

  Problem choose_outputs(const std::string& list) {
    if (list.empty() && !bundle_.outputs.empty())
      graph_.wiring.outputs.push_back(port_of(bundle_.outputs.front(), false));
    for (const std::string& name : split_names(list)) {
      const auto port = named(bundle_.outputs, name, "output");
      if (!port) return port.error();
      graph_.wiring.outputs.push_back(port_of(*port, false));
    }
    if (graph_.wiring.outputs.empty()) return refusal("no output goes to the robot; this is no policy");
    return {};
  }

  std::string file_;
  LeappBundle bundle_;
  NetworkGraph graph_;
};

}  // namespace

std::expected<std::string, std::string> checked_model_file(const std::string& bundle, const LeappNode& node) {
  if (node.backend != "onnx")
    return std::unexpected(
        fmt::format("{}: model {} is for backend {}, which is not run here; export it with backend "
                    "onnx",
                    bundle, node.name, node.backend));
  const auto beside = path_beside(bundle, "model_path", node.model_path);
  if (!beside) return std::unexpected(beside.error());
  const fs::path& path = *beside;
  std::error_code unreadable;
  if (!fs::is_regular_file(path, unreadable))
    return std::unexpected(fmt::format("{}: is not there; it stands beside {}", path.string(), bundle));
  if (node.sha256.empty())
    return std::unexpected(
        fmt::format("{}: has no sha256sum of {}, so which network that is cannot be checked; export it again", bundle,
                    node.model_path));
  const auto sha256 = config::file_sha256(path.string());
  if (!sha256) return std::unexpected(fmt::format("{}: {}", path.string(), sha256.error()));
  if (!std::ranges::equal(*sha256, node.sha256, {}, {}, [](unsigned char c) { return std::tolower(c); }))
    return std::unexpected(
        fmt::format("{}: sha256 {} is not the bundle's {}; export it again", path.string(), *sha256, node.sha256));
  return path.string();
}

std::expected<NetworkGraph, std::string> load_leapp_graph(const std::string& bundle, const std::string& input,
                                                          const std::string& output, const LoadNetwork& load) {
  const auto text = config::read_file(bundle);
  auto read = text ? read_leapp_bundle(*text, bundle) : std::unexpected(text.error());
  if (!read) return std::unexpected(read.error());
  return Loader(bundle, *std::move(read)).load(input, output, load);
}

}  // namespace takt::policy_host

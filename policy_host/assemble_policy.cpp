// SPDX-License-Identifier: Apache-2.0
#include "policy_host/assemble_policy.hpp"

#include <fmt/format.h>
#include <fmt/ranges.h>

#include <algorithm>
#include <optional>
#include <span>
#include <utility>
#include <vector>

#include "config/bundle_name.hpp"
#include "config/document.hpp"
#include "config/observation_shape.hpp"
#include "policy_host/binding.hpp"
#include "policy_host/exploy/exploy_description.hpp"
#include "policy_host/exporter_metadata.hpp"
#include "policy_host/flow/flow_policy.hpp"
#include "policy_host/leapp/leapp_bundle.hpp"
#include "policy_host/leapp/leapp_description.hpp"
#include "policy_host/leapp/leapp_graph.hpp"
#include "policy_host/metadata_comparison.hpp"
#include "policy_host/network_policy.hpp"
#include "policy_host/policy_tensors.hpp"

namespace takt::policy_host {
namespace {

using config::ObservationTerm;
using config::RobotConfig;
using onnx_engine::TensorInfo;

std::string outputs_named_in(const config::Policy& section) {
  std::string list;
  for (const config::NamedOutput& output : config::named_outputs(section))
    list += (list.empty() ? "" : ",") + output.name;
  return list;
}

std::expected<NetworkGraph, std::string> graph_of_file(const std::string& file, const std::string& input,
                                                       const std::string& output, const LoadNetwork& load) {
  auto network = load(file);
  if (!network) return std::unexpected(network.error());
  const auto tensors =
      assign_tensors({(*network)->inputs(), (*network)->outputs(), (*network)->lost_states()}, file, input, output);
  if (!tensors) return std::unexpected(tensors.error());
  NetworkGraph graph;
  for (const std::size_t part : tensors->observation) graph.wiring.observation.push_back({0, part});
  for (const std::size_t part : tensors->outputs) graph.wiring.outputs.push_back({0, part});
  if (tensors->time_step) graph.wiring.time_steps.push_back({0, *tensors->time_step});
  if (tensors->step_count) graph.wiring.step_counts.push_back({0, *tensors->step_count});
  for (const PolicyTensors::State& state : tensors->states)
    graph.wiring.states.push_back(
        {{0, state.output}, {0, state.input}, std::vector<float>((*network)->input(state.input).size())});
  graph.networks.push_back(*std::move(network));
  return graph;
}

// Where a policy has several inputs, each is filled by terms of its own.
std::expected<void, std::string> check_seams(const RobotConfig& robot, const NetworkGraph& graph) {
  std::span<const Port> inputs = graph.wiring.observation;
  if (robot.policy->sampler) inputs = inputs.first(inputs.size() - std::min<std::size_t>(inputs.size(), 2));  // its own
  if (inputs.size() < 2) return {};
  const auto& terms = robot.policy->observation;
  const bool remembers = std::ranges::any_of(terms, [](const ObservationTerm& term) { return term.history > 1; });
  if (robot.policy->history_layout == "by_time" && remembers)
    return std::unexpected(fmt::format("{}: policy.history_layout by_time would mix {} inputs of {}; write by_term",
                                       robot.file, inputs.size(), robot.policy->file));
  auto term = terms.begin();
  for (const Port& port : inputs) {
    const TensorInfo& tensor = graph.networks[port.network]->inputs()[port.tensor];
    const std::size_t size = graph.networks[port.network]->input(port.tensor).size();
    std::size_t filled = 0;
    for (; filled < size && term != terms.end(); ++term) filled += config::term_width(robot, *term) * term->history;
    if (filled == size) continue;
    return std::unexpected(
        fmt::format("{}: input {} has {} values, the terms for it {}; give it terms of its own, inputs in the order {}",
                    robot.policy->file, tensor.name, size, filled, robot.policy->input));
  }
  return {};
}

using Dimensions = std::vector<std::int64_t>;

// A tensor's dimensions without the leading ones that it has for a batch.
Dimensions without_ones(const Dimensions& shape, std::size_t least) {
  std::size_t ones = 0;
  while (shape.size() - ones > least && shape[ones] == 1) ++ones;
  return {shape.begin() + static_cast<std::ptrdiff_t>(ones), shape.end()};
}

// The dimensions that an input of this image alone may have: its history stacked, or as a dimension of its own.
std::vector<Dimensions> shapes_of(const config::ImageShape& image, const ObservationTerm& term) {
  const std::int64_t height = image.height, width = image.width, channels = image.channels, history = term.history;
  const bool by_channel = term.layout == config::ImageLayout::chw;
  std::vector<Dimensions> shapes;
  // Of one channel both layouts are the same bytes.
  if (by_channel || channels == 1) {
    shapes.push_back({channels * history, height, width});
    if (history > 1) shapes.push_back({history, channels, height, width});
  }
  if (!by_channel || channels == 1) {
    shapes.push_back({height * history, width, channels});
    if (history > 1) shapes.push_back({history, height, width, channels});
  }
  return shapes;
}

std::string text_of(const Dimensions& shape) {
  return fmt::format("{}", fmt::join(shape, " x "));
}

// An input that has an image's dimensions is filled by one image alone, which has the same; flat ones take anything.
std::expected<void, std::string> check_images(const RobotConfig& robot, const NetworkGraph& graph) {
  auto term = robot.policy->observation.begin();
  for (const Port& port : graph.wiring.observation) {
    const TensorInfo& tensor = graph.networks[port.network]->inputs()[port.tensor];
    const std::size_t size = graph.networks[port.network]->input(port.tensor).size();
    const auto first = term;
    for (std::size_t filled = 0; filled < size && term != robot.policy->observation.end(); ++term)
      filled += config::term_width(robot, *term) * term->history;
    const auto seen =
        std::find_if(first, term, [&](const ObservationTerm& one) { return config::image_of(robot, one) != nullptr; });
    const Dimensions flat = without_ones(tensor.shape, 1);
    if (seen == term || flat.size() < 2) continue;
    if (term - first != 1)
      return std::unexpected(fmt::format(
          "{}: input {} is {}, and sensor {}'s images are not all that fills it: give them an input of their "
          "own in policy.input",
          robot.policy->file, tensor.name, text_of(flat), seen->sensor));
    const std::vector<Dimensions> shapes = shapes_of(*config::image_of(robot, *seen), *seen);
    const auto fits = [&](const Dimensions& shape) { return without_ones(tensor.shape, shape.size()) == shape; };
    if (std::ranges::any_of(shapes, fits)) continue;
    return std::unexpected(fmt::format(
        "{}: input {} is {}, the images of sensor {} become {}: correct the term's layout or history, or the sensor's "
        "image, in {}",
        robot.policy->file, tensor.name, text_of(without_ones(tensor.shape, shapes.front().size())), seen->sensor,
        text_of(shapes.front()), robot.file));
  }
  return {};
}

// What else an answer has is as large as the action.
std::expected<void, std::string> check_outputs(const RobotConfig& robot, const NetworkGraph& graph) {
  const std::vector<Port>& outputs = graph.wiring.outputs;
  const std::size_t wanted = robot.policy->steps * config::outputs_per_step(robot);
  for (std::size_t i = 1; i < outputs.size(); ++i) {
    const Network& network = *graph.networks[outputs[i].network];
    const std::size_t size = network.output(outputs[i].tensor).size();
    if (size != wanted)
      return std::unexpected(fmt::format("{}: output {} has {} values, the action {}; correct policy.action in {}",
                                         robot.policy->file, network.outputs()[outputs[i].tensor].name, size, wanted,
                                         robot.file));
  }
  return {};
}

std::expected<void, std::string> add_references(const RobotConfig& robot, NetworkGraph& graph) {
  std::size_t at = 0;
  for (const ObservationTerm& term : robot.policy->observation) {
    const std::size_t width = config::term_width(robot, term) * term.history;
    if (term.kind == config::TermKind::motion_reference) {
      const Network& network = *graph.networks.back();
      const auto found = std::ranges::find(network.outputs(), term.output, &TensorInfo::name);
      const auto index = static_cast<std::size_t>(found - network.outputs().begin());
      if (found == network.outputs().end() || network.output(index).size() != width)
        return std::unexpected(fmt::format(
            "{}: has no output {} of {} values for the term motion_reference; correct policy.observation in {}",
            robot.policy->file, term.output, width, robot.file));
      graph.wiring.references.push_back({{graph.networks.size() - 1, index}, at});
    }
    at += width;
  }
  return {};
}

// What the exporter of an ONNX file left in it, whatever the file is called and whichever engine runs it. Nothing: no
// ONNX file.
std::optional<onnx_engine::Metadata> metadata_in(const std::string& file) {
  auto metadata = onnx_engine::read_metadata(file);
  if (!metadata) return std::nullopt;
  return *std::move(metadata);
}

// Against what the exporter says of inputs and outputs, each by name.
std::expected<void, std::string> check_described(const RobotConfig& robot, const NetworkGraph& graph) {
  const std::string& file = robot.policy->file;
  if (config::names_bundle(file)) {
    const auto text = config::read_file(file);
    const auto bundle = text ? read_leapp_bundle(*text, file) : std::unexpected(text.error());
    if (!bundle) return std::unexpected(bundle.error());
    return check_binding(describe_leapp(*bundle), robot);
  }
  const auto metadata = metadata_in(file);
  if (!metadata) return {};
  const Network& network = *graph.networks.front();
  const auto described = describe_exploy(*metadata, network.inputs(), network.outputs());
  if (!described) return std::unexpected(fmt::format("{}: {}", file, described.error()));
  if (*described) {
    if (auto fine = check_binding(**described, robot); !fine) return fine;
  }
  const auto lists = read_exporter_metadata(*metadata);
  if (!lists) return std::unexpected(fmt::format("{}: {}", file, lists.error()));
  if (const auto agrees = compare_metadata(*lists, robot); !agrees) return std::unexpected(agrees.error());
  return {};
}

}  // namespace

std::expected<std::unique_ptr<Policy>, std::string> assemble_policy(const RobotConfig& robot, const LoadNetwork& load) {
  const config::Policy& section = *robot.policy;
  auto graph = config::names_bundle(section.file)
                   ? load_leapp_graph(section.file, network_input(section), outputs_named_in(section), load)
                   : graph_of_file(section.file, network_input(section), outputs_named_in(section), load);
  if (!graph) return std::unexpected(graph.error());
  if (const auto fine = check_seams(robot, *graph); !fine) return std::unexpected(fine.error());
  if (const auto fine = check_images(robot, *graph); !fine) return std::unexpected(fine.error());
  if (const auto fine = check_outputs(robot, *graph); !fine) return std::unexpected(fine.error());
  if (const auto fine = add_references(robot, *graph); !fine) return std::unexpected(fine.error());
  if (const auto fine = check_described(robot, *graph); !fine) return std::unexpected(fine.error());
  return with_sampler(robot, make_network_policy(std::move(graph->networks), std::move(graph->wiring)));
}

std::expected<std::unique_ptr<Policy>, std::string> load_network_policy(const std::string& file,
                                                                        const std::string& input,
                                                                        const std::string& output,
                                                                        const LoadNetwork& load) {
  auto graph = graph_of_file(file, input, output, load);
  if (!graph) return std::unexpected(graph.error());
  return make_network_policy(std::move(graph->networks), std::move(graph->wiring));
}

}  // namespace takt::policy_host

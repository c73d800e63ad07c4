// SPDX-License-Identifier: Apache-2.0
#include "lab/policy_trial/policy_trial.hpp"

#include <fmt/format.h>

#include <utility>
#include <vector>

#include "config/bundle_name.hpp"
#include "config/document.hpp"
#include "lab/policy_trial/judging_network.hpp"
#include "policy_host/assemble_policy.hpp"
#include "policy_host/engines/load_policy.hpp"
#include "policy_host/exploy/exploy_description.hpp"
#include "policy_host/leapp/leapp_bundle.hpp"
#include "policy_host/leapp/leapp_graph.hpp"
#include "policy_host/policy_tensors.hpp"

namespace takt::policy_trial {
namespace {

namespace fs = std::filesystem;

using onnx_engine::TensorInfo;
using Loaded = std::expected<std::unique_ptr<policy_host::Network>, std::string>;
using Whole = std::expected<WholePolicy, std::string>;

std::size_t size_of(const TensorInfo& tensor) {
  std::size_t size = 1;
  for (const std::int64_t dimension : tensor.shape) size *= static_cast<std::size_t>(dimension);
  return size;
}

std::string values_text(std::size_t observation, std::size_t actions, std::size_t states, bool state_inside) {
  std::string text = fmt::format("{}→{}", observation, actions);
  if (states > 0) text += fmt::format(", {} state{}", states, states == 1 ? "" : "s");
  if (state_inside) text += ", state inside";
  return text;
}

// All that an engine is told of a file without a robot.
config::RobotConfig robot_of(const fs::path& file, const std::string& library,
                             const std::vector<config::TensorShape>& shapes) {
  config::RobotConfig robot;
  config::Policy& policy = robot.policy.emplace();
  policy.file = file.string();
  config::Engine& engine = policy.engine.emplace();
  engine.library = file.extension() == ".pt" ? "" : library;
  engine.shapes = shapes;
  return robot;
}

policy_host::LoadNetwork by_auto(const TrialSetup& setup, std::vector<config::TensorShape> shapes = {}) {
  return [library = setup.library, shapes = std::move(shapes)](const fs::path& file) {
    return policy_host::load_network(robot_of(file, library, shapes), file);
  };
}

policy_host::LoadNetwork by_judge(const TrialSetup& setup, const policy_host::LoadNetwork& known) {
  return [&setup, known](const fs::path& file) -> Loaded {
    const auto network = known ? known(file) : Loaded(nullptr);
    return load_judging_network(*setup.judge, file, network ? network->get() : nullptr);
  };
}

// A sentence about a file, for where its name stands beside it; the others of its folder without that.
std::string without_name(std::string sentence, const fs::path& file) {
  const std::string prefix = file.string() + ": ", folder = file.parent_path().string() + "/";
  if (sentence.starts_with(prefix)) sentence.erase(0, prefix.size());
  for (std::size_t at = sentence.find(folder); at != std::string::npos; at = sentence.find(folder, at))
    sentence.erase(at, folder.size());
  return sentence;
}

// Takes what was loaded into the trial, and asks for the judge's where there is one.
template <class LoadJudge>
void take(Trial& trial, const fs::path& file, const TrialSetup& setup, Whole own, LoadJudge load_judge) {
  if (!own) {
    trial.refusal = without_name(own.error(), file);
    return;
  }
  trial.own = std::move(own->policy);
  trial.values = std::move(own->values);
  if (setup.judge == nullptr) return;
  Whole judge = load_judge();
  if (!judge) {
    trial.unjudged = without_name(judge.error(), file);
  } else if (judge->policy->input_size() != trial.own->input_size() ||
             judge->policy->output_size() != trial.own->output_size()) {
    trial.unjudged = fmt::format("its judge has {}: another network", judge->values);
  } else {
    trial.judge = std::move(judge->policy);
  }
}

// Whether the file is exploy's, and if so whether it says what it has to.
void look_at_metadata(Trial& trial, const fs::path& file) {
  const auto metadata = onnx_engine::read_metadata(file);
  if (!metadata) return;
  const auto network = onnx_engine::load(file);
  if (!network) return;
  const auto described = policy_host::describe_exploy(*metadata, network->inputs(), network->outputs());
  if (!described) trial.refusal = described.error();
}

void try_onnx(Trial& trial, const fs::path& file, const TrialSetup& setup) {
  const auto choice = policy_host::choose_engine(file);
  if (!choice) {
    trial.refusal = without_name(choice.error(), file);
    return;
  }
  trial.engine = choice->name;
  trial.why = choice->why;
  look_at_metadata(trial, file);
  if (!trial.refusal.empty()) return;
  const policy_host::LoadNetwork load = by_auto(setup);
  take(trial, file, setup, load_whole_policy(file.string(), load),
       [&] { return load_whole_policy(file.string(), by_judge(setup, load)); });
}

// Of the inputs that both have, by the ONNX file beside it.
std::vector<config::TensorShape> shapes_beside(const fs::path& onnx, const TrialSetup& setup) {
  std::vector<config::TensorShape> shapes;
  const auto network = by_auto(setup)(onnx);
  if (!network) return shapes;
  for (const TensorInfo& input : (*network)->inputs())
    shapes.push_back({input.name, {input.shape.begin(), input.shape.end()}});
  return shapes;
}

void try_torchscript(Trial& trial, const fs::path& file, const TrialSetup& setup) {
  trial.engine = "torchscript";
  const fs::path onnx = fs::path(file).replace_extension(".onnx");
  const bool beside = fs::exists(onnx);
  // Where the names differ, or the state is inside, the width that the file accepts is enough.
  Whole own = load_whole_policy(file.string(), by_auto(setup, shapes_beside(onnx, setup)), Outputs::actions);
  if (!own && beside) own = load_whole_policy(file.string(), by_auto(setup), Outputs::actions);
  take(trial, file, setup, std::move(own), [&]() -> Whole {
    if (!beside) return std::unexpected(fmt::format("no {} beside it to judge by", onnx.filename().string()));
    return load_whole_policy(onnx.string(), by_judge(setup, nullptr), Outputs::actions);
  });
}

Whole load_bundle(const fs::path& file, const policy_host::LeappBundle& bundle, const policy_host::LoadNetwork& load) {
  std::string outputs;
  for (const policy_host::LeappPort& port : bundle.outputs)
    outputs += (outputs.empty() ? "" : ",") + fmt::format("{}/{}", port.node, port.tensor);
  auto graph = policy_host::load_leapp_graph(file.string(), "", outputs, load);
  if (!graph) return std::unexpected(graph.error());
  const policy_host::Port actions = graph->wiring.outputs.front();
  std::size_t observation = 0;
  for (const policy_host::Port& port : graph->wiring.observation)
    observation += graph->networks[port.network]->input(port.tensor).size();
  std::string values = values_text(observation, graph->networks[actions.network]->output(actions.tensor).size(),
                                   graph->wiring.states.size(), false);
  return WholePolicy{policy_host::make_network_policy(std::move(graph->networks), std::move(graph->wiring)),
                     std::move(values)};
}

void choose_for_nodes(Trial& trial, const fs::path& file, const policy_host::LeappBundle& bundle) {
  for (const policy_host::LeappNode& node : bundle.nodes) {
    const auto model = policy_host::checked_model_file(file.string(), node);
    const auto choice = model ? policy_host::choose_engine(*model) : std::unexpected(model.error());
    if (!choice) {
      trial.refusal = without_name(choice.error(), file);
      return;
    }
    if (!trial.engine.contains(choice->name)) trial.engine += (trial.engine.empty() ? "" : " + ") + choice->name;
    if (trial.why.empty()) trial.why = choice->why;
  }
}

void try_bundle(Trial& trial, const fs::path& file, const TrialSetup& setup) {
  const auto text = config::read_file(file.string());
  const auto bundle = text ? policy_host::read_leapp_bundle(*text, file.string()) : std::unexpected(text.error());
  if (!bundle) {
    trial.refusal = without_name(bundle.error(), file);
    return;
  }
  choose_for_nodes(trial, file, *bundle);
  if (!trial.refusal.empty()) return;
  const policy_host::LoadNetwork load = by_auto(setup);
  take(trial, file, setup, load_bundle(file, *bundle, load),
       [&] { return load_bundle(file, *bundle, by_judge(setup, load)); });
}

}  // namespace

std::expected<WholePolicy, std::string> load_whole_policy(const std::string& file, const policy_host::LoadNetwork& load,
                                                          Outputs outputs) {
  auto network = load(file);
  if (!network) return std::unexpected(network.error());
  const policy_host::Network& loaded = **network;
  const auto tensors =
      policy_host::assign_tensors({loaded.inputs(), loaded.outputs(), loaded.lost_states()}, file, "", "");
  if (!tensors) return std::unexpected(tensors.error());
  std::string all;
  if (outputs == Outputs::all)
    for (const TensorInfo& output : loaded.outputs()) all += (all.empty() ? "" : ",") + output.name;
  std::size_t observation = 0;
  for (const std::size_t part : tensors->observation) observation += size_of(loaded.inputs()[part]);
  const std::size_t actions = size_of(loaded.outputs()[tensors->outputs.front()]);
  std::string values = values_text(observation, actions, tensors->states.size(), loaded.keeps_state());
  auto policy = policy_host::load_network_policy(
      file, "", all, [&network](const fs::path& /*file*/) -> Loaded { return std::move(*network); });
  if (!policy) return std::unexpected(policy.error());
  return WholePolicy{*std::move(policy), std::move(values)};
}

Trial try_policy(const fs::path& file, const TrialSetup& setup) {
  Trial trial;
  if (file.extension() == ".pt")
    try_torchscript(trial, file, setup);
  else if (config::names_bundle(file.string()))
    try_bundle(trial, file, setup);
  else
    try_onnx(trial, file, setup);
  return trial;
}

}  // namespace takt::policy_trial

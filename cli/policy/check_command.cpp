// SPDX-License-Identifier: Apache-2.0
// takt policy check: one policy file, in full, and whether it fits a robot.
#include <fmt/format.h>

#include <filesystem>
#include <memory>
#include <nlohmann/json.hpp>
#include <numeric>
#include <optional>
#include <span>

#include "cli/command.hpp"
#include "cli/json_line.hpp"
#include "config/bundle_name.hpp"
#include "config/document.hpp"
#include "config/load.hpp"
#include "config/observation_shape.hpp"
#include "config/printable.hpp"
#include "policy_host/binding.hpp"
#include "policy_host/bound_terms.hpp"
#include "policy_host/engines/load_policy.hpp"
#include "policy_host/exploy/exploy_description.hpp"
#include "policy_host/exporter_metadata.hpp"
#include "policy_host/fenced_load.hpp"
#include "policy_host/flow/flow_policy.hpp"
#include "policy_host/leapp/beside.hpp"
#include "policy_host/leapp/leapp_bundle.hpp"
#include "policy_host/leapp/leapp_description.hpp"
#include "policy_host/leapp/leapp_graph.hpp"
#include "policy_host/metadata_comparison.hpp"
#include "policy_host/onnx_engine/model.hpp"
#include "policy_host/onnx_policy.hpp"
#include "policy_host/policy_fit.hpp"

namespace takt::cli {
namespace {

using onnx_engine::TensorInfo;
using policy_host::OnnxReading;
using policy_host::PolicyTensors;

struct PolicyCheckOptions {
  std::string file, robot;
  bool json = false;
};

nlohmann::json tensor_json(const TensorInfo& info) {
  return {{"name", info.name}, {"shape", info.shape}};
}

// Everything that is known of the file: the one source of both outputs.
nlohmann::json policy_json(const std::string& file, const OnnxReading& reading) {
  const onnx_engine::Model& model = reading.model;
  const PolicyTensors& tensors = reading.tensors;
  nlohmann::json about{{"file", file}, {"opset", model.opset()}, {"operators", model.operators()}};
  about["observation"] = nlohmann::json::array();
  for (const std::size_t i : tensors.observation) about["observation"].push_back(tensor_json(model.inputs()[i]));
  about["state"] = nlohmann::json::array();
  for (const PolicyTensors::State& state : tensors.states) {
    nlohmann::json fed = tensor_json(model.inputs()[state.input]);
    fed["from"] = model.outputs()[state.output].name;
    about["state"].push_back(fed);
  }
  const std::optional<std::size_t> count = tensors.time_step ? tensors.time_step : tensors.step_count;
  about["time_step"] = count ? nlohmann::json(model.inputs()[*count].name) : nlohmann::json();
  about["actions"] = tensor_json(model.outputs()[tensors.outputs.front()]);
  about["external_data"] = nlohmann::json::array();
  for (const onnx_engine::ExternalFile& external : model.external_files()) {
    about["external_data"].push_back(
        {{"location", external.location}, {"bytes", external.bytes}, {"sha256", external.sha256}});
  }
  about["metadata"] = nlohmann::json::object();
  for (const auto& [key, value] : model.metadata()) about["metadata"][key] = value;
  return about;
}

std::string shortened(std::string text) {
  constexpr std::size_t longest = 100;
  for (char& c : text) {
    if (static_cast<unsigned char>(c) < ' ' || c == '\x7f') c = ' ';
  }
  if (text.size() > longest) text = text.substr(0, longest) + "...";
  return text;
}

std::string tensor_text(const nlohmann::json& tensor) {
  return fmt::format("{} {}", shortened(tensor["name"].get<std::string>()), tensor["shape"].dump());
}

void print_line(const char* what, const std::string& text) {
  fmt::print("{:<14} {}\n", what, text);
}

void print_policy(const nlohmann::json& about) {
  print_line("opset", std::to_string(about["opset"].get<int>()));
  std::string operators;
  for (const auto& [name, count] : about["operators"].items()) {
    operators += fmt::format("{}{} {}", operators.empty() ? "" : ", ", name, count.get<int>());
  }
  print_line("operators", operators);
  for (const auto& tensor : about["observation"]) print_line("observation", tensor_text(tensor));
  for (const auto& state : about["state"]) {
    print_line("state", fmt::format("{}, fed by {}, zeros at the start", tensor_text(state),
                                    shortened(state["from"].get<std::string>())));
  }
  if (!about["time_step"].is_null()) {
    print_line("time step", about["time_step"].get<std::string>() + ", inferences since the reset");
  }
  print_line("actions", tensor_text(about["actions"]));
  for (const auto& external : about["external_data"]) {
    print_line("external data",
               fmt::format("{}, {} bytes, sha256 {}", shortened(external["location"].get<std::string>()),
                           external["bytes"].get<std::uint64_t>(), external["sha256"].get<std::string>()));
  }
  for (const auto& [key, value] : about["metadata"].items()) {
    print_line("metadata", fmt::format("{}: {}", shortened(key), shortened(value.get<std::string>())));
  }
  if (about["rounded_to_3_decimals"].get<bool>()) {
    print_line("rounded", "the exporter's gains and poses have three decimals at most");
  }
}

Refusal policy_refused(const std::string& sentence) {
  return {config::kExitBadConfiguration, sentence};
}

// The robot whose policy `file` is to be; its file's own `policy.file` is not looked at.
std::expected<config::RobotConfig, Refusal> load_policys_robot(const PolicyCheckOptions& options) {
  auto robot = config::load(options.robot);
  if (!robot) return std::unexpected(policy_refused(robot.error()));
  if (const auto fine = policy_host::check_policy_section(*robot); !fine)
    return std::unexpected(policy_refused(fine.error()));
  robot->policy->file = options.file;
  return *std::move(robot);
}

// The policy by the robot file's engine, as the policy host would have it.
std::expected<std::unique_ptr<policy_host::Policy>, Refusal> load_for_robot(const config::RobotConfig& robot) {
  auto loaded = policy_host::load_fenced(robot, 1, policy_host::load_policy);
  if (!loaded) return std::unexpected(policy_refused(loaded.error()));
  return std::move(loaded->policies.front());
}

nlohmann::json fit_json(const config::RobotConfig& robot, const policy_host::Policy& policy) {
  return {{"name", robot.robot}, {"values_in", policy.input_size()}, {"values_out", policy.output_size()}};
}

std::vector<std::string> terms_and_action(std::span<const policy_host::FilledTensor> inputs,
                                          const config::RobotConfig& robot) {
  std::vector<std::string> lines = policy_host::bound_lines(inputs, robot);
  lines.push_back(policy_host::action_line(robot));
  return lines;
}

// A plugin does not say what its network's inputs are: where there are several, they are one here.
std::vector<std::string> bound_by_plugin(const config::RobotConfig& robot) {
  const policy_host::FilledTensor all{robot.policy->input.contains(',') ? "observation" : robot.policy->input,
                                      config::observation_width(robot)};
  return terms_and_action(std::span(&all, 1), robot);
}

std::vector<std::string> bound_by(const config::RobotConfig& robot, const OnnxReading& reading) {
  std::vector<policy_host::FilledTensor> inputs;
  for (const std::size_t i : reading.tensors.observation) {
    const TensorInfo& tensor = reading.model.inputs()[i];
    inputs.push_back({tensor.name, std::accumulate(tensor.shape.begin(), tensor.shape.end(), std::size_t{1},
                                                   [](std::size_t size, std::int64_t dimension) {
                                                     return size * static_cast<std::size_t>(dimension);
                                                   })});
  }
  return terms_and_action(inputs, robot);
}

// Joints' gains and poses that are others than an exporter says; numbers of single precision.
std::vector<std::string> differences_from(const policy_host::DescribedPolicy& said, const config::RobotConfig& robot) {
  constexpr double kSinglePrecision = 1e-5;
  return policy_host::joint_differences(said.joints, robot, kSinglePrecision, "the " + said.format);
}

// True of a file that only a plugin reads, or that goes to one by the robot file or by itself.
bool is_a_plugins(const config::RobotConfig& robot) {
  const std::string engine = robot.policy->engine.value_or(config::Engine{}).name;
  if (engine != "auto") return engine != "builtin";
  const auto choice = policy_host::choose_engine(robot.policy->file);
  return choice && choice->name != "builtin";
}

// What is said of a file that the built-in engine cannot load where no robot file says what else could.
Refusal not_by_built_in(const std::string& file, const std::string& sentence) {
  const auto choice = policy_host::choose_engine(file);
  if (!choice || choice->name == "builtin") return policy_refused(sentence);
  return policy_refused(
      fmt::format("{}; policy.engine auto gives it to {}: --robot FILE asks that", sentence, choice->name));
}

std::expected<nlohmann::json, Refusal> examine_policy(const PolicyCheckOptions& options) {
  std::optional<config::RobotConfig> robot;
  if (!options.robot.empty()) {
    auto loaded = load_policys_robot(options);
    if (!loaded) return std::unexpected(loaded.error());
    robot = *std::move(loaded);
  }
  const std::string input = robot ? policy_host::network_input(*robot->policy) : "";
  std::string output;
  if (robot)
    for (const config::NamedOutput& named : config::named_outputs(*robot->policy))
      output += (output.empty() ? "" : ",") + named.name;
  const auto reading = policy_host::read_onnx_policy(options.file, input, output);
  if (!reading && robot && is_a_plugins(*robot)) {
    const auto policy = load_for_robot(*robot);
    if (!policy) return std::unexpected(policy.error());
    return nlohmann::json{{"file", options.file},
                          {"engine", (*policy)->description()},
                          {"not_by_builtin", reading.error()},
                          {"bound", bound_by_plugin(*robot)},
                          {"robot", fit_json(*robot, **policy)}};
  }
  if (!reading) return std::unexpected(not_by_built_in(options.file, reading.error()));
  nlohmann::json about = policy_json(options.file, *reading);
  about["matrix_work"] = reading->model.matrix_work();
  about["engine"] = policy_host::is_quicker_elsewhere(reading->model)
                        ? "onnxruntime: " + policy_host::matrix_work_text(reading->model)
                        : "builtin";
  const auto metadata = policy_host::read_exporter_metadata(reading->model.metadata());
  if (!metadata) return std::unexpected(policy_refused(options.file + ": " + metadata.error()));
  about["rounded_to_3_decimals"] = metadata->rounded;
  const auto described =
      policy_host::describe_exploy(reading->model.metadata(), reading->model.inputs(), reading->model.outputs());
  if (!described) return std::unexpected(policy_refused(options.file + ": " + described.error()));
  about["bound"] = nlohmann::json::array();
  if (!robot) return about;
  const auto policy = load_for_robot(*robot);
  if (!policy) return std::unexpected(policy.error());
  about["engine"] = (*policy)->description();
  const auto differences = policy_host::compare_metadata(*metadata, *robot);
  if (!differences) return std::unexpected(policy_refused(differences.error()));
  about["differences"] = *differences;
  if (*described)
    for (const std::string& difference : differences_from(**described, *robot))
      about["differences"].push_back(difference);
  about["bound"] = bound_by(*robot, *reading);
  about["robot"] = fit_json(*robot, **policy);
  return about;
}

std::string ports_text(const std::vector<policy_host::LeappPort>& ports) {
  std::string text;
  for (const policy_host::LeappPort& port : ports) text += (text.empty() ? "" : ", ") + shortened(port.tensor);
  return text;
}

std::string kind_text(const policy_host::LeappTensor& tensor) {
  std::string text = fmt::format("{} {}", shortened(tensor.name), nlohmann::json(tensor.shape).dump());
  if (!tensor.kind.empty()) text += ", " + shortened(tensor.kind);
  if (tensor.temporal) text += ", a chunk";
  return text;
}

// The model of a node beside the bundle's YAML, where it is there: is it the file that was exported?
// With a robot, its engine decides whether it runs (check_bundle_for_robot).
std::expected<void, Refusal> check_model_file(const PolicyCheckOptions& options, const policy_host::LeappNode& node) {
  const std::string& bundle = options.file;
  const auto beside = policy_host::path_beside(bundle, "model_path", node.model_path);
  if (!beside) return std::unexpected(policy_refused(beside.error()));
  if (!std::filesystem::exists(*beside)) {
    print_line("model", fmt::format("{}: not there, so not checked", shortened(node.model_path)));
    return {};
  }
  const auto file = policy_host::checked_model_file(bundle, node);
  if (!file) return std::unexpected(policy_refused(file.error()));
  const auto model = onnx_engine::load(*file);
  if (!model && options.robot.empty())
    return std::unexpected(policy_refused(
        fmt::format("{}; so not by the built-in engine: --robot FILE asks the engine that FILE names", model.error())));
  print_line("model", fmt::format("{}: {} the built-in engine, sha256 as in the bundle", shortened(node.model_path),
                                  model ? "runs on" : "not by"));
  if (model && node.opset && *node.opset != model->opset())
    print_line("differs", fmt::format("{}: opset {}, the bundle says {}", shortened(node.model_path), model->opset(),
                                      *node.opset));
  return {};
}

// What each input is, and what a robot needs to have for it.
void print_described(const policy_host::DescribedPolicy& said) {
  for (const policy_host::DescribedInput& input : said.inputs) {
    std::string text = fmt::format("{}: {}", shortened(input.name), name(input.meaning));
    if (!input.quaternion.empty()) text += ", " + input.quaternion;
    if (!input.joints.empty()) text += fmt::format(", {} joints by name", input.joints.size());
    print_line("needs", text);
  }
  for (const std::string& note : said.notes) print_line("left open", shortened(note));
}

void print_bundle(const policy_host::LeappBundle& bundle) {
  for (const policy_host::LeappNode& node : bundle.nodes) {
    for (const policy_host::LeappTensor& tensor : node.inputs) print_line("input", kind_text(tensor));
    for (const policy_host::LeappTensor& tensor : node.outputs) print_line("output", kind_text(tensor));
  }
  print_line("of the robot", ports_text(bundle.inputs));
  print_line("to the robot", ports_text(bundle.outputs));
  for (const policy_host::LeappFlow& flow : bundle.data_flow) {
    print_line("flow", fmt::format("{} to {}", shortened(flow.from.tensor), shortened(flow.to.tensor)));
  }
  for (const policy_host::LeappFlow& flow : bundle.feedback) {
    print_line("feedback", fmt::format("{} to {}, start in {}", shortened(flow.from.tensor), shortened(flow.to.tensor),
                                       bundle.initial_values.empty() ? "no file" : shortened(bundle.initial_values)));
  }
  if (bundle.frequency_hz) print_line("frequency", fmt::format("{} Hz", *bundle.frequency_hz));
}

// Everything that the policy host would say of it, and what each input would be bound to.
int check_bundle_for_robot(const PolicyCheckOptions& options, const policy_host::DescribedPolicy& said) {
  const auto robot = load_policys_robot(options);
  if (!robot) return refuse(robot.error().exit_code, robot.error().sentence);
  const auto policy = load_for_robot(*robot);
  if (!policy) return refuse(policy.error().exit_code, policy.error().sentence);
  print_line("engine", (*policy)->description());
  for (const std::string& line : policy_host::binding_lines(said, *robot)) print_line("bound", line);
  for (const std::string& difference : differences_from(said, *robot)) print_line("differs", difference);
  print_line("fits",
             fmt::format("{}: {} values in, {} out", robot->robot, (*policy)->input_size(), (*policy)->output_size()));
  return kExitOk;
}

int check_bundle(const PolicyCheckOptions& options) {
  const std::string& file = options.file;
  const auto text = config::read_file(file);
  const auto bundle = text ? policy_host::read_leapp_bundle(*text, file) : std::unexpected(text.error());
  if (!bundle) {
    return refuse(config::kExitBadConfiguration, bundle.error());
  }
  fmt::print("{}: LEAPP bundle, configuration version {}\n", config::printable(file), shortened(bundle->version));
  for (const policy_host::LeappNode& node : bundle->nodes) {
    const auto fine = check_model_file(options, node);
    if (!fine) return refuse(fine.error().exit_code, fine.error().sentence);
  }
  if (!bundle->initial_values.empty()) {
    const auto beside = policy_host::path_beside(file, "initial_values", bundle->initial_values);
    if (!beside) return refuse(config::kExitBadConfiguration, beside.error());
  }
  print_bundle(*bundle);
  const policy_host::DescribedPolicy said = policy_host::describe_leapp(*bundle);
  print_described(said);
  return options.robot.empty() ? kExitOk : check_bundle_for_robot(options, said);
}

int check_policy(const PolicyCheckOptions& options) {
  if (config::names_bundle(options.file)) {
    if (!options.json) return check_bundle(options);
    return refuse(kExitUsage, options.file + ": a bundle is told in words; leave --json out");
  }
  const auto about = examine_policy(options);
  if (!about) {
    if (!options.json) return refuse(about.error().exit_code, about.error().sentence);
    fmt::print("{}\n", json_line(nlohmann::json{{"runs", false}, {"problem", about.error().sentence}}));
    return about.error().exit_code;
  }
  if (options.json) {
    nlohmann::json all = *about;
    all["runs"] = true;
    fmt::print("{}\n", json_line(all));
    return kExitOk;
  }
  const bool looked_into = !about->contains("not_by_builtin");
  fmt::print("{}: {}\n", config::printable(options.file),
             looked_into ? "runs on the built-in engine" : "runs by a plugin, which does not look into it");
  print_line("engine", (*about)["engine"].get<std::string>());
  if (looked_into) print_policy(*about);
  if (about->contains("robot")) {
    for (const auto& line : (*about)["bound"]) print_line("bound", line.get<std::string>());
    if (looked_into) {
      for (const auto& difference : (*about)["differences"]) print_line("differs", difference.get<std::string>());
    }
    const auto& robot = (*about)["robot"];
    print_line("fits", fmt::format("{}: {} values in, {} out", robot["name"].get<std::string>(),
                                   robot["values_in"].get<std::size_t>(), robot["values_out"].get<std::size_t>()));
  }
  return kExitOk;
}

}  // namespace

void add_policy_check(CLI::App& policy, int& exit_code) {
  CLI::App* command = policy.add_subcommand(
      "check", "Say what an ONNX policy or a LEAPP bundle is, and whether a policy fits a robot.");
  auto options = std::make_shared<PolicyCheckOptions>();
  command->add_option("FILE", options->file, "policy file, or the YAML of a LEAPP bundle")->required();
  command->add_option("--robot", options->robot, "robot file whose terms, actions and tensor names it must fit");
  command->add_flag("--json", options->json, "one line of JSON");
  command->footer(
      "Example: takt policy check config/arm6_reach.onnx --robot config/arm6.yaml\n"
      "Exit codes: 0 runs (and fits), 64 command line, 65 not, with the reason.");
  command->callback([options, &exit_code] { exit_code = check_policy(*options); });
}

}  // namespace takt::cli

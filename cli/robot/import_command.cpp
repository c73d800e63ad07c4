// SPDX-License-Identifier: Apache-2.0
// takt config new | import: a robot file to fill in, from a robot's model, and from what an export knows: a deploy.yaml
// of Isaac Lab and Unitree's tools, the configuration of rl_sar, legged_rl_deploy or unitree_rl_gym, the YAML of a
// LEAPP bundle, or the metadata in an ONNX file of exploy's, mjlab's and whole_body_tracking's exporters.
#include <fmt/format.h>
#include <fmt/ranges.h>

#include <algorithm>
#include <filesystem>
#include <fstream>
#include <memory>
#include <optional>
#include <span>
#include <sstream>
#include <utility>

#include "cli/command.hpp"
#include "cli/run/scenario.hpp"
#include "config/bundle_name.hpp"
#include "config/deploy_import.hpp"
#include "config/document.hpp"
#include "config/load.hpp"
#include "config/model_import.hpp"
#include "config/printable.hpp"
#include "config/robot_text.hpp"
#include "config/units.hpp"
#include "policy_host/described_import.hpp"
#include "policy_host/exploy/exploy_description.hpp"
#include "policy_host/exporter_metadata.hpp"
#include "policy_host/leapp/leapp_bundle.hpp"
#include "policy_host/leapp/leapp_description.hpp"
#include "policy_host/onnx_engine/model.hpp"
#include "policy_host/policy_tensors.hpp"
#include "simulation/model_survey.hpp"
#include "simulation/rigid_bodies.hpp"

namespace takt::cli {
namespace {

namespace fs = std::filesystem;

constexpr std::string_view kDefaultInput = "obs", kDefaultOutput = "actions";  // of policy.input and policy.output

struct Given {
  std::string export_file, policy_file, model_file, mesh_path, robot, out, period;
  std::vector<std::string> joint_names;
  bool simulated = false;
  // By its name, or by what is in it.
  [[nodiscard]] bool is_onnx() const {
    if (export_file.ends_with(".onnx")) return true;
    return !config::names_bundle(export_file) && onnx_engine::read_metadata(export_file).has_value();
  }
};

// As it is best written in `out`: relative to its folder, when both are given so.
std::string path_from(const std::string& out, const std::string& file) {
  if (fs::path(file).is_absolute()) return file;
  return fs::relative(file, fs::absolute(out).parent_path()).string();
}

constexpr const char* kMeshPathText = "folder of meshes that are not where the model names them, of packages too";

std::string unfilled_in(const std::string& robot) {
  std::size_t count = 0;
  for (std::size_t at = 0; (at = robot.find(": FILL_IN", at)) != std::string::npos; ++at) ++count;
  for (std::size_t at = 0; (at = robot.find("[FILL_IN", at)) != std::string::npos; ++at) ++count;
  return count == 0 ? "no FILL_IN" : fmt::format("{} FILL_IN", count);
}

// The model's hinges, and those of its slides that the policy names.
std::vector<std::string> joints_for(const config::ModelFacts& model, const std::vector<std::string>& of_policy) {
  std::vector<std::string> names;
  for (const config::ModelJoint& joint : model.joints)
    if (joint.kind == config::JointKind::hinge || std::ranges::find(of_policy, joint.name) != of_policy.end())
      names.push_back(joint.name);
  return names;
}

std::vector<std::string> named_in(const policy_host::DescribedPolicy& policy) {
  std::vector<std::string> names = policy.joints.joints;
  for (const auto& input : policy.inputs) names.insert(names.end(), input.joints.begin(), input.joints.end());
  for (const auto& output : policy.outputs) names.insert(names.end(), output.joints.begin(), output.joints.end());
  return names;
}

// Joints in the robot's order, by --joint-names or the model; without either in the policy's.
std::expected<config::DeployFile, std::string> read_described(const policy_host::DescribedPolicy& described,
                                                              Given& given,
                                                              const std::optional<config::ModelFacts>& model) {
  if (given.joint_names.empty() && model) given.joint_names = joints_for(*model, named_in(described));
  auto deploy = policy_host::deploy_file_of(described, given.joint_names);
  if (!deploy) return std::unexpected(fmt::format("{}: {}", given.export_file, deploy.error()));
  return deploy;
}

// Metadata names its joints. In the robot's order they stand by --joint-names or the model, without either in the
// policy's.
std::expected<config::DeployFile, std::string> read_metadata(Given& given,
                                                             const std::optional<config::ModelFacts>& model) {
  const auto file = onnx_engine::load(given.export_file);
  if (!file) return std::unexpected(file.error());
  const auto described = policy_host::describe_exploy(file->metadata(), file->inputs(), file->outputs());
  if (!described) return std::unexpected(fmt::format("{}: {}", given.export_file, described.error()));
  if (*described) return read_described(**described, given, model);
  const auto metadata = policy_host::read_exporter_metadata(file->metadata());
  if (!metadata) return std::unexpected(fmt::format("{}: {}", given.export_file, metadata.error()));
  if (given.joint_names.empty() && model) given.joint_names = joints_for(*model, metadata->joint_names);
  if (given.joint_names.empty()) given.joint_names = metadata->joint_names;
  auto deploy = policy_host::deploy_file_of(*metadata, given.joint_names);
  if (!deploy) return std::unexpected(fmt::format("{}: {}", given.export_file, deploy.error()));
  return deploy;
}

std::expected<config::DeployFile, std::string> read_export(Given& given,
                                                           const std::optional<config::ModelFacts>& model) {
  if (given.is_onnx()) return read_metadata(given, model);
  const auto text = config::read_file(given.export_file);
  if (!text) return std::unexpected(text.error());
  if (policy_host::is_leapp_bundle(*text)) {
    const auto bundle = policy_host::read_leapp_bundle(*text, given.export_file);
    if (!bundle) return std::unexpected(bundle.error());
    return read_described(policy_host::describe_leapp(*bundle), given, model);
  }
  std::vector<std::string> inputs;
  if (const auto tensors = onnx_engine::read_tensors(given.policy_file))
    for (const onnx_engine::TensorInfo& input : tensors->inputs) inputs.push_back(input.name);
  return config::read_deploy_file(*text, given.export_file, inputs);
}

// The policy's period, where the export does not say it.
std::expected<void, std::string> add_period(const std::string& text, config::DeployFile& deploy) {
  const auto period = parse_duration(text);
  if (!period) return std::unexpected("--period " + period.error());
  if (deploy.step_dt.ns != 0 && deploy.step_dt != *period)
    return std::unexpected(fmt::format("--period {}: the export says {}; leave it out, or export again", text,
                                       config::format_duration(deploy.step_dt)));
  deploy.step_dt = *period;
  return {};
}

std::string listed(std::span<const onnx_engine::TensorInfo> tensors, const std::vector<std::size_t>& chosen) {
  std::vector<std::string_view> names;
  for (const std::size_t one : chosen) names.emplace_back(tensors[one].name);
  return fmt::format("{}", fmt::join(names, ", "));
}

// policy.input and policy.output, where the policy is an ONNX file whose tensors have other names than the defaults.
void name_tensors(const std::string& policy_file, const config::DeployFile& deploy, config::ImportOptions& options) {
  const auto declared = onnx_engine::read_tensors(policy_file);
  if (!declared) return;
  const auto assigned = policy_host::assign_tensors({declared->inputs, declared->outputs}, policy_file,
                                                    fmt::format("{}", fmt::join(deploy.inputs, ", ")), "");
  if (!assigned) return;  // the policy host says what is wrong with it
  options.input = listed(declared->inputs, assigned->observation);
  options.output = listed(declared->outputs, {assigned->outputs.front()});
  const auto is_actions = [](const onnx_engine::TensorInfo& tensor) { return tensor.name == kDefaultOutput; };
  if (options.input == kDefaultInput) options.input.clear();
  if (std::ranges::any_of(declared->outputs, is_actions)) options.output.clear();
}

// The export is the policy itself: an ONNX file, or a bundle.
bool is_policy(const Given& given) {
  if (given.is_onnx()) return true;
  const auto text = config::read_file(given.export_file);
  return text && policy_host::is_leapp_bundle(*text);
}

// Takes the slides out that get no joint: those that are not named, or, where no joint is, all that the policy cannot
// mean since it moves as many joints as there are hinges. Returns a sentence; empty: none was taken out.
std::string take_out_slides(config::ModelFacts& model, const std::vector<std::string>& names, std::size_t moved) {
  const auto is_slide = [](const config::ModelJoint& joint) { return joint.kind == config::JointKind::slide; };
  const auto slides = static_cast<std::size_t>(std::ranges::count_if(model.joints, is_slide));
  if (names.empty() && model.joints.size() != moved + slides) return {};
  std::vector<std::string> left;
  for (const config::ModelJoint& joint : model.joints)
    if (is_slide(joint) && std::ranges::find(names, joint.name) == names.end()) left.push_back(joint.name);
  const auto is_left = [&](const std::string& name) { return std::ranges::find(left, name) != left.end(); };
  std::erase_if(model.joints, [&](const config::ModelJoint& joint) { return is_left(joint.name); });
  std::erase_if(model.motors, is_left);
  if (left.empty()) return {};
  return fmt::format("slides that the policy does not move have no drive, and move freely: {}", fmt::join(left, ", "));
}

// With --mesh-path: a copy of the model beside the robot file that names its meshes by their whole paths.
std::expected<void, std::string> keep_model_beside(Given& given) {
  if (given.mesh_path.empty() || given.model_file.empty()) return {};
  const auto text = simulation::model_with_whole_paths(given.model_file, given.mesh_path);
  if (!text) return std::unexpected(text.error());
  const std::string copy = fs::path(given.out).replace_extension(".model.xml").string();
  std::ofstream file(copy);
  file << *text;
  if (!file.flush()) return std::unexpected(copy + ": cannot be written; is its disk full? choose another -o");
  given.model_file = copy;
  return {};
}

// What each joint carries, in the order in which the robot file will have them.
std::expected<std::optional<config::Model>, std::string> bodies_of(const std::optional<config::ModelFacts>& model,
                                                                   const Given& given) {
  if (!model) return std::nullopt;
  const auto names = given.joint_names.empty() ? config::motor_order(*model).joints : given.joint_names;
  return simulation::rigid_bodies(given.model_file, given.mesh_path, names);
}

// A robot file that is not there yet. Returns the exit code; what is wrong was said.
int write_new(const std::string& path, const std::string& text) {
  std::error_code ignored;
  if (fs::exists(path, ignored))
    return refuse(kExitFailed, fmt::format("{} exists already; choose another -o, or remove it", path));
  std::ofstream file(path);
  file << text;
  if (file.flush()) return kExitOk;
  fs::remove(path, ignored);  // half a robot file would stand in the way of the next try
  return refuse(kExitFailed, fmt::format("{} cannot be written; is its disk full? choose another -o", path));
}

// Those of the model and the export, and what the file says besides, each once.
void tell(std::vector<std::string> remarks, const std::string& robot) {
  constexpr std::string_view kNote = "# Note: ";
  std::istringstream lines(robot);
  for (std::string line; std::getline(lines, line) && line.starts_with('#');)
    if (line.starts_with(kNote) && std::ranges::find(remarks, line.substr(kNote.size())) == remarks.end())
      remarks.push_back(line.substr(kNote.size()));
  for (const std::string& remark : remarks) note("note", remark);
}

int import(Given given) {
  if (given.policy_file.empty() && !is_policy(given))
    return refuse(kExitUsage, "--policy is missing: this export does not name its ONNX file");
  if (given.policy_file.empty()) given.policy_file = given.export_file;
  if (const auto hash = config::policy_hash(given.policy_file); !hash)
    return refuse(config::kExitBadConfiguration, hash.error());
  std::optional<config::ModelFacts> model;
  if (!given.model_file.empty()) {
    auto facts = simulation::survey_model(given.model_file, given.mesh_path);
    if (!facts) return refuse(config::kExitBadConfiguration, facts.error());
    model = std::move(*facts);
    if (const auto kept = keep_model_beside(given); !kept) return refuse(kExitFailed, kept.error());
  }
  auto deploy = read_export(given, model);
  if (!deploy) return refuse(config::kExitBadConfiguration, deploy.error());
  if (!given.period.empty())
    if (const auto added = add_period(given.period, *deploy); !added) return refuse(kExitUsage, added.error());
  std::vector<std::string> remarks = deploy->remarks;
  if (model) remarks.insert(remarks.end(), model->remarks.begin(), model->remarks.end());
  if (model)
    if (std::string left = take_out_slides(*model, given.joint_names, deploy->robot_joint.size()); !left.empty())
      remarks.push_back(std::move(left));
  if (model && given.joint_names.empty())
    if (const auto order = config::motor_order(*model); !order.remark.empty()) remarks.push_back(order.remark);
  const auto bodies = bodies_of(model, given);
  if (!bodies) return refuse(config::kExitBadConfiguration, bodies.error());
  config::ImportOptions options{.robot = given.robot,
                                .policy_file = path_from(given.out, given.policy_file),
                                .joint_names = given.joint_names,
                                .source = fs::path(given.export_file).filename().string(),
                                .model = std::move(model),
                                .model_file = path_from(given.out, given.model_file),
                                .bodies = *bodies,
                                .simulated = given.simulated};
  if (!deploy->tensors) name_tensors(given.policy_file, *deploy, options);
  const auto robot = config::import_deploy_file(*deploy, options);
  if (!robot) return refuse(kExitUsage, robot.error());
  if (const int refused = write_new(given.out, *robot); refused != kExitOk) return refused;
  for (const std::string& dropped : deploy->notes) note("not carried over", dropped);
  tell(std::move(remarks), *robot);
  fmt::print("{}: {} joints, {} observation terms; {} to replace, then: takt config check {}\n",
             config::printable(given.out), deploy->robot_joint.size(), deploy->terms.size(), unfilled_in(*robot),
             config::printable(given.out));
  return kExitOk;
}

int make_new(Given given) {
  const auto model = simulation::survey_model(given.model_file, given.mesh_path);
  if (!model) return refuse(config::kExitBadConfiguration, model.error());
  const std::string source = given.model_file;
  if (const auto kept = keep_model_beside(given); !kept) return refuse(kExitFailed, kept.error());
  const std::string name =
      given.robot.empty() ? config::as_identifier(fs::path(source).stem().string(), "robot_") : given.robot;
  for (const config::ModelJoint& joint : model->joints) given.joint_names.push_back(joint.name);
  const auto bodies = bodies_of(*model, given);
  if (!bodies) return refuse(config::kExitBadConfiguration, bodies.error());
  const auto robot = config::robot_of_model({.robot = name,
                                             .policy_file = {},
                                             .joint_names = {},
                                             .source = fs::path(source).filename().string(),
                                             .model = *model,
                                             .model_file = path_from(given.out, given.model_file),
                                             .bodies = *bodies,
                                             .simulated = given.simulated});
  if (!robot) return refuse(kExitUsage, robot.error());
  if (const int refused = write_new(given.out, *robot); refused != kExitOk) return refused;
  tell(model->remarks, *robot);
  fmt::print("{}: {} joints, no policy; {} to replace, then: takt config check {}\n", config::printable(given.out),
             model->joints.size(), unfilled_in(*robot), config::printable(given.out));
  return kExitOk;
}

}  // namespace

void add_config_import(CLI::App& config, int& exit_code) {
  CLI::App* command = config.add_subcommand(
      "import",
      "Begin a robot file from an Isaac Lab / Unitree deploy.yaml, a LEAPP bundle, or an ONNX file's metadata.");
  auto given = std::make_shared<Given>();
  command
      ->add_option("EXPORT", given->export_file,
                   "deploy.yaml, a configuration of rl_sar, legged_rl_deploy or unitree_rl_gym, a LEAPP bundle's YAML, "
                   "or ONNX with metadata of "
                   "exploy, mjlab or whole_body_tracking; Python tags are never executed")
      ->required();
  command->add_option("--policy", given->policy_file,
                      "the exported ONNX or TorchScript file; default: EXPORT, where it is one or a bundle");
  command->add_option("--model", given->model_file,
                      "the robot's MJCF or URDF: names, position limits, torques, inertias, IMU, keyframe");
  command->add_option("--mesh-path", given->mesh_path, kMeshPathText);
  command->add_flag("--simulated", given->simulated,
                    "make up buses, drives and contract, so that `takt run` simulates it at once; needs --model");
  command->add_option("--period", given->period, "the policy's, where the export does not say it: 20ms");
  command->add_option("--robot", given->robot, "name of the robot")->required();
  command->add_option("-o,--output", given->out, "robot file to write; must not exist yet")->required();
  command->add_option("--joint-names", given->joint_names, "joints in the robot's own order, separated by commas")
      ->delimiter(',');
  command->footer(
      "Example: takt config import deploy.yaml --policy policy.onnx --robot g1 -o g1.yaml\n"
      "         takt config import deploy.yaml --policy policy.onnx --model g1.xml --simulated --robot g1 -o g1.yaml\n"
      "         takt config import policy.onnx --robot go1 -o go1.yaml\n"
      "         takt config import bundle/walk.yaml --robot g1 -o g1.yaml\n"
      "What the export cannot know is written as FILL_IN; `takt config check` names what is left.\n"
      "Exit codes: 0 written, 1 the output exists or cannot be written, 64 command line, 65 the export cannot be "
      "read.");
  command->callback([given, &exit_code] { exit_code = import(*given); });
}

void add_config_new(CLI::App& config, int& exit_code) {
  CLI::App* command = config.add_subcommand("new", "Begin a robot file from the robot's model alone.");
  auto given = std::make_shared<Given>();
  command->add_option("MODEL", given->model_file, "the robot's MJCF or URDF")->required();
  command->add_option("--mesh-path", given->mesh_path, kMeshPathText);
  command->add_flag("--simulated", given->simulated,
                    "make up buses, drives, gains and contract, so that `takt run` simulates it at once");
  command->add_option("--robot", given->robot, "name of the robot; default: the model's file name");
  command->add_option("-o,--output", given->out, "robot file to write; must not exist yet")->required();
  command->footer(
      "Example: takt config new so101.urdf --simulated -o so101.yaml\n"
      "Joints, limits, torques, inertias and where it begins are the model's. What no model knows is written as "
      "FILL_IN.\n"
      "Exit codes: 0 written, 1 the output exists or cannot be written, 64 command line, 65 the model cannot be read.");
  command->callback([given, &exit_code] { exit_code = make_new(*given); });
}

}  // namespace takt::cli

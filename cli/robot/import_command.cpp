// SPDX-License-Identifier: Apache-2.0
// takt config import: a robot file to fill in, from what an export knows: a deploy.yaml of Isaac Lab and Unitree's
// tools, the YAML of a LEAPP bundle, or the metadata in an ONNX file of exploy's, mjlab's and whole_body_tracking's
// exporters.
#include <fmt/format.h>

#include <filesystem>
#include <fstream>
#include <memory>
#include <optional>
#include <utility>

#include "cli/command.hpp"
#include "cli/run/scenario.hpp"
#include "config/bundle_name.hpp"
#include "config/deploy_import.hpp"
#include "config/document.hpp"
#include "config/load.hpp"
#include "config/units.hpp"
#include "policy_host/described_import.hpp"
#include "policy_host/exploy/exploy_description.hpp"
#include "policy_host/exporter_metadata.hpp"
#include "policy_host/leapp/leapp_bundle.hpp"
#include "policy_host/leapp/leapp_description.hpp"
#include "policy_host/onnx/model.hpp"
#include "simulation/model_survey.hpp"

namespace takt::cli {
namespace {

namespace fs = std::filesystem;

struct Given {
  std::string export_file, policy_file, model_file, robot, out, period;
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

std::string unfilled_in(const std::string& robot) {
  std::size_t count = 0;
  for (std::size_t at = 0; (at = robot.find(": FILL_IN", at)) != std::string::npos; ++at) ++count;
  for (std::size_t at = 0; (at = robot.find("[FILL_IN", at)) != std::string::npos; ++at) ++count;
  return count == 0 ? "no FILL_IN" : fmt::format("{} FILL_IN", count);
}

// Joints in the robot's order, by --joint-names or the model; without either in the policy's.
std::expected<config::DeployFile, std::string> read_described(const policy_host::DescribedPolicy& described,
                                                              Given& given,
                                                              const std::optional<config::ModelFacts>& model) {
  if (given.joint_names.empty() && model)
    for (const config::ModelJoint& joint : model->joints) given.joint_names.push_back(joint.name);
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
  if (given.joint_names.empty() && model)
    for (const config::ModelJoint& joint : model->joints) given.joint_names.push_back(joint.name);
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
  return config::read_deploy_file(*text, given.export_file);
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

// The export is the policy itself: an ONNX file, or a bundle.
bool is_policy(const Given& given) {
  if (given.is_onnx()) return true;
  const auto text = config::read_file(given.export_file);
  return text && policy_host::is_leapp_bundle(*text);
}

int import(Given given) {
  if (given.policy_file.empty() && !is_policy(given))
    return refuse(kExitUsage, "--policy is missing: a deploy.yaml does not name its ONNX file");
  if (given.policy_file.empty()) given.policy_file = given.export_file;
  if (const auto hash = config::policy_hash(given.policy_file); !hash)
    return refuse(config::kExitBadConfiguration, hash.error());
  std::optional<config::ModelFacts> model;
  if (!given.model_file.empty()) {
    auto facts = plant::survey_model(given.model_file);
    if (!facts) return refuse(config::kExitBadConfiguration, facts.error());
    model = std::move(*facts);
  }
  auto deploy = read_export(given, model);
  if (!deploy) return refuse(config::kExitBadConfiguration, deploy.error());
  if (!given.period.empty())
    if (const auto added = add_period(given.period, *deploy); !added) return refuse(kExitUsage, added.error());
  std::vector<std::string> remarks = deploy->remarks;
  if (model && given.joint_names.empty())
    if (const auto order = config::motor_order(*model); !order.remark.empty()) remarks.push_back(order.remark);
  const auto robot = config::import_deploy_file(*deploy, {.robot = given.robot,
                                                          .policy_file = path_from(given.out, given.policy_file),
                                                          .joint_names = given.joint_names,
                                                          .source = fs::path(given.export_file).filename().string(),
                                                          .model = std::move(model),
                                                          .model_file = path_from(given.out, given.model_file),
                                                          .simulated = given.simulated});
  if (!robot) return refuse(kExitUsage, robot.error());
  if (fs::exists(given.out))
    return refuse(kExitFailed, fmt::format("{} exists already; choose another -o, or remove it", given.out));
  std::ofstream file(given.out);
  file << *robot;
  if (!file.flush()) {
    std::error_code ignored;
    fs::remove(given.out, ignored);  // half a robot file would stand in the way of the next try
    return refuse(kExitFailed, fmt::format("{} cannot be written; is its disk full? choose another -o", given.out));
  }
  for (const std::string& note : deploy->notes) fmt::print(stderr, "not carried over: {}\n", note);
  for (const std::string& remark : remarks) fmt::print(stderr, "note: {}\n", remark);
  fmt::print("{}: {} joints, {} observation terms; {} to replace, then: takt config check {}\n", given.out,
             deploy->robot_joint.size(), deploy->terms.size(), unfilled_in(*robot), given.out);
  return kExitOk;
}

}  // namespace

void add_config_import(CLI::App& config, int& exit_code) {
  CLI::App* command = config.add_subcommand(
      "import",
      "Begin a robot file from an Isaac Lab / Unitree deploy.yaml, a LEAPP bundle, or an ONNX file's metadata.");
  auto given = std::make_shared<Given>();
  command
      ->add_option(
          "EXPORT", given->export_file,
          "deploy.yaml (its Python tags are data, never executed), the YAML of a LEAPP bundle, or an ONNX file with "
          "metadata of exploy's, mjlab's or whole_body_tracking's exporter")
      ->required();
  command->add_option("--policy", given->policy_file,
                      "the exported ONNX file; default: EXPORT, where it is one or a bundle");
  command->add_option("--model", given->model_file,
                      "the robot's MJCF or URDF: names, position limits, torques, inertias, IMU, keyframe");
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

}  // namespace takt::cli

#include "policy_host/engines/load_policy.hpp"

#include <fmt/format.h>

#include <cstdint>
#include <filesystem>

#include "policy_host/engines/engine_policy.hpp"
#include "policy_host/flow/flow_policy.hpp"
#include "policy_host/onnx_policy.hpp"

namespace takt::policy_host {
namespace {

namespace fs = std::filesystem;

// Where the installation has its plugins, and the build folder likewise.
std::string plugin_beside(const std::string& name) {
  std::error_code unreadable;
  const fs::path program = fs::read_symlink("/proc/self/exe", unreadable);
  return (program.parent_path() / TAKT_ENGINES_FROM_PROGRAMS / fmt::format("takt-engine-{}.so", name))
      .lexically_normal()
      .string();
}

// An ONNX network of more than this in products of matrices (onnx_engine::Model::matrix_work) is quicker elsewhere:
// `./dev bench inference`.
constexpr std::uint64_t kMostMatrixWork = 1'000'000;

using Loaded = std::expected<std::unique_ptr<Policy>, std::string>;

Loaded load_plugin(const std::string& name, const config::RobotConfig& robot) {
  if (name.contains('/')) return load_engine_policy(name, robot);
  const std::string plugin = plugin_beside(name);
  if (!fs::exists(plugin))
    return std::unexpected(
        fmt::format("policy.engine {}: {} is not there; install the package takt-engine-{}", name, plugin, name));
  return load_engine_policy(plugin, robot);
}

Loaded load_builtin(const config::Policy& policy) {
  if (policy.engine && policy.engine->provider != "cpu")
    return std::unexpected(
        fmt::format("policy.engine: the built-in engine computes on the CPU only, not by {}; write "
                    "name: onnxruntime",
                    policy.engine->provider));
  return load_onnx_policy(policy.file, network_input(policy), policy.output);
}

Loaded load_quicker(const config::RobotConfig& robot) {
  const config::Policy& policy = *robot.policy;
  auto model = onnx_engine::load(policy.file);
  if (!model) return std::unexpected(model.error());
  if (!is_quicker_elsewhere(*model))
    return make_onnx_policy(*std::move(model), policy.file, network_input(policy), policy.output);
  auto handed_over = load_plugin("onnxruntime", robot);
  if (handed_over) return handed_over;
  return std::unexpected(
      fmt::format("{}: {}, which ONNX Runtime does quicker; {}; or run it slower, by policy.engine: "
                  "{{ name: builtin }}",
                  policy.file, matrix_work_text(*model), handed_over.error()));
}

Loaded load_network(const config::RobotConfig& robot) {
  const config::Engine engine = robot.policy->engine.value_or(config::Engine{});
  if (engine.name == "builtin") return load_builtin(*robot.policy);
  if (engine.name != "auto") return load_plugin(engine.name, robot);
  if (fs::path(robot.policy->file).extension() == ".pt") return load_plugin("torchscript", robot);
  return engine.provider == "cpu" ? load_quicker(robot) : load_plugin("onnxruntime", robot);
}

}  // namespace

bool is_quicker_elsewhere(const onnx_engine::Model& model) {
  return model.matrix_work() > kMostMatrixWork;
}

std::string matrix_work_text(const onnx_engine::Model& model) {
  return fmt::format("{:.1f} million multiply-adds in products of matrices",
                     static_cast<double>(model.matrix_work()) / 1e6);
}

Loaded load_policy(const config::RobotConfig& robot) {
  auto network = load_network(robot);
  if (!network) return network;
  return with_sampler(robot, *std::move(network));
}

}  // namespace takt::policy_host

// SPDX-License-Identifier: Apache-2.0
#include "policy_host/engines/load_policy.hpp"

#include <fmt/format.h>

#include <cstdint>
#include <filesystem>
#include <utility>

#include "policy_host/assemble_policy.hpp"
#include "policy_host/engines/engine_network.hpp"
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

// An ONNX network is quicker elsewhere from so many multiply-adds in products of matrices on, for every step of a run
// (onnx_engine::Model): those are what ONNX Runtime does two to three times as fast, the steps are what costs it more.
// `./dev bench inference` shows where the two meet.
constexpr std::uint64_t kMostMatrixWorkPerStep = 12'000;

using Loaded = std::expected<std::unique_ptr<Network>, std::string>;

std::expected<std::string, std::string> plugin_of(const std::string& name) {
  if (name.contains('/')) return name;
  std::string plugin = plugin_beside(name);
  if (fs::exists(plugin)) return plugin;
  return std::unexpected(
      fmt::format("policy.engine {}: {} is not there; install the package takt-engine-{}", name, plugin, name));
}

FileReading reading_of(const onnx_engine::Model& model) {
  const auto lost = model.lost_states();
  return {{lost.begin(), lost.end()}, ""};
}

// Of a file that the built-in engine cannot load.
std::expected<FileReading, std::string> read_unloaded(const fs::path& file) {
  auto memory = onnx_engine::read_memory(file);
  if (!memory) return std::unexpected(memory.error());
  FileReading reading{std::move(memory->lost), ""};
  if (!memory->unclear.empty())
    reading.note = fmt::format("whether {} keeps its memory was not found out", memory->unclear.front());
  return reading;
}

// What a plugin that reads ONNX would not say: `reading`, and whether the policy's hash covers all of the weights.
Loaded load_onnx_by_plugin(const std::string& name, const config::RobotConfig& robot, const fs::path& file,
                           FileReading reading) {
  const auto plugin = plugin_of(name);
  if (!plugin) return std::unexpected(plugin.error());
  if (const auto covered = onnx_engine::check_external_data(file); !covered) return std::unexpected(covered.error());
  return load_engine_network(*plugin, robot, file, std::move(reading));
}

Loaded load_by_plugin(const std::string& name, const config::RobotConfig& robot, const fs::path& file) {
  if (name == "onnxruntime" || file.extension() == ".onnx") {
    const auto model = onnx_engine::load(file);
    auto reading = model ? reading_of(*model) : read_unloaded(file);
    if (!reading) return std::unexpected(reading.error());
    return load_onnx_by_plugin(name, robot, file, *std::move(reading));
  }
  const auto plugin = plugin_of(name);
  if (!plugin) return std::unexpected(plugin.error());
  return load_engine_network(*plugin, robot, file, {});
}

Loaded load_builtin(const config::Engine& engine, const fs::path& file) {
  if (engine.provider != "cpu")
    return std::unexpected(
        fmt::format("policy.engine: the built-in engine computes on the CPU only, not by {}; write "
                    "name: onnxruntime",
                    engine.provider));
  return load_onnx_network(file);
}

// What the built-in engine lacks, without where to read what it has.
std::string beyond_text(const std::string& sentence) {
  return sentence.substr(0, sentence.find(" (docs/policies.md)"));
}

Loaded load_beyond(const onnx_engine::Unloaded& unloaded, const config::RobotConfig& robot, const fs::path& file) {
  auto reading = read_unloaded(file);
  if (!reading) return std::unexpected(reading.error());
  auto handed_over = load_onnx_by_plugin("onnxruntime", robot, file, *std::move(reading));
  if (handed_over) return handed_over;
  return std::unexpected(fmt::format("{} (by the built-in engine); nor does it run in ONNX Runtime: {}",
                                     beyond_text(unloaded.sentence), handed_over.error()));
}

Loaded load_by_auto(const config::RobotConfig& robot, const fs::path& file) {
  auto model = onnx_engine::try_load(file);
  if (!model && model.error().beyond) return load_beyond(model.error(), robot, file);
  if (!model) return std::unexpected(model.error().sentence);
  if (!is_quicker_elsewhere(*model)) return make_onnx_network(*std::move(model));
  auto handed_over = load_onnx_by_plugin("onnxruntime", robot, file, reading_of(*model));
  if (handed_over) return handed_over;
  return std::unexpected(
      fmt::format("{}: {}, which ONNX Runtime does quicker; {}; or run it slower, by policy.engine: "
                  "{{ name: builtin }}",
                  file.string(), matrix_work_text(*model), handed_over.error()));
}

}  // namespace

Loaded load_network(const config::RobotConfig& robot, const fs::path& file) {
  const config::Engine engine = robot.policy->engine.value_or(config::Engine{});
  if (engine.name == "builtin") return load_builtin(engine, file);
  if (engine.name != "auto") return load_by_plugin(engine.name, robot, file);
  if (file.extension() == ".pt") return load_by_plugin("torchscript", robot, file);
  return engine.provider == "cpu" ? load_by_auto(robot, file) : load_by_plugin("onnxruntime", robot, file);
}

std::expected<EngineChoice, std::string> choose_engine(const fs::path& file) {
  if (file.extension() == ".pt") return EngineChoice{"torchscript", ""};
  const auto model = onnx_engine::try_load(file);
  if (!model && model.error().beyond) {
    const std::string why = beyond_text(model.error().sentence), prefix = file.string() + ": ";
    return EngineChoice{"onnxruntime", why.starts_with(prefix) ? why.substr(prefix.size()) : why};
  }
  if (!model) return std::unexpected(model.error().sentence);
  if (is_quicker_elsewhere(*model)) return EngineChoice{"onnxruntime", matrix_work_text(*model)};
  return EngineChoice{"builtin", ""};
}

bool is_quicker_elsewhere(const onnx_engine::Model& model) {
  return model.matrix_work() > kMostMatrixWorkPerStep * model.steps();
}

std::string matrix_work_text(const onnx_engine::Model& model) {
  return fmt::format("{:.1f} million multiply-adds in products of matrices",
                     static_cast<double>(model.matrix_work()) / 1e6);
}

std::expected<std::unique_ptr<Policy>, std::string> load_policy(const config::RobotConfig& robot) {
  return assemble_policy(robot, [&robot](const fs::path& file) { return load_network(robot, file); });
}

}  // namespace takt::policy_host

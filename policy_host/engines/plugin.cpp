// SPDX-License-Identifier: Apache-2.0
#include "policy_host/engines/plugin.hpp"

#include <dlfcn.h>
#include <fmt/format.h>

#include <algorithm>
#include <array>
#include <exception>
#include <vector>

#include "config/observation_shape.hpp"
#include "policy_host/engines/load_watch.hpp"
#include "policy_host/processor_fence.hpp"

namespace takt::policy_host {
namespace {

constexpr std::size_t kMostTensors = 1024;
constexpr std::size_t kMostValues = std::size_t{1} << 28U;
constexpr std::size_t kErrorBytes = 1024;

class ErrorText {
 public:
  char* data() { return text_.data(); }
  static constexpr std::size_t size() { return kErrorBytes; }
  [[nodiscard]] std::string line() const {
    const auto end = std::ranges::find(text_, '\0');
    std::string said(text_.begin(), end);
    for (char& c : said) c = static_cast<unsigned char>(c) < ' ' ? ' ' : c;
    return said.empty() ? "gives no reason" : said;
  }

 private:
  std::array<char, kErrorBytes> text_{};
};

std::unexpected<std::string> refuse(const std::string& plugin, const std::string& what) {
  return std::unexpected(plugin + ": " + what);
}

std::expected<const takt_engine_table*, std::string> open_plugin(const std::string& plugin) {
  void* const handle = dlopen(plugin.c_str(), RTLD_NOW | RTLD_LOCAL);
  // One loading thread. NOLINTNEXTLINE(concurrency-mt-unsafe)
  if (handle == nullptr) return refuse(plugin, fmt::format("cannot be loaded: {}", dlerror()));
  const auto entry = reinterpret_cast<const takt_engine_table* (*)()>(dlsym(handle, "takt_engine"));
  if (entry == nullptr) return refuse(plugin, "is no engine: it has no symbol takt_engine (takt/engine.h)");
  const takt_engine_table* const engine = entry();
  if (engine == nullptr) return refuse(plugin, "is no engine: its takt_engine() gives none");
  if (engine->abi != TAKT_ENGINE_ABI)
    return refuse(plugin, fmt::format("speaks version {} of takt/engine.h, this host {}; build it with this host's",
                                      engine->abi, TAKT_ENGINE_ABI));
  if (engine->size < sizeof(takt_engine_table) || engine->open == nullptr || engine->infer == nullptr ||
      engine->reset == nullptr || engine->close == nullptr)
    return refuse(plugin, "its table lacks a function; fill all of takt_engine_table");
  return engine;
}

// Empty: fine.
std::string complaint_about(std::span<const takt_engine_tensor> tensors) {
  for (const takt_engine_tensor& tensor : tensors) {
    if (tensor.name == nullptr) return "a tensor has no name; give it \"\"";
    if (tensor.rank > TAKT_ENGINE_MOST_DIMENSIONS)
      return fmt::format("tensor {} has {} dimensions; at most {} are known", tensor.name, tensor.rank,
                         TAKT_ENGINE_MOST_DIMENSIONS);
    std::size_t values = 1;
    for (const std::int64_t size : std::span(tensor.shape).first(tensor.rank)) {
      if (size < 1 || static_cast<std::size_t>(size) > kMostValues / values)
        return fmt::format("tensor {} has a dimension of {}; fixed shapes of at most {} values are known", tensor.name,
                           size, kMostValues);
      values *= static_cast<std::size_t>(size);
    }
    if (tensor.values == nullptr) return fmt::format("tensor {} has no memory for its values", tensor.name);
  }
  return {};
}

std::string complaint_about(const takt_engine_network& network) {
  if (network.size < sizeof(takt_engine_network) || network.description == nullptr) return "its network is incomplete";
  if (network.input_count == 0 || network.output_count == 0 || network.inputs == nullptr || network.outputs == nullptr)
    return "its network has no input or no output";
  if (network.input_count > kMostTensors || network.output_count > kMostTensors)
    return fmt::format("its network has more than {} inputs or outputs", kMostTensors);
  std::string complaint = complaint_about(std::span(network.inputs, network.input_count));
  return complaint.empty() ? complaint_about(std::span(network.outputs, network.output_count)) : complaint;
}

std::vector<takt_engine_tensor> stated_shapes(const config::Engine& engine) {
  std::vector<takt_engine_tensor> tensors;
  for (const auto& [name, shape] : engine.shapes) {
    takt_engine_tensor& tensor = tensors.emplace_back();
    tensor.name = name.c_str();
    tensor.rank = static_cast<std::uint32_t>(shape.size());
    std::ranges::transform(shape, std::ranges::begin(tensor.shape),
                           [](double size) { return static_cast<std::int64_t>(size); });
  }
  return tensors;
}

std::expected<EngineNetwork, std::string> open_with(const std::string& plugin, const takt_engine_setup& setup) {
  const auto engine = open_plugin(plugin);
  if (!engine) return std::unexpected(engine.error());
  ErrorText error;
  takt_engine_network* const network = (*engine)->open(&setup, error.data(), ErrorText::size());
  if (network == nullptr) return std::unexpected(error.line());
  if (const std::string complaint = complaint_about(*network); !complaint.empty()) return refuse(plugin, complaint);
  return EngineNetwork(*engine, network);
}

}  // namespace

std::size_t value_count(const takt_engine_tensor& tensor) {
  std::size_t count = 1;
  for (const std::int64_t size : std::span(tensor.shape).first(tensor.rank)) count *= static_cast<std::size_t>(size);
  return count;
}

std::expected<void, std::string> EngineNetwork::infer() {
  ErrorText error;
  if (engine_->infer(network_, error.data(), ErrorText::size()) == 0) return {};
  return std::unexpected(error.line());
}

std::expected<EngineNetwork, std::string> open_network(const std::string& plugin, const config::RobotConfig& robot,
                                                       const std::filesystem::path& file) {
  const config::Engine engine = robot.policy->engine.value_or(config::Engine{});
  const std::vector<takt_engine_tensor> shapes = stated_shapes(engine);
  const takt_engine_setup setup{.size = sizeof(takt_engine_setup),
                                .threads = engine.threads,
                                .file = file.c_str(),
                                .provider = engine.provider.c_str(),
                                .library = engine.library.c_str(),
                                .observation_values = config::observation_width(robot),
                                .action_values = robot.policy->steps * config::outputs_per_step(robot),
                                .shapes = shapes.data(),
                                .shape_count = shapes.size()};
  limit_thread_pools(engine.threads, PoolSize::as_told);  // they read it when they are loaded
  const LoadWatch watch(plugin, engine.load_within);
  try {
    return open_with(plugin, setup);
  } catch (const std::exception& error) {
    return refuse(plugin, fmt::format("let an exception out while it was loaded: {}", error.what()));
  } catch (...) {
    return refuse(plugin, "let an exception out while it was loaded");
  }
}

}  // namespace takt::policy_host

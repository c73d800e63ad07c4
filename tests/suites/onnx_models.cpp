// SPDX-License-Identifier: Apache-2.0
// The ONNX standard's own models (Debian's libonnx-testdata), each by the engine that `policy.engine: auto` takes,
// judged by the outputs that the standard gives for its inputs. Prints JSON, a section for each kind of model.
//
// usage: takt-suite-onnx FOLDER [LIBONNXRUNTIME]
#include <onnx/onnx_pb.h>

#include <algorithm>
#include <cmath>
#include <cstdio>
#include <cstdlib>
#include <expected>
#include <filesystem>
#include <fstream>
#include <iterator>
#include <map>
#include <memory>
#include <nlohmann/json.hpp>
#include <optional>
#include <span>
#include <string>
#include <vector>

#include "lab/policy_trial/agreement.hpp"
#include "lab/policy_trial/judging_network.hpp"
#include "policy_host/onnx_policy.hpp"
#include "policy_host/onnx_runtime/onnx_runtime.hpp"
#include "policy_host/onnx_runtime/stored_numbers.hpp"

namespace takt::policy_host {
namespace {

namespace fs = std::filesystem;

constexpr double kTolerance = 1e-5;

struct Vector {
  std::string name;
  std::vector<float> values;
};

std::optional<Vector> read_vector(const fs::path& file) {
  std::ifstream stream(file, std::ios::binary);
  onnx::TensorProto tensor;
  if (!tensor.ParseFromIstream(&stream)) return std::nullopt;
  std::size_t count = 1;
  for (const std::int64_t dim : tensor.dims()) count *= static_cast<std::size_t>(dim);
  Vector vector{tensor.name(), std::vector<float>(count)};
  const std::size_t bytes = onnx_runtime::stored_bytes(tensor.data_type()) * count;
  if (bytes == 0 && count > 0) return std::nullopt;
  if (tensor.has_raw_data()) {
    if (tensor.raw_data().size() != bytes) return std::nullopt;
    onnx_runtime::read(std::as_bytes(std::span(tensor.raw_data())), tensor.data_type(), vector.values);
    return vector;
  }
  const bool half = tensor.data_type() == onnx::TensorProto_DataType_FLOAT16 ||
                    tensor.data_type() == onnx::TensorProto_DataType_BFLOAT16;
  if (half) {  // listed by their bits
    std::vector<std::uint16_t> bits(tensor.int32_data().begin(), tensor.int32_data().end());
    if (bits.size() != count) return std::nullopt;
    onnx_runtime::read(std::as_bytes(std::span(bits)), tensor.data_type(), vector.values);
    return vector;
  }
  const auto take = [&](const auto& numbers) {
    if (static_cast<std::size_t>(numbers.size()) != count) return false;
    std::ranges::transform(numbers, vector.values.begin(), [](auto number) { return static_cast<float>(number); });
    return true;
  };
  const bool taken = take(tensor.float_data()) || take(tensor.int64_data()) || take(tensor.int32_data()) ||
                     take(tensor.double_data()) || take(tensor.uint64_data());
  return taken ? std::optional(vector) : std::nullopt;
}

// input_0.pb, input_1.pb, ...; nothing: one of them holds no tensor of numbers.
std::optional<std::vector<Vector>> read_vectors(const fs::path& folder, const std::string& what) {
  std::vector<Vector> vectors;
  for (std::size_t i = 0;; ++i) {
    const fs::path file = folder / (what + "_" + std::to_string(i) + ".pb");
    if (!fs::exists(file)) return vectors;
    auto vector = read_vector(file);
    if (!vector) return std::nullopt;
    vectors.push_back(*std::move(vector));
  }
}

struct Loaded {
  std::unique_ptr<Network> network;
  bool built_in = false;
};

std::expected<Loaded, std::string> load(const fs::path& file, const onnx_runtime::OnnxRuntime* runtime) {
  auto model = onnx_engine::try_load(file);
  if (model) return Loaded{make_onnx_network(*std::move(model)), true};
  const std::string why = model.error().sentence.substr(file.string().size() + 2);
  if (!model.error().beyond || runtime == nullptr) return std::unexpected(why);
  auto network = policy_trial::load_judging_network(*runtime, file, nullptr);
  if (!network) return std::unexpected(why + "; nor by ONNX Runtime: " + network.error());
  return Loaded{*std::move(network), false};
}

// The largest distance from the standard's outputs; nothing: they cannot be compared.
std::optional<double> judged(Network& network, const fs::path& folder, std::size_t& both_nan) {
  const auto inputs = read_vectors(folder, "input"), outputs = read_vectors(folder, "output");
  if (!inputs || !outputs || outputs->size() != network.outputs().size()) return std::nullopt;
  for (std::size_t i = 0; i < network.inputs().size(); ++i) {
    auto vector = std::ranges::find(*inputs, network.inputs()[i].name, &Vector::name);
    if (vector == inputs->end() && i < inputs->size()) vector = inputs->begin() + static_cast<std::ptrdiff_t>(i);
    if (vector == inputs->end() || vector->values.size() != network.input(i).size()) return std::nullopt;
    std::ranges::copy(vector->values, network.input(i).begin());
  }
  network.run();
  double error = 0;
  for (std::size_t o = 0; o < outputs->size(); ++o) {
    const std::span<const float> own = network.output(o);
    const std::vector<float>& wanted = (*outputs)[o].values;
    if (own.size() != wanted.size()) return std::nullopt;
    for (std::size_t i = 0; i < own.size(); ++i) {
      error = std::max(error, policy_trial::distance_of(own[i], wanted[i]));
      both_nan += std::isnan(own[i]) && std::isnan(wanted[i]) ? 1U : 0U;
    }
  }
  return error;
}

struct Tally {
  int models = 0, built_in = 0, by_onnxruntime = 0, agree = 0, unjudged = 0;
  std::size_t both_nan = 0;
  double built_in_error = 0;
  std::map<std::string, std::string> refused;
  std::map<std::string, double> apart;  // beyond the tolerance
};

void try_one(const fs::path& folder, const onnx_runtime::OnnxRuntime* runtime, Tally& tally) {
  const std::string name = folder.filename();
  ++tally.models;
  const auto loaded = load(folder / "model.onnx", runtime);
  if (!loaded) {
    tally.refused[name] = loaded.error();
    return;
  }
  ++(loaded->built_in ? tally.built_in : tally.by_onnxruntime);
  double error = 0;
  bool compared = false;
  try {
    for (std::size_t set = 0;; ++set) {
      const fs::path data = folder / ("test_data_set_" + std::to_string(set));
      if (!fs::exists(data)) break;
      const auto one = judged(*loaded->network, data, tally.both_nan);
      compared = one.has_value();
      if (!one) break;
      error = std::max(error, *one);
    }
  } catch (const std::exception&) {
    compared = false;
  }
  if (!compared) {
    ++tally.unjudged;
  } else if (error <= kTolerance) {
    ++tally.agree;
    if (loaded->built_in) tally.built_in_error = std::max(tally.built_in_error, error);
  } else {
    tally.apart[(loaded->built_in ? "builtin " : "onnxruntime ") + name] = error;
  }
}

nlohmann::json json_of(const Tally& tally) {
  nlohmann::json apart;
  for (const auto& [name, error] : tally.apart) apart[name] = std::isinf(error) ? -1.0 : error;
  return {{"models", tally.models},
          {"load", tally.built_in + tally.by_onnxruntime},
          {"built_in", tally.built_in},
          {"agree", tally.agree},
          {"not_compared", tally.unjudged},
          {"both_nan", tally.both_nan},
          {"built_in_error", tally.built_in_error},
          {"apart", apart},
          {"refused", tally.refused}};
}

int try_all(const fs::path& data, const char* library) {
  std::optional<onnx_runtime::OnnxRuntime> runtime;
  if (library != nullptr) {
    auto opened = onnx_runtime::OnnxRuntime::open(library);
    if (!opened) {
      std::fprintf(stderr, "takt-suite-onnx: %s\n", opened.error().c_str());
      return 69;
    }
    runtime.emplace(*std::move(opened));
  }
  nlohmann::json report;
  for (const char* kind : {"node", "simple", "pytorch-operator", "pytorch-converted"}) {
    Tally tally;
    std::vector<fs::path> folders;
    for (const auto& entry : fs::directory_iterator(data / kind))
      if (fs::exists(entry.path() / "model.onnx")) folders.push_back(entry.path());
    std::ranges::sort(folders);
    for (const fs::path& folder : folders) try_one(folder, runtime ? &*runtime : nullptr, tally);
    report[kind] = json_of(tally);
  }
  std::puts(report.dump(1).c_str());
  return 0;
}

}  // namespace
}  // namespace takt::policy_host

int main(int count, char** arguments) {
  if (count < 2 || count > 3) {
    std::fputs("usage: takt-suite-onnx FOLDER [LIBONNXRUNTIME]\n", stderr);
    return 64;
  }
  return takt::policy_host::try_all(arguments[1], count == 3 ? arguments[2] : nullptr);
}

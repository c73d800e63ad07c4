// What one inference of the built-in ONNX engine costs, next to a floor: the same layers as Eigen matrix-vector
// products with ELU between them, written by hand and compiled with the same options; and next to ONNX Runtime, one
// thread, where --onnxruntime names it.
//
// Networks: an arm-sized multilayer perceptron and an LSTM actor made here, and the walking policy of --policy where
// that file is there (its floor assumes the published layer sizes). Method: one pinned thread; all take turns in
// batches; every inference is timed by itself; figures are medians over repetitions of each repetition's p50 and p99.
// Caches are warm, so a host that infers at 50 Hz pays more: --pause sleeps between inferences.
#include <fmt/format.h>
#include <onnx/onnx_pb.h>

#include <CLI/CLI.hpp>
#include <Eigen/Core>
#include <chrono>
#include <cstdlib>
#include <filesystem>
#include <fstream>
#include <functional>
#include <nlohmann/json.hpp>
#include <optional>
#include <random>
#include <span>
#include <thread>

#include "policy_host/onnx/model.hpp"
#include "policy_host/onnx_runtime/onnx_runtime.hpp"
#include "tests/bench/bench.hpp"

namespace takt::bench {
namespace {

using Sizes = std::vector<int>;

void add_floats(onnx::GraphProto& graph, const std::string& name, const Sizes& dims, std::mt19937& random) {
  std::uniform_real_distribution<float> number(-0.1F, 0.1F);
  onnx::TensorProto& tensor = *graph.add_initializer();
  tensor.set_name(name);
  tensor.set_data_type(onnx::TensorProto_DataType_FLOAT);
  std::size_t count = 1;
  for (const int dim : dims) {
    tensor.add_dims(dim);
    count *= static_cast<std::size_t>(dim);
  }
  for (std::size_t i = 0; i < count; ++i) tensor.add_float_data(number(random));
}

void declare(onnx::ValueInfoProto& info, const std::string& name, int size) {
  info.set_name(name);
  auto& tensor = *info.mutable_type()->mutable_tensor_type();
  tensor.set_elem_type(onnx::TensorProto_DataType_FLOAT);
  tensor.mutable_shape()->add_dim()->set_dim_value(1);
  tensor.mutable_shape()->add_dim()->set_dim_value(size);
}

onnx::NodeProto& add_node(onnx::GraphProto& graph, const std::string& op, const std::vector<std::string>& inputs,
                          const std::string& output) {
  onnx::NodeProto& node = *graph.add_node();
  node.set_op_type(op);
  for (const std::string& input : inputs) node.add_input(input);
  node.add_output(output);
  return node;
}

std::string perceptron(const Sizes& sizes) {
  std::mt19937 random(1);
  onnx::ModelProto model;
  model.set_ir_version(7);
  model.add_opset_import()->set_version(13);
  onnx::GraphProto& graph = *model.mutable_graph();
  graph.set_name("perceptron");
  declare(*graph.add_input(), "h0", sizes.front());
  for (std::size_t i = 1; i < sizes.size(); ++i) {
    const std::string layer = std::to_string(i);
    const bool last = i + 1 == sizes.size();
    add_floats(graph, "w" + layer, {sizes[i], sizes[i - 1]}, random);
    add_floats(graph, "b" + layer, {sizes[i]}, random);
    onnx::NodeProto& gemm =
        add_node(graph, "Gemm", {"h" + std::to_string(i - 1), "w" + layer, "b" + layer}, (last ? "h" : "g") + layer);
    onnx::AttributeProto& transposed = *gemm.add_attribute();
    transposed.set_name("transB");
    transposed.set_type(onnx::AttributeProto_AttributeType_INT);
    transposed.set_i(1);
    if (!last) add_node(graph, "Elu", {"g" + layer}, "h" + layer);
  }
  declare(*graph.add_output(), "h" + std::to_string(sizes.size() - 1), sizes.back());
  return model.SerializeAsString();
}

// One LSTM step with its state as inputs and outputs, and a layer behind it.
std::string recurrent(int input, int hidden, int output) {
  std::mt19937 random(1);
  onnx::ModelProto model;
  model.set_ir_version(7);
  model.add_opset_import()->set_version(13);
  onnx::GraphProto& graph = *model.mutable_graph();
  graph.set_name("recurrent");
  const auto declare_sequence = [](onnx::ValueInfoProto& info, const std::string& name, int size) {
    declare(info, name, size);
    auto& dims = *info.mutable_type()->mutable_tensor_type()->mutable_shape();
    dims.mutable_dim(1)->set_dim_value(1);
    dims.add_dim()->set_dim_value(size);
  };
  declare_sequence(*graph.add_input(), "obs", input);
  for (const char* state : {"h_in", "c_in"}) declare_sequence(*graph.add_input(), state, hidden);
  add_floats(graph, "w", {1, 4 * hidden, input}, random);
  add_floats(graph, "r", {1, 4 * hidden, hidden}, random);
  add_floats(graph, "b", {1, 8 * hidden}, random);
  add_floats(graph, "head", {hidden, output}, random);
  onnx::NodeProto& lstm = add_node(graph, "LSTM", {"obs", "w", "r", "b", "", "h_in", "c_in"}, "y");
  lstm.add_output("h_out");
  lstm.add_output("c_out");
  onnx::AttributeProto& size = *lstm.add_attribute();
  size.set_name("hidden_size");
  size.set_type(onnx::AttributeProto_AttributeType_INT);
  size.set_i(hidden);
  add_node(graph, "MatMul", {"h_out", "head"}, "actions");
  declare_sequence(*graph.add_output(), "actions", output);
  for (const char* state : {"h_out", "c_out"}) declare_sequence(*graph.add_output(), state, hidden);
  return model.SerializeAsString();
}

// The floor: nothing but the arithmetic.
class EigenChain {
 public:
  explicit EigenChain(const Sizes& sizes) {
    values_.emplace_back(Eigen::VectorXf::Constant(sizes.front(), 0.1F));
    for (std::size_t i = 1; i < sizes.size(); ++i) {
      weights_.emplace_back(Eigen::MatrixXf::Random(sizes[i], sizes[i - 1]) * 0.1F);
      biases_.emplace_back(Eigen::VectorXf::Random(sizes[i]) * 0.1F);
      values_.emplace_back(sizes[i]);
    }
  }

  void run() {
    for (std::size_t i = 0; i < weights_.size(); ++i) {
      Eigen::VectorXf& out = values_[i + 1];
      out = biases_[i];
      out.noalias() += weights_[i] * values_[i];
      if (i + 1 < weights_.size()) out.array() = out.array().max(0.0F) + (out.array().min(0.0F).exp() - 1.0F);
    }
  }

 private:
  std::vector<Eigen::MatrixXf> weights_;
  std::vector<Eigen::VectorXf> biases_;
  std::vector<Eigen::VectorXf> values_;
};

struct Figures {
  std::vector<double> p50;
  std::vector<double> p99;

  void take(int inferences, std::chrono::microseconds pause, const std::function<void()>& infer) {
    std::vector<double> samples;
    for (int i = 0; i < inferences; ++i) {
      if (pause.count() > 0) std::this_thread::sleep_for(pause);
      const std::int64_t begin = ticks();
      infer();
      samples.push_back(static_cast<double>(ticks() - begin) * ns_per_tick() / 1000.0);
    }
    p50.push_back(percentile(samples, 0.5));
    p99.push_back(percentile(samples, 0.99));
  }
};

struct Options {
  bool as_json = false;
  int repetitions = 5;
  int inferences = 2000;
  std::chrono::microseconds pause{0};
  std::string policy = "../shared/policies/g1_velocity/policy.onnx";
  std::string library;
};

// The same network behind ONNX Runtime, its inputs filled likewise.
std::optional<onnx_runtime::Session> peer_session(const onnx_runtime::OnnxRuntime& runtime,
                                                  const std::filesystem::path& file, const onnx_engine::Model& model,
                                                  const Report& report) {
  const auto tensors = [](std::span<const onnx_engine::TensorInfo> infos) {
    std::vector<onnx_runtime::Tensor> list;
    for (const onnx_engine::TensorInfo& info : infos) list.push_back({info.name, info.shape, {}});
    return list;
  };
  auto session = runtime.load(file, tensors(model.inputs()), tensors(model.outputs()));
  if (!session) {
    report.remark(session.error());
    return std::nullopt;
  }
  for (onnx_runtime::Tensor& input : session->inputs()) std::ranges::fill(input.values, 0.1F);
  return *std::move(session);
}

// "" where there is nothing to compare with.
std::string ratio_text(const Figures& engine, const Figures& other) {
  return other.p50.empty() ? "" : fmt::format("{:.2f}", median(engine.p50) / median(other.p50));
}
std::string p50_text(const Figures& figures) {
  return figures.p50.empty() ? "" : fmt::format("{:.2f}", median(figures.p50));
}

// `sizes`: of the floor's layers; none: no floor.
bool compare(const std::string& name, const std::filesystem::path& file, const Sizes& sizes, const Options& options,
             const std::optional<onnx_runtime::OnnxRuntime>& runtime, const Report& report) {
  auto model = onnx_engine::load(file);
  if (!model) {
    report.remark(model.error());
    return false;
  }
  for (std::size_t i = 0; i < model->inputs().size(); ++i) std::ranges::fill(model->input(i), 0.1F);
  std::optional<EigenChain> chain;
  if (!sizes.empty()) chain.emplace(sizes);
  std::optional<onnx_runtime::Session> session = runtime ? peer_session(*runtime, file, *model, report) : std::nullopt;
  Figures engine, floor, peer;
  for (int i = 0; i < options.repetitions; ++i) {
    engine.take(options.inferences, options.pause, [&model] { model->run(); });
    if (chain) floor.take(options.inferences, options.pause, [&chain] { chain->run(); });
    if (session) peer.take(options.inferences, options.pause, [&session] { (void)session->run(); });
  }
  nlohmann::json row{{"bench", "onnx"},
                     {"network", name},
                     {"engine_p50_us", median(engine.p50)},
                     {"engine_p99_us", median(engine.p99)}};
  if (chain) row["floor_p50_us"] = median(floor.p50);
  if (session) row["onnxruntime_p50_us"] = median(peer.p50);
  report.figure(
      fmt::format("{:<28} {:>9.2f} {:>9.2f} {:>9} {:>7} {:>9} {:>7}", name, median(engine.p50), median(engine.p99),
                  p50_text(floor), ratio_text(engine, floor), p50_text(peer), ratio_text(engine, peer)),
      row);
  return true;
}

std::filesystem::path write(const std::filesystem::path& folder, const std::string& name, const std::string& bytes) {
  std::ofstream(folder / name, std::ios::binary) << bytes;
  return folder / name;
}

int compare_all(const std::filesystem::path& folder, const Options& options,
                const std::optional<onnx_runtime::OnnxRuntime>& runtime, const Report& report) {
  const Sizes arm{48, 512, 256, 128, 12};
  const bool made =
      compare("MLP 48-512-256-128-12", write(folder, "mlp.onnx", perceptron(arm)), arm, options, runtime, report) &&
      compare("LSTM 48-256-12", write(folder, "lstm.onnx", recurrent(48, 256, 12)), {}, options, runtime, report);
  if (!made) return 1;
  if (!std::filesystem::exists(options.policy)) {
    report.remark("skipped: no walking policy at " + options.policy);
    return 0;
  }
  return compare("G1 walk 480-512-256-128-29", options.policy, {480, 512, 256, 128, 29}, options, runtime, report) ? 0
                                                                                                                   : 1;
}

int run(const Options& options) {
  const Report report(options.as_json);
  std::optional<onnx_runtime::OnnxRuntime> runtime;
  if (!options.library.empty()) {
    auto opened = onnx_runtime::OnnxRuntime::open(options.library);
    if (!opened) {
      report.remark(opened.error());
      return 1;
    }
    runtime.emplace(*std::move(opened));
  }
  const Pinned pinned(allowed_cpus().back(), 0);
  report.remark(
      fmt::format("one inference in microseconds, medians of {} x {}, floor = the layers as plain Eigen products; {}",
                  options.repetitions, options.inferences,
                  runtime ? "ONNX Runtime " + runtime->version() : "no ONNX Runtime was named"));
  report.remark(fmt::format("{:<28} {:>9} {:>9} {:>9} {:>7} {:>9} {:>7}", "network", "p50", "p99", "floor p50", "ratio",
                            "ORT p50", "ratio"));
  std::string pattern = (std::filesystem::temp_directory_path() / "takt-bench-onnx.XXXXXX").string();
  if (mkdtemp(pattern.data()) == nullptr) return 1;
  const int result = compare_all(pattern, options, runtime, report);
  std::filesystem::remove_all(pattern);
  return result;
}

}  // namespace
}  // namespace takt::bench

int main(int argc, char** argv) {
  CLI::App app{"Cost of one inference of the built-in ONNX engine"};
  takt::bench::Options options;
  int pause_us = 0;
  app.add_flag("--json", options.as_json, "one JSON object per figure");
  app.add_option("--repetitions", options.repetitions)->check(CLI::Range(1, 100))->capture_default_str();
  app.add_option("--inferences", options.inferences, "per repetition")
      ->check(CLI::Range(10, 100'000))
      ->capture_default_str();
  app.add_option("--pause", pause_us, "microseconds of sleep before each inference")->check(CLI::Range(0, 100'000));
  app.add_option("--policy", options.policy, "walking policy to measure as well")->capture_default_str();
  app.add_option("--onnxruntime", options.library, "libonnxruntime.so to measure beside it");
  CLI11_PARSE(app, argc, argv);
  options.pause = std::chrono::microseconds(pause_us);
  return takt::bench::run(options);
}

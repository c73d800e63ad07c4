// What one inference of the built-in ONNX engine costs, next to a floor: the same layers as Eigen matrix-vector
// products with ELU between them, written by hand and compiled with the same options.
//
// Networks: an arm-sized multilayer perceptron made here, and the walking policy of --policy where that file is there
// (its floor assumes the published layer sizes). Method: one pinned thread; engine and floor take turns in batches;
// every inference is timed by itself; figures are medians over repetitions of each repetition's p50 and p99. Caches are
// warm, so a host that infers at 50 Hz pays more: --pause sleeps between inferences.
#include <fmt/format.h>
#include <onnx/onnx_pb.h>

#include <CLI/CLI.hpp>
#include <Eigen/Core>
#include <chrono>
#include <filesystem>
#include <functional>
#include <random>
#include <span>
#include <thread>

#include "policy_host/onnx/model.hpp"
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
};

void compare(const std::string& name, onnx_engine::Model model, const Sizes& sizes, const Options& options,
             const Report& report) {
  std::ranges::fill(model.input(0), 0.1F);
  EigenChain chain(sizes);
  Figures engine;
  Figures floor;
  for (int i = 0; i < options.repetitions; ++i) {
    engine.take(options.inferences, options.pause, [&model] { model.run(); });
    floor.take(options.inferences, options.pause, [&chain] { chain.run(); });
  }
  const double ratio = median(engine.p50) / median(floor.p50);
  report.figure(fmt::format("{:<28} {:>9.2f} {:>9.2f} {:>9.2f} {:>9.2f} {:>7.2f}", name, median(engine.p50),
                            median(engine.p99), median(floor.p50), median(floor.p99), ratio),
                {{"bench", "onnx"},
                 {"network", name},
                 {"engine_p50_us", median(engine.p50)},
                 {"engine_p99_us", median(engine.p99)},
                 {"floor_p50_us", median(floor.p50)},
                 {"floor_p99_us", median(floor.p99)},
                 {"ratio_p50", ratio}});
}

int run(const Options& options) {
  const Report report(options.as_json);
  const Pinned pinned(allowed_cpus().back(), 0);
  report.remark(
      fmt::format("one inference in microseconds, medians of {} x {}, floor = the layers as plain Eigen products",
                  options.repetitions, options.inferences));
  report.remark(
      fmt::format("{:<28} {:>9} {:>9} {:>9} {:>9} {:>7}", "network", "p50", "p99", "floor p50", "floor p99", "ratio"));
  const Sizes arm{48, 512, 256, 128, 12};
  const std::string bytes = perceptron(arm);
  auto generated = onnx_engine::load(std::as_bytes(std::span(bytes)), "perceptron");
  if (!generated) {
    report.remark(generated.error());
    return 1;
  }
  compare("MLP 48-512-256-128-12", *std::move(generated), arm, options, report);
  if (!std::filesystem::exists(options.policy)) {
    report.remark("skipped: no walking policy at " + options.policy);
    return 0;
  }
  auto walking = onnx_engine::load(std::filesystem::path(options.policy));
  if (!walking) {
    report.remark(walking.error());
    return 1;
  }
  compare("G1 walk 480-512-256-128-29", *std::move(walking), {480, 512, 256, 128, 29}, options, report);
  return 0;
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
  CLI11_PARSE(app, argc, argv);
  options.pause = std::chrono::microseconds(pause_us);
  return takt::bench::run(options);
}

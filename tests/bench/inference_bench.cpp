// SPDX-License-Identifier: Apache-2.0
// What one inference costs in each engine, as the policy host runs it (input copied in, network, hidden state round):
// the built-in engine, ONNX Runtime where --onnxruntime names it, TorchScript where its plugin was built; one thread
// each. For actors also a floor: the same layers as Eigen matrix-vector products with ELU between them.
//
// Networks: those of inference_networks.py in FOLDER, and the walking policy of --policy where that file is there.
// Method: one pinned thread; all take turns in batches; every inference is timed by itself; figures are medians over
// repetitions of each repetition's p50, p99 and max. Ratios are of the processor time, which other work on the machine
// does not add to. Caches are warm, so a host that infers at 50 Hz pays more: --pause
// sleeps between inferences.
//
// FOLDER/limit: networks of growing products of matrices; the ratios show from which size on ONNX Runtime is the
// quicker engine (kMostMatrixWorkPerStep in policy_host/engines/load_policy.cpp).
#include <fmt/format.h>

#include <CLI/CLI.hpp>
#include <Eigen/Core>
#include <algorithm>
#include <chrono>
#include <filesystem>
#include <functional>
#include <memory>
#include <nlohmann/json.hpp>
#include <random>
#include <thread>

#include "config/robot_config.hpp"
#include "policy_host/engines/load_policy.hpp"
#include "policy_host/onnx_engine/model.hpp"
#include "tests/bench/bench.hpp"

namespace takt::bench {
namespace {

namespace fs = std::filesystem;
using Sizes = std::vector<int>;

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

struct Options {
  bool as_json = false;
  int repetitions = 5;
  int inferences = 2000;
  std::chrono::microseconds pause{0};
  fs::path folder;
  std::string policy = "../shared/policies/g1_velocity/policy.onnx";
  std::string library;
};

struct Network {
  std::string name;
  fs::path file;  // without its ending
  std::string inputs, output;
  std::vector<config::TensorShape> shapes;
  std::vector<std::size_t> input_values;  // of what observations fill, in the order of `inputs`
  Sizes layers;                           // of the floor; none: no floor
};

struct Contender {
  std::string name;
  std::function<void()> infer;
  std::vector<double> p50{}, p99{}, max{}, processor{};
};

// Of all threads of this process.
double processor_us() {
  timespec time{};
  clock_gettime(CLOCK_PROCESS_CPUTIME_ID, &time);
  return 1e6 * static_cast<double>(time.tv_sec) + 1e-3 * static_cast<double>(time.tv_nsec);
}

// As many as take a second, so that a large network does not take all day.
int affordable(const Contender& contender, int most) {
  const auto begin = std::chrono::steady_clock::now();
  contender.infer();
  const double seconds = std::chrono::duration<double>(std::chrono::steady_clock::now() - begin).count();
  return std::clamp(static_cast<int>(1.0 / seconds), 10, most);
}

void take(Contender& contender, int inferences, std::chrono::microseconds pause) {
  std::vector<double> samples, processor;
  for (int i = 0; i < inferences; ++i) {
    if (pause.count() > 0) std::this_thread::sleep_for(pause);
    const double processor_before = processor_us();
    const std::int64_t begin = ticks();
    contender.infer();
    samples.push_back(static_cast<double>(ticks() - begin) * ns_per_tick() / 1000.0);
    processor.push_back(processor_us() - processor_before);
  }
  contender.processor.push_back(percentile(processor, 0.5));
  contender.p50.push_back(percentile(samples, 0.5));
  contender.p99.push_back(percentile(samples, 0.99));
  contender.max.push_back(std::ranges::max(samples));
}

// The robot file around a network: all that an engine is told of it.
config::RobotConfig robot_of(const Network& network, const std::string& engine, const std::string& library) {
  config::RobotConfig robot;
  config::Policy& policy = robot.policy.emplace();
  policy.file = network.file.string() + (engine == "torchscript" ? ".pt" : ".onnx");
  policy.input = network.inputs;
  policy.output = network.output;
  policy.engine.emplace().name = engine;
  policy.engine->load_within = seconds(3600);  // of a busy machine
  if (engine == "onnxruntime") policy.engine->library = library;
  if (engine == "torchscript") policy.engine->shapes = network.shapes;
  for (const std::size_t values : network.input_values) {
    config::ObservationTerm& term = policy.observation.emplace_back();
    term.kind = config::TermKind::constant;
    term.constant.assign(values, 0.0);
    term.history = 1;
  }
  return robot;
}

void add_engine(std::vector<Contender>& contenders, const Network& network, const std::string& engine,
                const Options& options, const Report& report) {
  auto loaded = policy_host::load_policy(robot_of(network, engine, options.library));
  if (!loaded) {
    report.remark(loaded.error());
    return;
  }
  const std::shared_ptr<policy_host::Policy> policy = std::move(*loaded);
  std::vector<float> input(policy->input_size()), output(policy->output_size());
  std::mt19937 random(1);
  std::uniform_real_distribution<float> value(-1, 1);
  for (float& each : input) each = value(random);
  contenders.push_back({engine, [policy, input, output]() mutable { policy->infer(input, output); }});
}

void compare(const Network& network, const Options& options, const Report& report) {
  std::vector<Contender> contenders;
  if (fs::exists(network.file.string() + ".onnx")) add_engine(contenders, network, "builtin", options, report);
  if (fs::exists(network.file.string() + ".onnx") && !options.library.empty())
    add_engine(contenders, network, "onnxruntime", options, report);
  if (fs::exists(network.file.string() + ".pt")) add_engine(contenders, network, "torchscript", options, report);
  if (!network.layers.empty())
    contenders.push_back({"floor", [chain = std::make_shared<EigenChain>(network.layers)] { chain->run(); }});
  std::vector<int> inferences;
  for (const Contender& contender : contenders) inferences.push_back(affordable(contender, options.inferences));
  for (int i = 0; i < options.repetitions; ++i)
    for (std::size_t c = 0; c < contenders.size(); ++c) take(contenders[c], inferences[c], options.pause);
  const auto peer = std::ranges::find(contenders, "onnxruntime", &Contender::name);
  for (const Contender& contender : contenders) {
    nlohmann::json row{{"bench", "inference"},
                       {"network", network.name},
                       {"engine", contender.name},
                       {"p50_us", median(contender.p50)},
                       {"p99_us", median(contender.p99)},
                       {"max_us", median(contender.max)},
                       {"processor_us", median(contender.processor)}};
    std::string ratio;
    if (peer != contenders.end()) {
      const double to_peer = median(contender.processor) / median(peer->processor);
      row["to_onnxruntime"] = to_peer;
      ratio = fmt::format("{:.2f}", to_peer);
    }
    report.figure(fmt::format("{:<34} {:<12} {:>11.1f} {:>11.1f} {:>11.1f} {:>11.1f} {:>7}", network.name,
                              contender.name, median(contender.p50), median(contender.p99), median(contender.max),
                              median(contender.processor), ratio),
                  row);
  }
}

struct Limit {
  double million = 0;  // multiply-adds in products of matrices
  fs::path file;
  std::size_t inputs = 0;
};

void compare_limit(const Options& options, const Report& report) {
  std::vector<Limit> limits;
  if (!fs::exists(options.folder / "limit")) return;
  for (const fs::directory_entry& entry : fs::directory_iterator(options.folder / "limit"))
    if (const auto model = onnx_engine::load(entry.path()))
      limits.push_back({static_cast<double>(model->matrix_work()) / 1e6, entry.path(),
                        static_cast<std::size_t>(model->inputs()[0].shape[1])});
  std::ranges::sort(limits, {}, &Limit::million);
  for (const Limit& limit : limits)
    compare({fmt::format("{:.2f} million: {}", limit.million, limit.file.stem().string()),
             fs::path(limit.file).replace_extension(),
             "obs",
             "actions",
             {},
             {limit.inputs},
             {}},
            options, report);
}

int run(const Options& options) {
  const Report report(options.as_json);
  const Pinned pinned(allowed_cpus().back(), 0);
  report.remark(
      fmt::format("one inference in microseconds, medians of {} repetitions; processor: its time, p50; ratio: of that "
                  "to ONNX Runtime's; floor: the "
                  "layers as plain Eigen products",
                  options.repetitions));
  report.remark(fmt::format("{:<34} {:<12} {:>11} {:>11} {:>11} {:>11} {:>7}", "network", "engine", "p50", "p99", "max",
                            "processor", "ratio"));
  const config::TensorShape hidden_h{"h_in", {1, 1, 256}}, hidden_c{"c_in", {1, 1, 256}};
  const fs::path& folder = options.folder;
  const std::vector<Network> networks{
      {"MLP 48-512-256-128-12", folder / "mlp", "obs", "actions", {}, {48}, {48, 512, 256, 128, 12}},
      {"LSTM 48-256-12", folder / "lstm", "obs", "actions", {hidden_h, hidden_c}, {48}, {}},
      {"transformer 4 x 256, 32 tokens", folder / "transformer", "obs", "actions", {}, {48}, {}},
      {"ResNet18 + transformer, chunk 100",
       folder / "act",
       "obs,image",
       "actions",
       {{"obs", {1, 14}}, {"image", {1, 3, 224, 224}}},
       {14, 3 * 224 * 224},
       {}},
      {"G1 walk 480-512-256-128-29",
       fs::path(options.policy).replace_extension(),
       "",
       "",
       {},
       {480},
       {480, 512, 256, 128, 29}}};
  for (const Network& network : networks)
    if (fs::exists(network.file.string() + ".onnx"))
      compare(network, options, report);
    else
      report.remark("skipped: no " + network.file.string() + ".onnx");
  compare_limit(options, report);
  return 0;
}

}  // namespace
}  // namespace takt::bench

int main(int argc, char** argv) {
  CLI::App app{"Cost of one inference in every engine"};
  takt::bench::Options options;
  int pause_us = 0;
  app.add_option("FOLDER", options.folder, "networks of inference_networks.py")->required();
  app.add_flag("--json", options.as_json, "one JSON object per figure");
  app.add_option("--repetitions", options.repetitions)->check(CLI::Range(1, 100))->capture_default_str();
  app.add_option("--inferences", options.inferences, "per repetition, or as many as take a second")
      ->check(CLI::Range(10, 100'000))
      ->capture_default_str();
  app.add_option("--pause", pause_us, "microseconds of sleep before each inference")->check(CLI::Range(0, 100'000));
  app.add_option("--policy", options.policy, "walking policy to measure as well")->capture_default_str();
  app.add_option("--onnxruntime", options.library, "libonnxruntime.so to measure beside it");
  CLI11_PARSE(app, argc, argv);
  options.pause = std::chrono::microseconds(pause_us);
  return takt::bench::run(options);
}

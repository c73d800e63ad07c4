#include "policy_host/policy_trial.hpp"

#include <algorithm>
#include <chrono>
#include <cmath>
#include <cstdint>
#include <span>
#include <utility>

namespace takt::policy_host {

// The same numbers on every machine: a linear congruential generator's upper bits (Numerical Recipes' constants).
class TrialNumbers {
 public:
  void fill(std::span<float> values) {
    for (float& value : values) {
      state_ = state_ * 1664525U + 1013904223U;
      value = static_cast<float>(state_ >> 8U) * 0x1p-23F - 1.0F;
    }
  }

 private:
  std::uint32_t state_ = 1;
};

namespace {

using onnx_runtime::Tensor;

std::vector<Tensor> tensors_of(std::span<const onnx_engine::TensorInfo> infos) {
  std::vector<Tensor> tensors;
  for (const onnx_engine::TensorInfo& info : infos) tensors.push_back({info.name, info.shape, {}});
  return tensors;
}

double distance(std::span<const float> own, std::span<const float> peer) {
  double largest = 0;
  for (std::size_t i = 0; i < own.size(); ++i) {
    const double b = static_cast<double>(peer[i]);
    const double apart = own[i] == peer[i] ? 0 : std::abs(static_cast<double>(own[i]) - b) / std::max(1.0, std::abs(b));
    if (!(apart <= largest)) largest = apart;  // not a number counts as apart
  }
  return largest;
}

template <class Work>
double microseconds(Work work) {
  const auto begin = std::chrono::steady_clock::now();
  work();
  return std::chrono::duration<double, std::micro>(std::chrono::steady_clock::now() - begin).count();
}

double median(std::vector<double> samples) {
  if (samples.empty()) return 0;
  const auto middle = samples.begin() + std::ssize(samples) / 2;
  std::ranges::nth_element(samples, middle);
  return *middle;
}

}  // namespace

PolicyTrial::PolicyTrial(std::filesystem::path file, onnx_engine::Model model, PolicyTensors tensors)
    : file_(std::move(file)), model_(std::move(model)), tensors_(std::move(tensors)) {}

std::expected<PolicyTrial, std::string> PolicyTrial::load(const std::filesystem::path& file, const std::string& input,
                                                          const std::string& output) {
  auto model = onnx_engine::load(file);
  if (!model) return std::unexpected(model.error());
  auto tensors = assign_tensors(tensors_of(*model), file.string(), input, output);
  if (!tensors) return std::unexpected(tensors.error());
  return PolicyTrial(file, *std::move(model), *std::move(tensors));
}

void PolicyTrial::forget() {
  for (const PolicyTensors::State& state : tensors_.states) std::ranges::fill(model_.input(state.input), 0.0F);
}

void PolicyTrial::begin_observation(int i, TrialNumbers& numbers) {
  for (const std::size_t part : tensors_.observation) numbers.fill(model_.input(part));
  for (const auto& count : {tensors_.time_step, tensors_.step_count})
    if (count) model_.input(*count)[0] = static_cast<float>(i);
}

void PolicyTrial::feed_state_back() {
  for (const PolicyTensors::State& state : tensors_.states) {
    std::ranges::copy(model_.output(state.output), model_.input(state.input).begin());
  }
}

std::vector<float> PolicyTrial::last_outputs() {
  TrialNumbers numbers;
  forget();
  for (int i = 0; i < kTrialObservations; ++i) {
    begin_observation(i, numbers);
    model_.run();
    feed_state_back();
  }
  std::vector<float> outputs;
  for (std::size_t o = 0; o < model_.outputs().size(); ++o) {
    outputs.insert(outputs.end(), model_.output(o).begin(), model_.output(o).end());
  }
  return outputs;
}

std::expected<Agreement, std::string> PolicyTrial::against(const onnx_runtime::OnnxRuntime& peer,
                                                           int timed_inferences) {
  auto session = peer.load(file_, tensors_of(model_.inputs()), tensors_of(model_.outputs()));
  if (!session) return std::unexpected(session.error());
  const std::span<Tensor> in = session->inputs();
  const std::span<Tensor> out = session->outputs();
  Agreement agreement;
  TrialNumbers numbers;
  forget();
  for (int i = 0; i < kTrialObservations; ++i) {
    begin_observation(i, numbers);
    for (const std::size_t part : tensors_.observation) std::ranges::copy(model_.input(part), in[part].values.begin());
    for (const auto& count : {tensors_.time_step, tensors_.step_count})
      if (count) in[*count].values[0] = static_cast<float>(i);
    model_.run();
    if (const auto ran = session->run(); !ran) return std::unexpected(ran.error());
    for (std::size_t o = 0; o < out.size(); ++o) {
      const double apart = distance(model_.output(o), out[o].values);
      if (!(apart <= agreement.error)) agreement.error = apart;
    }
    feed_state_back();
    for (const PolicyTensors::State& state : tensors_.states) {
      std::ranges::copy(out[state.output].values, in[state.input].values.begin());
    }
  }
  std::vector<double> own, theirs;
  for (int i = 0; i < timed_inferences; ++i) {
    own.push_back(microseconds([&] { model_.run(); }));
    theirs.push_back(microseconds([&] { (void)session->run(); }));
  }
  agreement.own_us = median(std::move(own));
  agreement.peer_us = median(std::move(theirs));
  return agreement;
}

}  // namespace takt::policy_host

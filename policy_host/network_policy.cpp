// SPDX-License-Identifier: Apache-2.0
#include "policy_host/network_policy.hpp"

#include <algorithm>
#include <utility>

namespace takt::policy_host {
namespace {

class NetworkPolicy final : public Policy {
 public:
  NetworkPolicy(std::vector<std::unique_ptr<Network>> networks, Wiring wiring)
      : networks_(std::move(networks)), wiring_(std::move(wiring)) {
    for (const Port& port : wiring_.observation) input_size_ += in(port).size();
    for (const Port& port : wiring_.outputs) output_size_ += out(port).size();
    input_.resize(input_size_);
    reset();
  }

  [[nodiscard]] std::size_t input_size() const override { return input_size_; }
  [[nodiscard]] std::size_t output_size() const override { return output_size_; }
  [[nodiscard]] bool is_recurrent() const override {
    return !wiring_.states.empty() || !wiring_.time_steps.empty() || !wiring_.step_counts.empty() ||
           !wiring_.references.empty() ||
           std::ranges::any_of(networks_, [](const auto& network) { return network->keeps_state(); });
  }
  [[nodiscard]] std::string description() const override { return networks_.front()->description(); }
  [[nodiscard]] bool is_built_in() const override {
    return std::ranges::all_of(networks_, [](const auto& network) { return network->is_built_in(); });
  }

  void infer(std::span<const float> input, std::span<float> output) override {
    std::ranges::copy(input, input_.begin());
    for (const Wiring::Reference& reference : wiring_.references)
      std::ranges::copy(out(reference.from), input_.begin() + static_cast<std::ptrdiff_t>(reference.at));
    run();
    auto to = output.begin();
    for (const Port& port : wiring_.outputs) to = std::ranges::copy(out(port), to).out;
    for (const Wiring::State& state : wiring_.states) std::ranges::copy(out(state.from), in(state.to).begin());
  }

  void reset() override {
    step_ = 0;
    start_states();
    if (wiring_.references.empty()) return;
    std::ranges::fill(input_, 0.0F);
    run();
    start_states();
  }

 private:
  std::span<float> in(const Port& port) { return networks_[port.network]->input(port.tensor); }
  [[nodiscard]] std::span<const float> out(const Port& port) const {
    return networks_[port.network]->output(port.tensor);
  }

  void start_states() {
    for (const auto& network : networks_)
      if (network->keeps_state()) network->forget();
    for (const Wiring::State& state : wiring_.states) std::ranges::copy(state.start, in(state.to).begin());
  }

  void run() {
    auto from = std::span<const float>(input_);
    for (const Port& port : wiring_.observation) {
      const std::span<float> to = in(port);
      std::ranges::copy(from.first(to.size()), to.begin());
      from = from.subspan(to.size());
    }
    for (const Port& port : wiring_.time_steps) in(port)[0] = static_cast<float>(step_);
    for (const Port& port : wiring_.step_counts) in(port)[0] = static_cast<float>(step_ % kStepCounts);
    ++step_;
    for (std::size_t i = 0; i < networks_.size(); ++i) {
      for (const Wiring::Flow& flow : wiring_.flows)
        if (flow.to.network == i) std::ranges::copy(out(flow.from), in(flow.to).begin());
      networks_[i]->run();
    }
  }

  std::vector<std::unique_ptr<Network>> networks_;
  Wiring wiring_;
  std::size_t input_size_ = 0, output_size_ = 0;
  std::uint64_t step_ = 0;
  std::vector<float> input_;
};

}  // namespace

std::unique_ptr<Policy> make_network_policy(std::vector<std::unique_ptr<Network>> networks, Wiring wiring) {
  return std::make_unique<NetworkPolicy>(std::move(networks), std::move(wiring));
}

}  // namespace takt::policy_host

// SPDX-License-Identifier: Apache-2.0
#include "policy_host/flow/flow_policy.hpp"

#include <fmt/format.h>

#include <algorithm>
#include <cmath>
#include <cstdint>
#include <limits>
#include <numbers>
#include <utility>

#include "config/observation_shape.hpp"
#include "policy_host/flow/flow_context.hpp"
#include "policy_host/flow/prefix_guidance.hpp"

namespace takt::policy_host {
namespace {

using config::PrefixUse;
using config::SampleChoice;

// The same numbers on every machine and with every library: a counter, mixed (splitmix64's constants), and Box and
// Muller's normal numbers of it.
class Noise {
 public:
  Noise(std::uint64_t seed, std::uint64_t observation, std::size_t sample)
      : state_(mixed(mixed(mixed(seed) ^ observation) ^ sample)) {}

  float next() {
    if (has_spare_) {
      has_spare_ = false;
      return spare_;
    }
    const double radius = std::sqrt(-2.0 * std::log(1.0 - unit())), angle = 2.0 * std::numbers::pi * unit();
    spare_ = static_cast<float>(radius * std::sin(angle));
    has_spare_ = true;
    return static_cast<float>(radius * std::cos(angle));
  }

 private:
  static std::uint64_t mixed(std::uint64_t value) {
    value += 0x9e3779b97f4a7c15ULL;
    value = (value ^ (value >> 30U)) * 0xbf58476d1ce4e5b9ULL;
    value = (value ^ (value >> 27U)) * 0x94d049bb133111ebULL;
    return value ^ (value >> 31U);
  }
  double unit() { return static_cast<double>(mixed(state_++) >> 11U) * 0x1.0p-53; }

  std::uint64_t state_;
  float spare_ = 0.0F;
  bool has_spare_ = false;
};

}  // namespace

FlowPolicy::FlowPolicy(std::unique_ptr<Policy> velocity, const FlowShape& shape, const config::Sampler& sampler)
    : velocity_(std::move(velocity)),
      shape_(shape),
      sampler_(sampler),
      times_(velocity_->input_size() - shape.observation - shape.steps * shape.outputs),
      shown_(velocity_->input_size()),
      v_(shape.steps * shape.outputs),
      samples_(sampler.samples, std::vector<float>(shape.steps * shape.outputs)) {}

std::size_t FlowPolicy::input_size() const {
  return shape_.observation + FlowContext::kCounts + output_size();
}

void FlowPolicy::denoise(std::span<const float> observation, const FlowContext& context, std::span<float> x) {
  const std::size_t kept_steps = sampler_.prefix == PrefixUse::trained ? context.kept() : 0;
  const std::size_t kept = kept_steps * shape_.outputs;
  const bool guided = sampler_.prefix == PrefixUse::guided && context.known > 0;
  std::ranges::copy(observation, shown_.begin());
  const std::span<float> x_shown = std::span(shown_).subspan(shape_.observation, x.size());
  const std::span<float> times = std::span(shown_).last(times_);
  for (std::uint32_t i = 0; i < sampler_.steps; ++i) {
    const double t = static_cast<double>(i) / sampler_.steps;
    std::ranges::copy(context.path.first(kept), x.begin());
    std::ranges::copy(x, x_shown.begin());
    std::ranges::fill(times, static_cast<float>(t));
    if (kept > 0) std::ranges::fill(times.first(kept_steps), 1.0F);
    velocity_->infer(shown_, v_);
    const double scale = guided ? guidance_scale(t, sampler_.limit) : 0.0;
    for (std::size_t value = kept; value < x.size(); ++value) {
      double v = static_cast<double>(v_[value]);
      if (guided) {
        const double weight = prefix_weight(sampler_.schedule, value / shape_.outputs, context.promised, context.known);
        const double ahead = static_cast<double>(x[value]) + (1.0 - t) * v;
        v += scale * weight * (static_cast<double>(context.path[value]) - ahead);
      }
      x[value] += static_cast<float>(v / sampler_.steps);
    }
  }
}

void FlowPolicy::sample(std::span<const float> input, std::size_t number, std::span<float> x) {
  const FlowContext context = FlowContext::read(input.subspan(shape_.observation), shape_.steps);
  Noise noise(sampler_.seed, context.observation_id, number);
  std::ranges::generate(x, [&] { return noise.next(); });
  denoise(input.first(shape_.observation), context, x);
}

double FlowPolicy::distance(std::span<const float> path, std::size_t known, std::span<const float> x) const {
  double sum = 0.0;
  for (std::size_t value = 0; value < known * shape_.outputs; ++value) {
    const std::size_t step = value / shape_.outputs;
    const double weight = std::exp(-sampler_.decay * static_cast<double>(step));
    sum += weight * std::abs(static_cast<double>(x[value]) - static_cast<double>(path[value]));
  }
  return sum;
}

void FlowPolicy::infer(std::span<const float> input, std::span<float> output) {
  for (std::size_t i = 0; i < samples_.size(); ++i) sample(input, i, samples_[i]);
  const FlowContext context = FlowContext::read(input.subspan(shape_.observation), shape_.steps);
  switch (sampler_.choice) {
    case SampleChoice::first:
      std::ranges::copy(samples_.front(), output.begin());
      return;
    case SampleChoice::coherent:
      std::ranges::copy(
          *std::ranges::min_element(
              samples_, {}, [&](const std::vector<float>& x) { return distance(context.path, context.known, x); }),
          output.begin());
      return;
    case SampleChoice::agreed: {
      const auto differs = [&](std::size_t value) {
        return std::ranges::any_of(samples_, [&](const std::vector<float>& x) {
          return !(std::abs(static_cast<double>(x[value]) - static_cast<double>(samples_.front()[value])) <=
                   sampler_.tolerance);
        });
      };
      std::size_t value = 0;
      while (value < output.size() && !differs(value)) ++value;
      // A chunk has one step at least; what is not finite is the executive's to refuse.
      const std::size_t meant = std::max<std::size_t>(value / shape_.outputs, 1) * shape_.outputs;
      std::ranges::copy(samples_.front(), output.begin());
      std::ranges::fill(output.subspan(meant), std::numeric_limits<float>::quiet_NaN());
      return;
    }
  }
}

std::string network_input(const config::Policy& section) {
  if (!section.sampler) return section.input;
  return fmt::format("{},{},{}", section.input, section.sampler->noisy, section.sampler->time);
}

std::expected<std::unique_ptr<Policy>, std::string> with_sampler(const config::RobotConfig& robot,
                                                                 std::unique_ptr<Policy> network) {
  const config::Policy& section = *robot.policy;
  if (!section.sampler) return network;
  const FlowShape shape{config::observation_width(robot), section.steps, config::outputs_per_step(robot)};
  const std::size_t values = shape.steps * shape.outputs, without_times = shape.observation + values;
  const std::size_t times = network->input_size() - std::min(network->input_size(), without_times);
  if (times != 1 && times != shape.steps)
    return std::unexpected(
        fmt::format("{}: its inputs {} hold {} values, the configuration wants {} of observation, {} "
                    "of chunk, and 1 or {} of time; correct policy.observation or policy.steps in {}",
                    section.file, network_input(section), network->input_size(), shape.observation, values, shape.steps,
                    robot.file));
  if (network->output_size() != values)
    return std::unexpected(fmt::format(
        "{}: {} gives {} values, the configuration wants {}: {} steps x {} outputs; correct "
        "policy.steps or policy.action in {}",
        section.file, section.output, network->output_size(), values, shape.steps, shape.outputs, robot.file));
  if (section.sampler->prefix == PrefixUse::trained && times == 1 && shape.steps != 1)
    return std::unexpected(
        fmt::format("{}: has one time for all steps, so it was not trained with a prefix; write "
                    "policy.sampler.prefix guided or none in {}",
                    section.file, robot.file));
  if (network->is_recurrent())
    return std::unexpected(
        fmt::format("{}: remembers from one inference to the next, and a sampler infers {} times for "
                    "each answer; export it without a state",
                    section.file, section.sampler->steps));
  return std::make_unique<FlowPolicy>(std::move(network), shape, *section.sampler);
}

std::size_t meant_steps(std::span<const float> output, std::size_t outputs) {
  const std::size_t steps = output.size() / outputs;
  std::size_t meant = 0;
  while (meant < steps &&
         !std::ranges::all_of(output.subspan(meant * outputs, outputs), [](float value) { return std::isnan(value); }))
    ++meant;
  return std::max<std::size_t>(meant, 1);
}

}  // namespace takt::policy_host

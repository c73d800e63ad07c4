// SPDX-License-Identifier: Apache-2.0
// Goal: chunks are sampled as the published rules say, and from the input alone. Method: networks whose flow is known,
// and guidance computed a second time from the rule.
#include "policy_host/flow/flow_policy.hpp"

#include <gtest/gtest.h>

#include <cmath>
#include <cstring>
#include <limits>
#include <numeric>

#include "policy_host/flow/flow_context.hpp"
#include "policy_host/flow/prefix_guidance.hpp"
#include "tests/policy_host/flow/denoisers.hpp"
#include "tests/policy_host/small_robot.hpp"

namespace takt::policy_host {
namespace {

using config::PrefixUse;
using config::SampleChoice;

constexpr std::size_t kSteps = 10;

config::Sampler sampler_of(PrefixUse prefix = PrefixUse::none) {
  config::Sampler sampler;
  sampler.noisy = "x_t";
  sampler.time = "t";
  sampler.steps = 5;
  sampler.seed = 1;
  sampler.prefix = prefix;
  sampler.limit = 5;
  sampler.tolerance = 0.1;
  return sampler;
}

// Observation 0.5, then what is known of the path.
std::vector<float> input_of(std::uint64_t id, std::size_t promised = 0, std::size_t known = 0,
                            const std::vector<float>& path = std::vector<float>(kSteps, 0.0F)) {
  std::vector<float> input{0.5F, static_cast<float>(id & 0xFFFFFFU), static_cast<float>(id >> 24U),
                           0.0F, static_cast<float>(promised),       static_cast<float>(known)};
  input.insert(input.end(), path.begin(), path.end());
  return input;
}

struct Made {
  Denoiser* network;
  FlowPolicy policy;
};

Made make(const config::Sampler& sampler, Denoiser::Chunk chunk, std::size_t times = kSteps) {
  auto network = std::make_unique<Denoiser>(kSteps, times, std::move(chunk));
  Denoiser* const seen = network.get();
  return {seen, FlowPolicy(std::move(network), {.observation = 1, .steps = kSteps, .outputs = 1}, sampler)};
}

std::vector<float> infer(FlowPolicy& policy, const std::vector<float>& input) {
  std::vector<float> output(policy.output_size());
  EXPECT_EQ(policy.input_size(), input.size());
  policy.infer(input, output);
  return output;
}

float always_three(std::span<const float> /*noise*/, std::size_t /*value*/) {
  return 3.0F;
}
// Two ways, one as likely as the other: which of them the noise says.
float either_way(std::span<const float> noise, std::size_t /*value*/) {
  return noise[0] < 0.0F ? -1.0F : 1.0F;
}

TEST(FlowPolicy, DenoisesInEqualStepsFromNoiseToAction) {
  auto [network, policy] = make(sampler_of(), always_three);
  for (const float value : infer(policy, input_of(7))) EXPECT_NEAR(value, 3.0F, 1e-5F);
  ASSERT_EQ(network->shown.size(), 5U);
  for (std::size_t i = 0; i < 5; ++i) {
    EXPECT_EQ(network->shown[i].front(), 0.5F) << "the observation, in every step";
    for (std::size_t step = 0; step < kSteps; ++step)
      EXPECT_FLOAT_EQ(network->shown[i][1 + kSteps + step], static_cast<float>(i) / 5.0F);
  }
}

TEST(FlowPolicy, NoiseIsNormalAndComesFromSeedObservationAndSampleAlone) {
  const auto noise = [](std::uint64_t seed, std::uint64_t id) {
    config::Sampler sampler = sampler_of();
    sampler.seed = seed;
    auto [network, policy] = make(sampler, always_three);
    infer(policy, input_of(id));
    return std::vector<float>(network->shown[0].begin() + 1, network->shown[0].begin() + 1 + kSteps);
  };
  EXPECT_EQ(noise(1, 7), noise(1, 7));
  EXPECT_NE(noise(1, 7), noise(2, 7));
  EXPECT_NE(noise(1, 7), noise(1, 8));
  EXPECT_NE(noise(1, 7), noise(1, 7 + (std::uint64_t{1} << 24U))) << "all digits of the id count";
  double sum = 0, squares = 0, fourths = 0, product = 0;
  constexpr std::uint64_t kIds = 4000;
  for (std::uint64_t id = 0; id < kIds; ++id) {
    const auto one = noise(3, id);
    for (std::size_t i = 0; i < kSteps; ++i) {
      const auto value = static_cast<double>(one[i]);
      sum += value;
      squares += value * value;
      fourths += value * value * value * value;
      if (i > 0) product += value * static_cast<double>(one[i - 1]);
    }
  }
  const double count = kIds * kSteps;
  EXPECT_NEAR(sum / count, 0.0, 0.02);
  EXPECT_NEAR(squares / count, 1.0, 0.03);
  EXPECT_NEAR(fourths / count, 3.0, 0.2);
  EXPECT_NEAR(product / count, 0.0, 0.02) << "neighbours are independent";
}

// A recording may say anything: counts beyond the path are those of the whole path, and what is no count is none.
TEST(FlowPolicy, OfAContextBeyondThePathNoMoreThanThePathIsUsed) {
  const std::vector<float> path{1, 2, 3, 4, 5, 6, 7, 8, 9, 10};
  for (const PrefixUse prefix : {PrefixUse::none, PrefixUse::guided, PrefixUse::trained}) {
    config::Sampler sampler = sampler_of(prefix);
    sampler.samples = 4;
    sampler.choice = SampleChoice::coherent;
    auto [network, policy] = make(sampler, either_way);
    const auto with = [&](float promised, float known) {
      std::vector<float> input = input_of(7, 0, 0, path);
      input[4] = promised;
      input[5] = known;
      return infer(policy, input);
    };
    const float none = std::nanf(""), endless = std::numeric_limits<float>::infinity();
    EXPECT_EQ(with(16e6F, 16e6F), with(10, 10));
    EXPECT_EQ(with(endless, endless), with(10, 10));
    EXPECT_EQ(with(9, 4), with(4, 4)) << "no more can be promised than is known";
    EXPECT_EQ(with(-3, -3), with(0, 0));
    EXPECT_EQ(with(none, none), with(0, 0));
    std::vector<float> no_id = input_of(7);
    no_id[1] = no_id[2] = none;
    EXPECT_EQ(infer(policy, no_id), infer(policy, input_of(0)));
  }
}

TEST(FlowPolicy, TheRecordedInputSaysTheAnswerBitForBit) {
  for (const PrefixUse prefix : {PrefixUse::none, PrefixUse::guided, PrefixUse::trained}) {
    config::Sampler sampler = sampler_of(prefix);
    sampler.samples = 4;
    sampler.choice = SampleChoice::coherent;
    const auto input = input_of(12345678901ULL, 2, 6, {1, 2, 3, 4, 5, 6, 6, 6, 6, 6});
    auto [first_network, first] = make(sampler, either_way);
    infer(first, input_of(3));  // what was answered before leaves nothing
    auto [second_network, second] = make(sampler, either_way);
    const auto a = infer(first, input), b = infer(second, input);
    EXPECT_EQ(std::memcmp(a.data(), b.data(), sizeof(float) * a.size()), 0);
  }
}

// Three steps promised, and one more, which an answer a step late would find played.
TEST(FlowPolicy, ATrainedPrefixStandsAtTimeOneInEveryStep) {
  auto [network, policy] = make(sampler_of(PrefixUse::trained), always_three);
  const auto output = infer(policy, input_of(7, 3, 6, {1, 2, 4, 8, 9, 9, 9, 9, 9, 9}));
  EXPECT_EQ(std::vector(output.begin(), output.begin() + 4), (std::vector<float>{1, 2, 4, 8}));
  for (std::size_t step = 4; step < kSteps; ++step) EXPECT_NEAR(output[step], 3.0F, 1e-5F);
  for (std::size_t i = 0; i < network->shown.size(); ++i) {
    const auto& shown = network->shown[i];
    EXPECT_EQ(std::vector(shown.begin() + 1, shown.begin() + 5), (std::vector<float>{1, 2, 4, 8}));
    for (std::size_t step = 0; step < kSteps; ++step)
      EXPECT_FLOAT_EQ(shown[1 + kSteps + step], step < 4 ? 1.0F : static_cast<float>(i) / 5.0F);
  }
}

// Steps 0 and 1 promised, the path known up to step 6: the published example of the weights.
TEST(FlowPolicy, GuidanceIsThePublishedRule) {
  config::Sampler sampler = sampler_of(PrefixUse::guided);
  sampler.schedule = config::PrefixSchedule::linear;
  auto [network, policy] = make(sampler, always_three);
  const std::vector<float> path{-1, -1, -2, -2, -3, -3, -3, -3, -3, -3};
  const auto output = infer(policy, input_of(7, 2, 6, path));
  constexpr double kWeights[] = {1, 1, 0.8, 0.6, 0.4, 0.2, 0, 0, 0, 0};
  for (std::size_t step = 0; step < kSteps; ++step) {
    auto x = static_cast<double>(network->shown[0][1 + step]);
    for (int i = 0; i < 5; ++i) {
      const double t = i / 5.0, v = (3.0 - x) / (1 - t);
      const double most = t == 0 ? 5.0 : std::min(5.0, (1 - t) / t * (t * t + (1 - t) * (1 - t)) / ((1 - t) * (1 - t)));
      x += (v + most * kWeights[step] * (static_cast<double>(path[step]) - (x + (1 - t) * v))) / 5.0;
    }
    EXPECT_NEAR(static_cast<double>(output[step]), x, 1e-4) << "step " << step;
  }
  for (std::size_t step = 6; step < kSteps; ++step) EXPECT_NEAR(output[step], 3.0F, 1e-5F) << "free";
  EXPECT_LT(output[0], output[4]) << "drawn most where it is promised";
}

TEST(FlowPolicy, WithoutAPathThereIsNothingToBeDrawnTo) {
  for (const PrefixUse prefix : {PrefixUse::guided, PrefixUse::trained}) {
    auto [network, policy] = make(sampler_of(prefix), always_three);
    for (const float value : infer(policy, input_of(7))) EXPECT_NEAR(value, 3.0F, 1e-5F);
  }
}

TEST(FlowPolicy, CoherentKeepsToTheWayThatIsBeingGone) {
  config::Sampler sampler = sampler_of();
  sampler.samples = 16;
  sampler.choice = SampleChoice::coherent;
  sampler.decay = 0.5;
  auto [network, policy] = make(sampler, either_way);
  int first_up = 0;
  for (std::uint64_t id = 1; id <= 60; ++id) {
    EXPECT_NEAR(infer(policy, input_of(id, 0, 5, std::vector<float>(kSteps, 0.9F))).front(), 1.0F, 1e-5F) << id;
    EXPECT_NEAR(infer(policy, input_of(id, 0, 5, std::vector<float>(kSteps, -0.9F))).front(), -1.0F, 1e-5F) << id;
    first_up += infer(policy, input_of(id)).front() > 0 ? 1 : 0;
  }
  EXPECT_GT(first_up, 10) << "with no path the first sample is taken,";
  EXPECT_LT(first_up, 50) << "whichever it is";
}

// Near steps weigh exp(-m i): samples differ from the path by 2 in the first step, or by 1 in the five behind it.
TEST(FlowPolicy, CoherenceWeighsTheNearStepsMost) {
  const auto chosen = [](double decay) {
    config::Sampler sampler = sampler_of();
    sampler.samples = 16;
    sampler.choice = SampleChoice::coherent;
    sampler.decay = decay;
    auto [network, policy] = make(sampler, [](std::span<const float> noise, std::size_t value) {
      return noise[0] < 0.0F ? (value == 0 ? 2.0F : 0.0F) : (value == 0 ? 0.0F : 1.0F);
    });
    return infer(policy, input_of(5, 0, 6)).front();
  };
  EXPECT_NEAR(chosen(0.0), 2.0F, 1e-5F) << "2 against 5";
  EXPECT_NEAR(chosen(1.0), 0.0F, 1e-5F) << "2 against 0.58";
}

TEST(FlowPolicy, AgreedSaysAsMuchAsAllSamplesSay) {
  config::Sampler sampler = sampler_of();
  sampler.samples = 16;
  sampler.choice = SampleChoice::agreed;
  // Ways part from step 3 on, by 0.04 a step and side: 0.08 in step 3, 0.16 in step 4.
  auto [network, policy] = make(sampler, [](std::span<const float> noise, std::size_t value) {
    const float side = noise[0] < 0.0F ? -1.0F : 1.0F;
    return side * 0.04F * static_cast<float>(value < 3 ? 0 : value - 2);
  });
  const auto output = infer(policy, input_of(9));
  EXPECT_EQ(meant_steps(output, 1), 4U);
  for (std::size_t step = 0; step < kSteps; ++step) EXPECT_EQ(std::isnan(output[step]), step >= 4);
}

TEST(FlowPolicy, AgreedSaysOneStepAtLeastAndAllWhereAllAgree) {
  config::Sampler sampler = sampler_of();
  sampler.samples = 16;
  sampler.choice = SampleChoice::agreed;
  auto [apart_network, apart] = make(sampler, either_way);
  EXPECT_EQ(meant_steps(infer(apart, input_of(9)), 1), 1U);
  auto [alike_network, alike] = make(sampler, always_three);
  EXPECT_EQ(meant_steps(infer(alike, input_of(9)), 1), kSteps);
}

// A step has as many values as the robot has outputs: two here, five steps.
class TwoOutputs : public testing::Test {
 protected:
  static std::vector<float> infer_with(const config::Sampler& sampler, Denoiser::Chunk chunk, std::size_t promised,
                                       std::size_t known, std::vector<std::vector<float>>* shown = nullptr) {
    auto network = std::make_unique<Denoiser>(kSteps, kSteps / 2, std::move(chunk));
    Denoiser* const seen = network.get();
    FlowPolicy policy(std::move(network), {.observation = 1, .steps = kSteps / 2, .outputs = 2}, sampler);
    const auto output = infer(policy, input_of(7, promised, known, {10, 20, 11, 21, 12, 22, 13, 23, 13, 23}));
    if (shown != nullptr) *shown = seen->shown;
    return output;
  }
};

TEST_F(TwoOutputs, APrefixIsKeptByWholeSteps) {
  std::vector<std::vector<float>> shown;
  const auto output = infer_with(sampler_of(PrefixUse::trained), always_three, 1, 4, &shown);
  EXPECT_EQ(std::vector(output.begin(), output.begin() + 4), (std::vector<float>{10, 20, 11, 21}));
  EXPECT_NEAR(output[4], 3.0F, 1e-5F);
  EXPECT_EQ(std::vector(shown[1].end() - 5, shown[1].end()), (std::vector<float>{1, 1, 0.2F, 0.2F, 0.2F}));
}

TEST_F(TwoOutputs, GuidanceWeighsBySteps) {
  config::Sampler sampler = sampler_of(PrefixUse::guided);
  sampler.schedule = config::PrefixSchedule::zeros;
  const auto output = infer_with(sampler, always_three, 2, 4);
  for (std::size_t value = 0; value < 4; ++value) EXPECT_GT(output[value], 5.0F) << "drawn to the path";
  for (std::size_t value = 4; value < kSteps; ++value) EXPECT_NEAR(output[value], 3.0F, 1e-5F);
}

TEST_F(TwoOutputs, SamplesAgreeByWholeSteps) {
  config::Sampler sampler = sampler_of();
  sampler.samples = 16;
  sampler.choice = SampleChoice::agreed;
  const auto output = infer_with(
      sampler,
      [](std::span<const float> noise, std::size_t value) {
        return value < 5 ? 1.0F : (noise[0] < 0.0F ? -1.0F : 1.0F);  // they part in the third step's second output
      },
      0, 0);
  EXPECT_EQ(meant_steps(output, 2), 2U);
  for (std::size_t value = 0; value < kSteps; ++value) EXPECT_EQ(std::isnan(output[value]), value >= 4);
}

TEST_F(TwoOutputs, CoherenceLooksAtWhatIsKnownOfThePathAlone) {
  config::Sampler sampler = sampler_of();
  sampler.samples = 16;
  sampler.choice = SampleChoice::coherent;
  sampler.decay = 0.0;
  // One way is on the path for its two known steps and far off behind them, the other the other way round.
  const auto output = infer_with(
      sampler,
      [](std::span<const float> noise, std::size_t value) {
        constexpr float kPath[] = {10, 20, 11, 21, 12, 22, 13, 23, 13, 23};
        return kPath[value] + ((noise[0] < 0.0F) == (value < 4) ? 0.0F : 9.0F);
      },
      0, 2);
  EXPECT_NEAR(output[0], 10.0F, 1e-4F);
  EXPECT_NEAR(output[4], 21.0F, 1e-4F);
}

class WithSampler : public testing::Test {
 protected:
  WithSampler() : robot_(small_robot()) {
    robot_.policy->observation = {};
    robot_.policy->observation.push_back(term(config::TermKind::constant, 1));
    robot_.policy->observation.front().constant = {0.5};
    robot_.policy->sampler = sampler_of();
  }
  std::string refused(std::size_t values, std::size_t times, bool recurrent = false) {
    auto network = std::make_unique<Denoiser>(values, times, always_three);
    network->recurrent = recurrent;
    const auto made = with_sampler(robot_, std::move(network));
    return made ? "" : made.error();
  }
  config::RobotConfig robot_;
};

TEST_F(WithSampler, TakesOneTimeOrOnePerStep) {
  EXPECT_EQ(refused(12, 1), "");
  EXPECT_EQ(refused(12, 4), "");
  EXPECT_EQ(
      refused(12, 3),
      "small.onnx: its inputs obs,x_t,t hold 16 values, the configuration wants 1 of observation, 12 of chunk, and 1 "
      "or 4 of time; correct policy.observation or policy.steps in small.yaml");
}

TEST_F(WithSampler, AnInputSmallerThanTheObservationIsRefusedToo) {
  robot_.policy->observation.front().constant.resize(40);
  EXPECT_NE(refused(12, 1).find("hold 14 values"), std::string::npos);
}

TEST_F(WithSampler, ATrainedPrefixNeedsOneTimePerStep) {
  robot_.policy->sampler->prefix = PrefixUse::trained;
  EXPECT_EQ(refused(12, 4), "");
  EXPECT_EQ(refused(12, 1),
            "small.onnx: has one time for all steps, so it was not trained with a prefix; write policy.sampler.prefix "
            "guided or none in small.yaml");
}

TEST_F(WithSampler, ANetworkThatRemembersIsRefused) {
  EXPECT_EQ(
      refused(12, 4, true),
      "small.onnx: remembers from one inference to the next, and a sampler infers 5 times for each answer; export it "
      "without a state");
}

TEST_F(WithSampler, WithoutASectionTheNetworkIsThePolicy) {
  robot_.policy->sampler.reset();
  auto network = std::make_unique<Denoiser>(12, 1, always_three);
  const Policy* const before = network.get();
  const auto made = with_sampler(robot_, std::move(network));
  ASSERT_TRUE(made);
  EXPECT_EQ(made->get(), before);
}

}  // namespace
}  // namespace takt::policy_host

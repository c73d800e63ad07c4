// SPDX-License-Identifier: Apache-2.0
// Goal: the fault classifier calls planted faults by their names, on rollouts it was not adjusted to.
// Method: the demo arm in virtual time, each perturbation at a dose that hurts, seeds 101 and up; a rollout's verdict
// is its most frequent one. Prints the confusion matrix. Rollouts without any trouble count as not recognised.
#include <gtest/gtest.h>

#include <algorithm>
#include <cstdio>
#include <map>

#include "lab/artifact/confusion.hpp"
#include "monitor/judge/fault_classifier.hpp"
#include "tests/evidence/rollout/arm_rollouts.hpp"

namespace takt::lab {
namespace {

using monitor::Fault;

struct Planted {
  const char* perturbation;
  double times_moderate;  // dose
};
constexpr Planted kPlanted[] = {
    {"camera_freeze", 1},        {"sensor_lies", 1},     {"wrong_joint_order", 1}, {"sensor_burst", 1},
    {"sensor_dropout", 1.3},     {"estimator_delay", 3}, {"inference_stall", 1},   {"inference_mean_shift", 2},
    {"gpu_contention", 1},       {"policy_freeze", 1},   {"queue_growth", 1},      {"publish_delay", 1},
    {"scheduler_preemption", 1}, {"cpu_hog", 1},         {"rt_throttling", 1},     {"bad_actions_nan", 1},
    {"bad_actions_range", 1},    {"bus_off", 1},
};
constexpr std::uint64_t kFirstSeed = 101, kSeeds = 3;
constexpr std::size_t kNone = monitor::kFaultCount;  // column of rollouts without trouble

monitor::FaultSummary classify(const Planted& planted, std::uint64_t seed) {
  evidence::RolloutSetup wanted = test::setup(planted.perturbation, seed);
  wanted.perturbation.dose *= planted.times_moderate;
  monitor::FaultClassifier classifier(monitor::fault_rules_of(test::arm()));
  wanted.on_command = [&](const CommandChunk& chunk) { classifier.command(chunk); };
  wanted.on_shown = [&](const evidence::ShownSample& shown) {
    classifier.sample(shown.sensor, shown.sample.sequence, shown.sample.sensed_at,
                      {shown.sample.values, shown.sample.value_count});
  };
  wanted.on_tick = [&](const TickRecord& record) { classifier.tick(record); };
  (void)test::run(wanted);
  return classifier.finish();
}

std::size_t most_frequent(const monitor::FaultSummary& summary) {
  if (summary.verdicts.empty()) return kNone;
  return static_cast<std::size_t>(std::ranges::max_element(summary.counts) - summary.counts.begin());
}

TEST(FaultRecall, PlantedFaultsAreCalledByTheirNames) {
  std::map<Fault, std::array<int, kNone + 1>> confusion;
  for (const Planted& planted : kPlanted) {
    for (std::uint64_t seed = kFirstSeed; seed < kFirstSeed + kSeeds; ++seed) {
      const monitor::FaultSummary summary = classify(planted, seed);
      const std::size_t verdict = most_frequent(summary);
      ++confusion[*planted_faults(planted.perturbation).begin()][verdict];
      std::printf("%-22s seed %3llu  %s", planted.perturbation, static_cast<unsigned long long>(seed),
                  monitor::fault_text(summary, 1).c_str());
    }
  }
  std::printf("\n%-30s", "planted");
  for (const std::string_view name : monitor::kFaultNames) std::printf(" %.9s", name.data());
  std::printf(" none\n");
  double recall = 0;
  for (const auto& [fault, row] : confusion) {
    std::printf("%-30s", std::string(name(fault)).c_str());
    int all = 0;
    for (const int count : row) {
      std::printf(" %9d", count);
      all += count;
    }
    std::printf("\n");
    recall += static_cast<double>(row[static_cast<std::size_t>(fault)]) / all;
  }
  recall /= static_cast<double>(confusion.size());
  std::printf("macro recall %.3f\n", recall);
  EXPECT_GE(recall, 0.8);
}

// What is no fault of timing gets no verdict from a nominal rollout.
TEST(FaultRecall, ANominalRolloutHasNone) {
  const monitor::FaultSummary summary = classify({"none", 1}, kFirstSeed);
  EXPECT_TRUE(summary.verdicts.empty()) << monitor::fault_text(summary);
}

}  // namespace
}  // namespace takt::lab

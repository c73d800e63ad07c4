// SPDX-License-Identifier: Apache-2.0
// Goal: the confusion matrix counts every rollout once, under what was planted and what was said, and a false alarm in
// a nominal rollout shows. Method: rows by hand; the matrix, its figures, its file.
#include "lab/artifact/confusion.hpp"

#include <gtest/gtest.h>

#include "evidence/rollout/perturbation.hpp"
#include "tests/lab/artifact/sample_rows.hpp"

namespace takt::panel {
namespace {

using monitor::Fault;

RolloutRow row(const char* perturbation, const char* verdict, const char* method = "takt") {
  RolloutRow made = sample_row(method, 1);
  made.perturbation = perturbation;
  made.leading_fault = verdict;
  return made;
}

TEST(Confusion, CountsPlantedCausesByVerdict) {
  const std::vector<RolloutRow> rows{row("inference_stall", "inference_stall"),
                                     row("inference_stall", "middleware_queue_growth"),
                                     row("policy_freeze", "inference_stall"),
                                     row("estimator_delay", ""),
                                     row("push", "unknown"),
                                     row("none", ""),
                                     row("none", "platform_stall"),
                                     row("estimator_delay", "estimator_lag", "other")};
  const auto confusions = confusions_of(rows);
  ASSERT_EQ(confusions.size(), 2U);
  const Confusion& takt = confusions.at("takt");
  ASSERT_EQ(takt.planted.size(), 2U) << "a push plants no cause";
  EXPECT_EQ(takt.planted.at(Fault::inference_stall)[static_cast<std::size_t>(Fault::inference_stall)], 2U);
  EXPECT_EQ(takt.planted.at(Fault::inference_stall)[static_cast<std::size_t>(Fault::middleware_queue_growth)], 1U);
  EXPECT_EQ(takt.planted.at(Fault::estimator_lag)[kNoVerdict], 1U);
  EXPECT_DOUBLE_EQ(takt.recall(Fault::inference_stall), 2.0 / 3);
  EXPECT_DOUBLE_EQ(takt.recall(Fault::estimator_lag), 0) << "no verdict is not recognised";
  EXPECT_DOUBLE_EQ(takt.macro_recall().value(), 1.0 / 3);
  EXPECT_EQ(takt.nominal_rollouts(), 2U);
  EXPECT_EQ(takt.nominal_labelled(), 1U);
  EXPECT_EQ(takt.abstained(), 1U) << "of those with a planted cause";
  EXPECT_DOUBLE_EQ(takt.precision(Fault::inference_stall).value(), 1.0);
  EXPECT_DOUBLE_EQ(takt.precision(Fault::middleware_queue_growth).value(), 0.0);
  EXPECT_DOUBLE_EQ(takt.precision(Fault::platform_stall).value(), 0.0) << "a false alarm";
  EXPECT_FALSE(takt.precision(Fault::estimator_lag)) << "never said";
  EXPECT_DOUBLE_EQ(takt.macro_precision().value(), 0.5);
  EXPECT_DOUBLE_EQ(confusions.at("other").macro_recall().value(), 1.0);
}

TEST(Confusion, IsSilentWhereNothingWasPlanted) {
  const std::vector<RolloutRow> rows{row("none", ""), row("payload", "")};
  const auto confusions = confusions_of(rows);
  EXPECT_FALSE(confusions.at("takt").macro_recall());
  EXPECT_EQ(confusion_text(confusions), "");
  EXPECT_TRUE(confusion_json(confusions, "id").at("methods").at("takt").at("macro_recall").is_null());
}

TEST(Confusion, EveryPlantingPerturbationExists) {
  std::size_t planting = 0;
  for (const PerturbationKind& kind : perturbation_kinds())
    if (planted_fault(kind.name)) ++planting;
  EXPECT_EQ(planting, 17U);
  EXPECT_FALSE(planted_fault("none"));
}

TEST(Confusion, TheLeadingVerdictIsTheCostliest) {
  monitor::FaultSummary summary;
  EXPECT_EQ(leading_fault(summary), "");
  const auto cost = [&](Fault fault) -> monitor::FaultCost& { return summary.costs[static_cast<std::size_t>(fault)]; };
  cost(Fault::unknown) = {.stops = 0, .missed_ticks = 0, .stretches = 2};
  EXPECT_EQ(leading_fault(summary), "unknown");
  cost(Fault::estimator_lag) = {.stops = 0, .missed_ticks = 0, .stretches = 2};
  EXPECT_EQ(leading_fault(summary), "estimator_lag") << "the more specific one among equals";
  cost(Fault::controller_integration_error) = {.stops = 0, .missed_ticks = 9, .stretches = 1};
  EXPECT_EQ(leading_fault(summary), "controller_integration_error") << "what cost commands";
  cost(Fault::actuator_or_bus_fault) = {.stops = 1, .missed_ticks = 0, .stretches = 1};
  EXPECT_EQ(leading_fault(summary), "actuator_or_bus_fault") << "one stop outweighs them";
}

}  // namespace
}  // namespace takt::panel

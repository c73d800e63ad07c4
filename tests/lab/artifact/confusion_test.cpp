// SPDX-License-Identifier: Apache-2.0
// Goal: the confusion matrix counts every rollout once, under what was planted and what was said, and a false alarm in
// a nominal rollout shows. Method: rows by hand; the matrix, its figures, its file.
#include "lab/artifact/confusion.hpp"

#include <gtest/gtest.h>

#include "evidence/rollout/perturbation.hpp"
#include "tests/lab/artifact/sample_rows.hpp"

namespace takt::lab {
namespace {

using monitor::Fault;

evidence::RolloutRow row(const char* perturbation, const char* verdict, const char* method = "takt") {
  evidence::RolloutRow made = sample_row(method, 1);
  made.perturbation = perturbation;
  made.leading_fault = verdict;
  return made;
}

TEST(Confusion, CountsPlantedCausesByVerdict) {
  const std::vector<evidence::RolloutRow> rows{row("inference_stall", "inference_stall"),
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
  const std::vector<evidence::RolloutRow> rows{row("none", ""), row("payload", "")};
  const auto confusions = confusions_of(rows);
  EXPECT_FALSE(confusions.at("takt").macro_recall());
  EXPECT_EQ(confusion_text(confusions), "");
  EXPECT_TRUE(confusion_json(confusions, "id").at("methods").at("takt").at("macro_recall").is_null());
}

TEST(Confusion, EveryPlantingPerturbationExists) {
  std::size_t planting = 0;
  for (const trouble::Row& kind : evidence::perturbation_kinds()) planting += planted_faults(kind.name).size();
  EXPECT_EQ(planting, 20U);
  EXPECT_TRUE(planted_faults("none").empty());
}

TEST(Confusion, KnowsAllPlantedCauses) {
  using Faults = std::set<Fault>;
  EXPECT_EQ(planted_faults("push-with-can_loss-0.1"), Faults{Fault::actuator_or_bus_fault});
  EXPECT_EQ(planted_faults("policy_freeze-with-publish_delay-1e+02-with-inference_stall-400"),
            (Faults{Fault::inference_stall, Fault::middleware_queue_growth}));
}

evidence::RolloutRow shared(const char* perturbation, const std::map<Fault, double>& shares) {
  evidence::RolloutRow made = row(perturbation, shares.empty() ? "" : "inference_stall");
  made.fault_shares.fill(0);
  for (const auto& [fault, share] : shares) made.fault_shares[static_cast<std::size_t>(fault)] = share;
  return made;
}

TEST(Confusion, AMixtureNamesEachCauseWithATellingShare) {
  constexpr const char* kBoth = "inference_stall-with-bus_off-100";
  const std::vector<evidence::RolloutRow> rows{
      shared(kBoth, {{Fault::inference_stall, 0.9}, {Fault::actuator_or_bus_fault, 0.1}}),
      shared(kBoth, {{Fault::inference_stall, 0.99}, {Fault::actuator_or_bus_fault, 0.01}}),
      shared(kBoth, {{Fault::inference_stall, 0.5}, {Fault::sensor_backlog, 0.4}, {Fault::unknown, 0.1}})};
  const auto confusions = confusions_of(rows);
  const Confusion& takt = confusions.at("takt");
  EXPECT_TRUE(takt.planted.empty()) << "two causes are no single one";
  EXPECT_EQ(takt.mixtures.rollouts, 3U);
  EXPECT_EQ(takt.mixtures.all_named, 1U);
  const auto& causes = takt.mixtures.causes;
  EXPECT_DOUBLE_EQ(causes.at(Fault::inference_stall).recall(), 1);
  EXPECT_DOUBLE_EQ(causes.at(Fault::actuator_or_bus_fault).recall(), 1.0 / 3);
  EXPECT_DOUBLE_EQ(causes.at(Fault::actuator_or_bus_fault).precision().value(), 1);
  EXPECT_DOUBLE_EQ(causes.at(Fault::sensor_backlog).precision().value(), 0) << "not planted";
  EXPECT_FALSE(causes.contains(Fault::unknown)) << "no name";
  EXPECT_NE(confusion_text(confusions).find("all planted causes named in 1 of 3 (33.3 %) mixtures"), std::string::npos);
  EXPECT_EQ(confusion_json(confusions, "id")["methods"]["takt"]["mixtures"]["all_named"], 1);
}

TEST(Confusion, RolloutsWithoutTroubleStandBesideTheRecall) {
  const std::vector<evidence::RolloutRow> rows{
      shared("policy_freeze", {{Fault::inference_stall, 1.0}}), shared("policy_freeze", {}),
      shared("policy_freeze", {{Fault::inference_stall, 0.8}, {Fault::sensor_backlog, 0.2}}), shared("none", {})};
  const auto confusions = confusions_of(rows);
  const Confusion& takt = confusions.at("takt");
  EXPECT_DOUBLE_EQ(takt.macro_recall().value(), 2.0 / 3);
  EXPECT_DOUBLE_EQ(takt.macro_recall_of_troubled().value(), 1);
  EXPECT_EQ(takt.without_trouble(), 1U);
  EXPECT_EQ(takt.named_besides, 1U);
  const std::string text = confusion_text(confusions);
  for (const char* line : {"macro recall 0.667, macro precision 1.000\n", "macro recall 1.000 without the rollouts",
                           "unknown or none): 1 of 3 (33.3 %)\n", "named besides: 1 of 3 (33.3 %)\n",
                           "nominal rollouts with a verdict: 0 of 1 (0.0 %)\n"})
    EXPECT_NE(text.find(line), std::string::npos) << line << text;
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
}  // namespace takt::lab

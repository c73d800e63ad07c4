// SPDX-License-Identifier: Apache-2.0
// Goal: the budget's arithmetic is right, above all for the figure it comes from, and what is drawn says the same and
// keeps to its columns. Method: stages whose sums are known; robot file and recorded demo for the sources.
#include "lab/study/budget.hpp"

#include <gtest/gtest.h>

#include <algorithm>
#include <sstream>

#include "config/load.hpp"
#include "lab/study/budget_sources.hpp"
#include "tests/monitor/record/recorded_demo.hpp"
#include "tests/support/temporary_folder.hpp"

namespace takt::study {
namespace {

using monitor::record_demo;

Budget figure(std::optional<double> max_age_ms = {}) {
  const auto usual = usual_rates_Hz();
  return budget_of({figure_stages(), {}, {usual.begin(), usual.end()}, max_age_ms});
}

RateBudget at(const Budget& budget, double rate_Hz) {
  return *std::ranges::find(budget.rates, rate_Hz, &RateBudget::rate_Hz);
}

std::size_t columns(const std::string& line) {
  return static_cast<std::size_t>(std::ranges::count_if(line, [](char c) { return (c & 0xC0) != 0x80; }));
}

TEST(Budget, TheFiguresFiftyHertzFitsNeitherWay) {
  const Budget budget = figure();
  EXPECT_EQ(budget.total.worst_ms, 51);
  const RateBudget fifty = at(budget, 50);
  EXPECT_EQ(fifty.serial.fit, Fit::never);
  EXPECT_DOUBLE_EQ(fifty.serial.worst_slack_ms, -31);
  EXPECT_EQ(fifty.pipelined.fit, Fit::never) << "perception alone takes 30 of 20 ms";
  EXPECT_DOUBLE_EQ(fifty.pipelined.worst_slack_ms, -10);
  EXPECT_EQ(budget.stages[budget.slowest].name, "perception");
  EXPECT_NEAR(budget.serial_Hz, 19.61, 0.01);
  EXPECT_NEAR(budget.pipelined_Hz, 33.33, 0.01);
}

TEST(Budget, OverlappingBuysRateNotAge) {
  const RateBudget thirty = at(figure(), 30);
  EXPECT_EQ(thirty.serial.fit, Fit::never);
  EXPECT_EQ(thirty.pipelined.fit, Fit::fits);
  EXPECT_DOUBLE_EQ(thirty.serial.oldest_ms, 51 + 51) << "the loop runs at what it reaches";
  EXPECT_DOUBLE_EQ(thirty.pipelined.oldest_ms, 51 + 1000.0 / 30) << "still no younger than the sum";
}

TEST(Budget, SlackLiesWhereTheStagesAreShort) {
  const RateBudget thirty = at(figure(), 30);
  ASSERT_EQ(thirty.stage_slack_ms.size(), 4U);
  EXPECT_NEAR(thirty.stage_slack_ms[0], 3.33, 0.01);
  EXPECT_NEAR(thirty.stage_slack_ms[3], 32.33, 0.01);
}

TEST(Budget, ExactlyFullFits) {
  const Budget budget = budget_of({{{"all", 20, 20, ""}}, {}, {50, 50}, 40});
  ASSERT_EQ(budget.rates.size(), 1U) << "each rate once";
  EXPECT_EQ(budget.rates[0].serial.fit, Fit::fits);
  EXPECT_TRUE(budget.rates[0].serial.is_fresh) << "20 ms old when used, 40 ms when replaced";
  EXPECT_FALSE(budget_of({{{"all", 20, 20, ""}}, {}, {50}, 39.9}).rates[0].serial.is_fresh);
}

TEST(Budget, AWorstCaseThatIsTooLongIsATail) {
  const Budget budget = budget_of({{{"infer", 10, 30, ""}}, {}, {50}, {}});
  EXPECT_EQ(budget.rates[0].pipelined.fit, Fit::tail);
  EXPECT_DOUBLE_EQ(budget.rates[0].pipelined.typical_slack_ms, 10);
  EXPECT_DOUBLE_EQ(budget.rates[0].pipelined.worst_slack_ms, -10);
}

TEST(Budget, WaitingLimitsTheSerialLoopOnly) {
  const Budget budget = budget_of({{{"sense", 40, 40, "", true}, {"infer", 10, 10, ""}}, {}, {50}, {}});
  EXPECT_EQ(budget.rates[0].serial.fit, Fit::never);
  EXPECT_EQ(budget.rates[0].pipelined.fit, Fit::fits);
  EXPECT_DOUBLE_EQ(budget.rates[0].pipelined.oldest_ms, 70);
}

TEST(Budget, TextKeepsToEightyColumnsAndSaysIt) {
  const std::string text = budget_text(figure(90), 50);
  std::istringstream lines(text);
  for (std::string line; std::getline(lines, line);) EXPECT_LE(columns(line), 80U) << line;
  EXPECT_NE(text.find("50 Hz, 20 ms, serial: does not fit, too long by 31 ms"), std::string::npos) << text;
  EXPECT_NE(text.find("50 Hz, 20 ms, pipelined: does not fit, too long by 10 ms"), std::string::npos) << text;
  EXPECT_NE(text.find("102.0!"), std::string::npos) << "past max_age\n" << text;
}

TEST(Budget, JsonHoldsWhatIsDrawn) {
  const auto json = to_json(figure());
  EXPECT_EQ(json["schema"], "takt.budget/1");
  EXPECT_EQ(json["rates"].size(), 10U);
  EXPECT_EQ(json["rates"][5]["serial"]["fit"], "no");
  EXPECT_EQ(json["rates"][5]["stage_slack_ms"]["inference"], 5);
  EXPECT_TRUE(json["max_age_ms"].is_null());
}

TEST(BudgetSources, ARobotFileKnowsCameraAndBuses) {
  const auto robot = config::load("config/arm6.yaml");
  ASSERT_TRUE(robot);
  const auto loads = drivers::check_bus_load(*robot);
  ASSERT_TRUE(loads);
  const Question question = question_of(*robot, *loads);
  EXPECT_EQ(question.stages[0].typical_ms, 18);
  EXPECT_EQ(question.stages[0].worst_ms, 22);
  EXPECT_EQ(question.stages[1].source, "figure 55.2A") << "no robot file knows how long its policy thinks";
  EXPECT_DOUBLE_EQ(question.stages[3].typical_ms, 1 + 1e3 * (*loads)[0].bits_per_tick / 1e6);
  EXPECT_EQ(question.max_age_ms, 150);
}

class RecordedBudget : public test::TemporaryFolder {};

TEST_F(RecordedBudget, ARunsStagesAreItsMeasuredQuantiles) {
  const auto run = record_demo(path("run"));
  const auto metrics = monitor::metrics_of(run);
  ASSERT_TRUE(metrics);
  const auto question = question_of(run, *metrics);
  ASSERT_TRUE(question) << question.error();
  EXPECT_EQ(question->stages[2].name, "infer");
  EXPECT_DOUBLE_EQ(question->stages[2].typical_ms, metrics->age_per_command[2].p50 / 1e6);
  EXPECT_DOUBLE_EQ(question->stages[2].worst_ms, metrics->age_per_command[2].p99 / 1e6);
  EXPECT_DOUBLE_EQ(budget_of(*question).total.worst_ms, metrics->age_per_command.back().p99 / 1e6)
      << "end to end, not the sum of tails";
}

TEST_F(RecordedBudget, ARunWithoutCommandsSaysSo) {
  const auto run = record_demo(path("run"));
  EXPECT_FALSE(question_of(run, monitor::RunMetrics{}));
}

}  // namespace
}  // namespace takt::study

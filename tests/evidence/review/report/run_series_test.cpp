// SPDX-License-Identifier: Apache-2.0
// Goal: however long the run, the page stays small, shows the oldest command, and holds every tick where something went
// wrong. Method: the recorded demo, whose two stalls are known, with so little room that it must be thinned out.
#include "evidence/review/report/run_series.hpp"

#include <gtest/gtest.h>

#include <algorithm>
#include <cmath>
#include <fstream>

#include "tests/monitor/record/recorded_demo.hpp"
#include "tests/support/temporary_folder.hpp"

namespace takt::monitor {
namespace {

class RunSeriesTest : public test::TemporaryFolder {
 protected:
  evidence::RunSeries series(std::size_t whole_bytes, const std::string& truth = "") {
    auto found = evidence::series_of(run_, metrics_, faults_, truth, whole_bytes);
    if (!found) throw std::runtime_error(found.error());
    return std::move(*found);
  }
  static const std::vector<float>& column(const evidence::SampleBlock& block, const std::string& name) {
    return std::ranges::find(block.columns, name, &evidence::SampleColumn::name)->values;
  }
  const RecordedRun run_ = record_demo(path("run"));
  const RunMetrics metrics_ = *metrics_of(run_);
  const FaultSummary faults_ = *classify_run(run_);
};

TEST_F(RunSeriesTest, AShortRunKeepsEveryTick) {
  const evidence::RunSeries all = series(evidence::kWholeBytes);
  EXPECT_EQ(all.whole.bucket_ticks, 1U);
  EXPECT_EQ(all.whole.rows(), kDemoTicks);
  EXPECT_EQ(all.moments.rows(), 0U);
}

TEST_F(RunSeriesTest, ALongOneKeepsItsExtremesAndEveryTickOfItsViolations) {
  constexpr std::size_t kRoom = 20'000;
  const evidence::RunSeries thin = series(kRoom);
  EXPECT_LE(thin.whole.rows() * evidence::SampleBlockBuilder::row_bytes(6, 2, false), kRoom);
  EXPECT_GT(thin.whole.rows(), 100U);
  double oldest_ms = 0;
  for (std::size_t row = 0; row < thin.whole.rows(); ++row) {
    const double most = static_cast<double>(column(thin.whole, "age")[row] + column(thin.whole, "age.spread")[row]);
    if (!std::isnan(most)) oldest_ms = std::max(oldest_ms, most);
  }
  EXPECT_GE(oldest_ms * 1e6, metrics_.age_per_tick.back().max);
  ASSERT_EQ(faults_.verdicts.size(), 2U);
  for (const FaultVerdict& verdict : faults_.verdicts) {
    const double at_s = (verdict.at - metrics_.start).seconds();
    const auto inside = std::ranges::count_if(thin.moments.at_s, [&](double s) { return std::abs(s - at_s) < 0.1; });
    EXPECT_GE(inside, 199) << verdict.sentence;
  }
}

// Between two violations lie ticks that the moments leave out: nothing was lost there, so no row says so.
TEST_F(RunSeriesTest, BetweenMomentsIsNoGap) {
  VirtualRobot robot;
  const RecordedRun run = record(robot, path("long"), 8'000, [&](std::uint64_t tick) {
    robot.policy_is_frozen = (tick >= 1'500 && tick < 1'900) || tick >= 6'500;
  });
  const auto thin = evidence::series_of(run, *metrics_of(run), *classify_run(run), "", 20'000);
  ASSERT_TRUE(thin) << thin.error();
  const auto& at_s = thin->moments.at_s;
  const auto hole = std::ranges::adjacent_find(at_s, [](double before, double behind) { return behind > before + 1; });
  ASSERT_NE(hole, at_s.end()) << "two stretches";
  const auto& masks = column(thin->moments, "interventions");
  EXPECT_TRUE(std::ranges::none_of(masks, [](float mask) { return std::isnan(mask); }));
}

// Each command's last step is where the policy wants to go; the demo's policy moves all joints along one sine.
TEST_F(RunSeriesTest, ThePolicysTargetIsTheEndOfItsChunk) {
  const evidence::RunSeries all = series(evidence::kWholeBytes);
  const auto& target = column(all.whole, "target0");
  EXPECT_TRUE(std::isnan(target[5])) << "no command yet";
  bool checked = false;
  for (std::size_t row = 200; row < 1000; ++row) {
    ASSERT_TRUE(std::isfinite(target[row]));
    EXPECT_LE(std::abs(target[row]), 0.2F);
    checked = checked || target[row] > 0.19F;
  }
  EXPECT_TRUE(checked);
}

TEST_F(RunSeriesTest, ModesCoverTheRunWithoutAHole) {
  const evidence::RunSeries all = series(evidence::kWholeBytes);
  ASSERT_EQ(all.modes.size(), metrics_.transition_count + 1);
  EXPECT_EQ(all.modes.front().from_s, 0);
  EXPECT_DOUBLE_EQ(all.modes.back().to_s, metrics_.span.seconds());
  for (std::size_t band = 1; band < all.modes.size(); ++band) {
    EXPECT_EQ(all.modes[band].from_s, all.modes[band - 1].to_s);
    EXPECT_EQ(all.modes[band].mode, metrics_.transitions[band - 1].to);
    EXPECT_EQ(all.modes[band - 1].left_by, metrics_.transitions[band - 1].cause);
  }
}

TEST_F(RunSeriesTest, TheTasksTargetComesFromTheTruthFile) {
  {
    std::ofstream truth(path("truth.jsonl"));
    truth << "no JSON\n{\"monotonic_ns\":" << (metrics_.start + milliseconds(1000)).ns << ",\"target\":[0.1,0.2,0.3]}\n"
          << "{\"monotonic_ns\":" << (metrics_.start + milliseconds(2000)).ns << ",\"target\":[0.4,0.5,0.6]}\n{\"mono";
  }
  const evidence::RunSeries all = series(evidence::kWholeBytes, path("truth.jsonl"));
  const auto& z = column(all.whole, "task.z");
  EXPECT_TRUE(std::isnan(z[900]));
  EXPECT_FLOAT_EQ(z[1500], 0.3F);
  EXPECT_FLOAT_EQ(z[3900], 0.6F);
  const auto missing = evidence::series_of(run_, metrics_, faults_, path("none.jsonl"));
  ASSERT_FALSE(missing);
  EXPECT_NE(missing.error().find("none.jsonl"), std::string::npos);
}

}  // namespace
}  // namespace takt::monitor

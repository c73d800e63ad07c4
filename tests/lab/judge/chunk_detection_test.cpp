// SPDX-License-Identifier: Apache-2.0
// Goal: thresholds keep the rate of false alarms they state, and the area under the curve is the textbook's number.
// Method: known levels; many draws of calibration and fresh levels from a seed; rows with planted levels.
#include "lab/judge/chunk_detection.hpp"

#include <gtest/gtest.h>

#include <algorithm>
#include <random>

#include "tests/lab/artifact/sample_rows.hpp"

namespace takt::lab {
namespace {

constexpr config::ChunkScore kOne[] = {config::ChunkScore::reversals};
constexpr config::ChunkScore kTwo[] = {config::ChunkScore::reversals, config::ChunkScore::jerk};

monitor::ChunkScores level(double value) {
  monitor::ChunkScores scores;
  scores.fill(value);
  return scores;
}

TEST(ChunkCalibration, TakesTheConformalRank) {
  std::vector<monitor::ChunkScores> usual;
  for (int i = 19; i >= 1; --i) usual.push_back(level(i));
  EXPECT_EQ(calibrate(usual, kOne, 0.10).value().front().above, 18);  // ceil(20 * 0.9)
  EXPECT_EQ(calibrate(usual, kTwo, 0.10).value().front().above, 19);  // each has half of the alarms
  EXPECT_EQ(calibrate(usual, kOne, 1.0).value().front().above, 1);
}

TEST(ChunkCalibration, TooLittleIsRefusedWithWhatIsNeeded) {
  const std::vector<monitor::ChunkScores> usual(18, level(1));
  EXPECT_EQ(calibrate(usual, kOne, 0.05).error(),
            "18 stretches without a fault are too few for 1 scores and 0.05 of alarms: record 19 or more, watch fewer "
            "scores, or allow more alarms");
  EXPECT_TRUE(calibrate(std::vector(19, level(1)), kOne, 0.05));
  EXPECT_FALSE(calibrate({}, kOne, 1.0));
}

TEST(ChunkCalibration, FreshStretchesExceedItNoOftenerThanStated) {
  std::mt19937_64 random(7);
  std::lognormal_distribution<double> draw(0, 1);
  int exceeded = 0;
  constexpr int kDraws = 4000;
  for (int i = 0; i < kDraws; ++i) {
    std::vector<monitor::ChunkScores> usual;
    for (int k = 0; k < 39; ++k) usual.push_back(level(draw(random)));
    exceeded += draw(random) > calibrate(usual, kOne, 0.10).value().front().above ? 1 : 0;
  }
  EXPECT_NEAR(exceeded / static_cast<double>(kDraws), 0.10, 0.02);
}

TEST(Auroc, IsTheShareOfPairsInTheRightOrder) {
  const std::vector<double> failed{3, 2, 1}, successful{2, 0};
  const Auroc made = auroc_of(failed, successful).value();
  EXPECT_NEAR(made.area, 4.5 / 6, 1e-12);  // 3>2, 3>0, 2=2, 2>0, 1<2, 1>0
  EXPECT_LT(made.low, made.area);
  EXPECT_GT(made.high, made.area);
  EXPECT_FALSE(auroc_of(failed, {}));
}

// Ten seeds: 1 to 5 calibrate, 6 to 10 are judged.
std::vector<evidence::RolloutRow> rows() {
  std::vector<evidence::RolloutRow> made;
  for (std::uint64_t seed = 1; seed <= 10; ++seed) {
    for (const bool failed : {false, true}) {
      evidence::RolloutRow row = failed ? failed_row("takt", seed) : sample_row("takt", seed);
      row.perturbation = failed ? "push" : "none";
      row.chunk_levels = level(failed ? 3 : 1);
      row.catch_votes = 3;
      row.catch_of = 7;
      made.push_back(std::move(row));
    }
  }
  return made;
}

TEST(ChunkDetection, JudgesOnlyWhatItWasNotCalibratedOn) {
  std::vector<evidence::RolloutRow> all = rows();
  for (evidence::RolloutRow& row : all)
    if (row.seed == 10) row.chunk_levels = level(row.success ? 2 : 0.5);  // a false alarm, and a failure that is missed
  const ChunkDetection made = detection_of(all, kOne, 0.2).value();
  EXPECT_EQ(made.calibrated_on, 5U);
  EXPECT_EQ(made.rule.votes, 3) << "the rows' own rule, not the default";
  EXPECT_EQ(made.rule.of, 7);
  EXPECT_EQ(made.rule.thresholds.front().above, 1);
  EXPECT_EQ(made.failed, 5U);
  EXPECT_EQ(made.successful, 5U);
  EXPECT_EQ(made.failed_caught, 4U);
  EXPECT_EQ(made.nominal, 5U);
  EXPECT_EQ(made.nominal_caught, 1U);
  EXPECT_NEAR(made.auroc[1].value().area, 20.0 / 25, 1e-12);
}

}  // namespace
}  // namespace takt::lab

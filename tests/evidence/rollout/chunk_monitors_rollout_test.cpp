// SPDX-License-Identifier: Apache-2.0
// Goal: the scores of answers find failing rollouts that the plain velocity threshold does not, and keep their stated
// rate of false alarms. Method: the committed panel with fewer seeds; thresholds from one half of them, judged on the
// other. Prints the table.
#include <gtest/gtest.h>

#include <cstdio>

#include "lab/judge/chunk_detection.hpp"
#include "lab/panel/panel_file.hpp"
#include "lab/panel/panel_plan.hpp"

namespace takt::lab {
namespace {

TEST(ChunkMonitorsRollout, FindFailuresThatVelocityDoesNot) {
  Panel panel = load_panel("config/panels/chunk_monitors.yaml").value();
  panel.seed_count = 24;
  const auto plan = plan_of(panel, {});
  auto contest = Contest::prepare(std::move(panel));
  ASSERT_TRUE(contest) << contest.error();
  std::vector<evidence::RolloutRow> rows;
  for (const PlannedRollout& one : plan) rows.push_back(contest->run(one).value().row);
  constexpr config::ChunkScore kWatched[] = {config::ChunkScore::temporal_error, config::ChunkScore::inefficiency};
  const auto made = detection_of(rows, kWatched, 0.25);
  ASSERT_TRUE(made) << made.error();
  std::printf("%s", detection_text(*made).c_str());
  const auto area = [&](config::ChunkScore score) { return made->auroc[static_cast<std::size_t>(score)].value().area; };
  EXPECT_GE(area(config::ChunkScore::inefficiency), 0.9);
  EXPECT_GE(area(config::ChunkScore::temporal_error), 0.9);
  EXPECT_LT(area(config::ChunkScore::velocity), 0.9);
  EXPECT_GE(10 * made->failed_caught, 9 * made->failed);
  EXPECT_LE(made->nominal_caught, made->nominal / 2);
}

}  // namespace
}  // namespace takt::lab

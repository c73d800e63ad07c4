// SPDX-License-Identifier: Apache-2.0
// Goal: a panel in a world of Python goes on whatever that world does, every bad end is in its row by name, and rows do
// not depend on the number of workers. Method: the cart and pole of docs/examples/python-world, spoilt by seed.
#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <vector>

#include "lab/artifact/rollout_json.hpp"
#include "lab/panel/panel_plan.hpp"
#include "lab/panel/worker_pool.hpp"

namespace takt::lab {
namespace {

using testing::ElementsAre;
using testing::HasSubstr;

Contest balance(std::uint64_t first_seed, std::uint64_t seeds, const std::string& more = "") {
  auto panel = load_panel("docs/examples/python-world/balance.yaml");
  if (!panel) throw std::runtime_error(panel.error());
  panel->first_seed = first_seed;
  panel->seed_count = seeds;
  panel->methods.resize(1);
  panel->perturbations.resize(1);
  panel->tasks[0].bound_m = 1;  // of its ends, not of its errors
  const std::string world = std::string(TAKT_PYTHON) + " tests/simulation/worlds/spoilt_cart_pole.py {}" + more;
  auto contest = Contest::prepare(std::move(*panel), {.world = world});
  if (!contest) throw std::runtime_error(contest.error());
  return std::move(*contest);
}

std::vector<RanRollout> run(Contest contest, std::size_t workers) {
  std::vector<RanRollout> rows;
  const auto done = run_in_workers(contest, plan_of(contest.panel(), {}), workers, [&](const RanRollout& ran) {
    rows.push_back(ran);
    return std::expected<void, std::string>();
  });
  EXPECT_TRUE(done.has_value()) << done.error();
  return rows;
}

TEST(OutsidePanel, GoesOnWhateverItsWorldDoes) {
  const auto rows = run(balance(1, 8), 2);
  std::vector<std::string> labels;
  for (const RanRollout& ran : rows) labels.push_back(ran.row.failure_label);
  EXPECT_THAT(labels, ElementsAre("", "world_hung", "world_died", "world_nonsense", "world_unable", "failed", "", ""));
  EXPECT_THAT(rows[4].post_mortem, HasSubstr("cannot go on: RuntimeError: the renderer lost its screen"));
  EXPECT_THAT(rows[5].post_mortem, HasSubstr("dropped the cup"));
  EXPECT_THAT(rows[1].post_mortem,
              HasSubstr(" --world '" TAKT_PYTHON " tests/simulation/worlds/spoilt_cart_pole.py {}' --only"));
}

TEST(OutsidePanel, RowsDoNotDependOnTheNumberOfWorkers) {
  const auto one = run(balance(7, 4), 1), two = run(balance(7, 4), 2);
  ASSERT_EQ(one.size(), 4U);
  ASSERT_EQ(two.size(), 4U);
  for (std::size_t i = 0; i < one.size(); ++i)
    EXPECT_EQ(row_text(one[i].row, HostFields::left_out).value(), row_text(two[i].row, HostFields::left_out).value());
}

TEST(OutsidePanel, WhatHasToBeDoneAndIsNotHasFailed) {
  const auto rows = run(balance(7, 2, " done"), 1);
  EXPECT_TRUE(rows.at(0).row.success) << rows[0].row.failure_label;
  EXPECT_EQ(rows.at(1).row.failure_label, "not_done");
}

// What the world calls itself is part of what rows may be compared with.
TEST(OutsidePanel, TheWorldIsPartOfTheRobotsPlant) {
  auto panel = load_panel("docs/examples/python-world/balance.yaml");
  ASSERT_TRUE(panel) << panel.error();
  const auto without = Contest::prepare(*panel);
  ASSERT_FALSE(without);
  EXPECT_THAT(without.error(), HasSubstr("name it by --world"));
  panel->tasks[0].task = evidence::Task::cart_pole_balance;
  const auto own = Contest::prepare(*panel);
  ASSERT_TRUE(own) << own.error();
  EXPECT_NE(own->identity({}).plant_sha256, balance(1, 1).identity({}).plant_sha256);
}

}  // namespace
}  // namespace takt::lab

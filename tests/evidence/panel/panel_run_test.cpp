// SPDX-License-Identifier: Apache-2.0
// Goal: rows do not depend on how the work is shared out; a resumed artifact is the one that was never interrupted; a
// worker's error ends the run with its sentence. Method: the smoke panel, shortened, run whole.
#include <gtest/gtest.h>

#include "evidence/artifact/artifact.hpp"
#include "evidence/artifact/rollout_json.hpp"
#include "evidence/panel/panel_plan.hpp"
#include "evidence/panel/panel_table.hpp"
#include "evidence/panel/worker_pool.hpp"
#include "monitor/record/bounded_file.hpp"
#include "tests/monitor/record/temporary_folder.hpp"

namespace takt::panel {
namespace {

Contest smoke() {
  auto panel = load_panel("config/panels/smoke.yaml");
  if (!panel) throw std::runtime_error(panel.error());
  auto contest = Contest::prepare(std::move(*panel));
  if (!contest) throw std::runtime_error(contest.error());
  return std::move(*contest);
}

std::vector<std::string> lines(std::size_t workers) {
  Contest contest = smoke();
  std::vector<std::string> texts;
  const auto done = run_in_workers(contest, plan_of(contest.panel(), {}), workers, [&](const RanRollout& ran) {
    texts.push_back(row_text(ran.row, HostFields::left_out).value_or("not writable") + ran.post_mortem);
    return std::expected<void, std::string>();
  });
  EXPECT_TRUE(done.has_value()) << done.error();
  return texts;
}

TEST(PanelRun, OneWorkerAndTwoGiveTheSameBytes) {
  const std::vector<std::string> one = lines(1);
  EXPECT_EQ(one.size(), 5U);
  EXPECT_EQ(one, lines(2));
  EXPECT_EQ(one, lines(3));
}

class ResumedPanel : public monitor::TemporaryFolder {};

TEST_F(ResumedPanel, AnInterruptedArtifactResumesToTheSameId) {
  Contest contest = smoke();
  const auto plan = plan_of(contest.panel(), {});
  const auto run_into = [&](ArtifactWriter& writer, std::span<const PlannedRollout> some) {
    return run_in_workers(contest, some, 2, [&](const RanRollout& ran) { return writer.append(ran.row); });
  };
  auto whole = ArtifactWriter::create(path("whole"), contest.manifest(plan.size()), contest.panel().text);
  ASSERT_TRUE(whole.has_value()) << whole.error();
  ASSERT_TRUE(run_into(*whole, plan).has_value());
  {
    auto part = ArtifactWriter::create(path("part"), contest.manifest(plan.size()), contest.panel().text);
    ASSERT_TRUE(part.has_value() && run_into(*part, std::span(plan).first(2)).has_value());
    EXPECT_FALSE(part->finish().has_value());
  }
  auto again = ArtifactWriter::resume(path("part"), contest.manifest(plan.size()));
  ASSERT_TRUE(again.has_value()) << again.error();
  std::vector<PlannedRollout> remaining;
  for (const PlannedRollout& one : plan)
    if (!again->has(contest.identity(one))) remaining.push_back(one);
  EXPECT_EQ(remaining.size(), 3U);
  ASSERT_TRUE(run_into(*again, remaining).has_value());
  EXPECT_EQ(again->finish().value().artifact_id, whole->finish().value().artifact_id);
}

// A rollout that fails brings its whole story, and what a person made of it stays.
TEST_F(ResumedPanel, AFailedRolloutBringsItsPostMortem) {
  Contest contest = smoke();
  const auto plan = plan_of(contest.panel(), {});
  const auto crash = std::ranges::find_if(
      plan, [&](const PlannedRollout& one) { return contest.identity(one).perturbation == "policy_crash"; });
  ASSERT_NE(crash, plan.end());
  const auto ran = contest.run(*crash);
  ASSERT_TRUE(ran.has_value()) << ran.error();
  ASSERT_FALSE(ran->row.success) << "nobody re-arms in the smoke panel";
  EXPECT_EQ(ran->row.leading_fault, "inference_stall");
  for (const char* part : {"- inference_stall: ", "## Timeline", "| degraded | damped_stop | command_lost |",
                           "takt panel run config/panels/smoke.yaml --only arm_tracking.policy_crash@2000.takt.s1"})
    EXPECT_NE(ran->post_mortem.find(part), std::string::npos) << part << "\n" << ran->post_mortem;
  const std::string ticks = ran->post_mortem.substr(ran->post_mortem.find("## The ticks around"));
  EXPECT_EQ(std::ranges::count(ticks.substr(0, ticks.find("## See")), '\n'), 28) << "21 ticks and what frames them";

  auto writer = ArtifactWriter::create(path("kept"), contest.manifest(plan.size()), contest.panel().text);
  ASSERT_TRUE(writer.has_value()) << writer.error();
  EXPECT_EQ(keep_post_mortem(writer->folder(), ran->row, ran->post_mortem), true);
  const std::string file = writer->folder().post_mortem(ran->row);
  const std::string completed = ran->post_mortem + "Ada\n";
  ASSERT_TRUE(monitor::replace_file(file, completed));
  EXPECT_EQ(keep_post_mortem(writer->folder(), ran->row, ran->post_mortem), false);
  EXPECT_EQ(monitor::read_file(file).value(), completed);
}

TEST(PanelRun, AnErrorWhileDeliveringEndsTheRun) {
  Contest contest = smoke();
  std::size_t delivered = 0;
  const auto done = run_in_workers(contest, plan_of(contest.panel(), {}), 2,
                                   [&](const RanRollout&) -> std::expected<void, std::string> {
                                     if (++delivered == 2) return std::unexpected("disk full");
                                     return {};
                                   });
  ASSERT_FALSE(done.has_value());
  EXPECT_EQ(done.error(), "disk full");
  EXPECT_EQ(delivered, 2U);
}

}  // namespace
}  // namespace takt::panel

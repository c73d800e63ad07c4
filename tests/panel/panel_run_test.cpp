// Goal: rows do not depend on how the work is shared out; a resumed artifact is the one that was never interrupted; a
// worker's error ends the run with its sentence. Method: the smoke panel, shortened, run whole.
#include <gtest/gtest.h>

#include "monitor/panel/artifact.hpp"
#include "monitor/panel/panel_plan.hpp"
#include "monitor/panel/panel_table.hpp"
#include "monitor/panel/rollout_json.hpp"
#include "monitor/panel/worker_pool.hpp"
#include "tests/monitor/temporary_folder.hpp"

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
  const auto done = run_in_workers(contest, plan_of(contest.panel(), {}), workers, [&](const RolloutRow& row) {
    texts.push_back(row_text(row, HostFields::left_out).value_or("not writable"));
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
    return run_in_workers(contest, some, 2, [&](const RolloutRow& row) { return writer.append(row); });
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

TEST(PanelRun, AnErrorWhileDeliveringEndsTheRun) {
  Contest contest = smoke();
  std::size_t delivered = 0;
  const auto done = run_in_workers(contest, plan_of(contest.panel(), {}), 2,
                                   [&](const RolloutRow&) -> std::expected<void, std::string> {
                                     if (++delivered == 2) return std::unexpected("disk full");
                                     return {};
                                   });
  ASSERT_FALSE(done.has_value());
  EXPECT_EQ(done.error(), "disk full");
  EXPECT_EQ(delivered, 2U);
}

}  // namespace
}  // namespace takt::panel

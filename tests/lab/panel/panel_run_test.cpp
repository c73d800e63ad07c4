// SPDX-License-Identifier: Apache-2.0
// Goal: rows do not depend on how the work is shared out; a resumed artifact is the one that was never interrupted; a
// worker's error ends the run with its sentence. Method: the smoke panel, shortened, run whole.
#include <gtest/gtest.h>

#include <filesystem>

#include "lab/artifact/artifact.hpp"
#include "lab/artifact/inputs.hpp"
#include "lab/artifact/merge.hpp"
#include "lab/artifact/rollout_json.hpp"
#include "lab/panel/kept_inputs.hpp"
#include "lab/panel/panel_plan.hpp"
#include "lab/panel/panel_table.hpp"
#include "lab/panel/recompute.hpp"
#include "lab/panel/sequential_decision.hpp"
#include "lab/panel/worker_pool.hpp"
#include "monitor/record/bounded_file.hpp"
#include "tests/support/temporary_folder.hpp"

namespace takt::lab {
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

class ResumedPanel : public test::TemporaryFolder {};

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

// Goal: an artifact is computed anew from itself alone. Method: a panel whose policy lies above its robot file; its
// files are removed once the rows are there, and what the artifact keeps gives the same rows; one byte of a kept file
// does not.
class KeptPanel : public test::TemporaryFolder {
 protected:
  void SetUp() override {
    namespace fs = std::filesystem;
    fs::create_directories(path("lab/robots"));
    fs::create_directories(path("lab/policies"));
    fs::copy_file("config/arm6_reach.onnx", path("lab/policies/reach.onnx"));
    std::string robot = monitor::read_file("config/arm6.yaml").value();
    const std::string policy = "arm6_reach.onnx ";
    robot.replace(robot.find(policy), policy.size(), "../policies/reach.onnx ");
    ASSERT_TRUE(monitor::replace_file(path("lab/robots/arm.yaml"), robot));
    ASSERT_TRUE(monitor::replace_file(path("lab/panel.yaml"), R"(schema: takt.panel/1
panel: kept
duration: 4 s
seeds: { first: 5, count: 2 }
tasks:
  - { task: arm_tracking, robot: robots/arm.yaml, scored: 1 s, bound: 20 mm }
methods:
  - { name: often }
  - { name: seldom, override: [{ key: policy.period, value: 40 ms }] }
perturbations:
  - { kind: none }
)"));
  }
  // Of the one method, or of both.
  [[nodiscard]] Artifact artifact_of(const std::string& folder, const std::string& method) const {
    auto panel = load_panel(path("lab/panel.yaml")).value();
    if (!method.empty()) std::erase_if(panel.methods, [&](const auto& one) { return one.name != method; });
    Contest contest = Contest::prepare(std::move(panel)).value();
    const auto plan = plan_of(contest.panel(), {});
    ArtifactWriter writer =
        ArtifactWriter::create(path(folder), contest.manifest(plan.size()), contest.panel().text).value();
    EXPECT_TRUE(keep_inputs(contest, writer.folder()));
    const auto done = run_in_workers(contest, plan, 2, [&](const RanRollout& ran) { return writer.append(ran.row); });
    EXPECT_TRUE(done) << done.error();
    EXPECT_TRUE(writer.finish());
    return open_artifact(path(folder)).value();
  }
  [[nodiscard]] static std::expected<Recomputed, std::string> again(const Artifact& artifact) {
    auto panel = load_panel(artifact.folder.panel()).value();
    keep_what_ran(artifact.manifest, panel);
    const auto kept = UnpackedInputs::unpack(artifact.folder);
    if (!kept) return std::unexpected(kept.error());
    panel.tasks.at(0).robot = kept->robots().at("arm_tracking");
    auto contest = Contest::prepare(std::move(panel));
    if (!contest) return std::unexpected(contest.error());
    return recompute(artifact, *contest, {0, 1}, 2);
  }
};

TEST_F(KeptPanel, GiveTheSameRowsWhereNothingElseIsLeft) {
  const Artifact artifact = artifact_of("artifact", "");
  std::filesystem::remove_all(path("lab"));
  std::filesystem::rename(path("artifact"), path("elsewhere"));
  Artifact moved = open_artifact(path("elsewhere")).value();
  const auto result = again(moved);
  ASSERT_TRUE(result) << result.error();
  EXPECT_EQ(result->rows, 2U);
  EXPECT_EQ(result->differences, std::vector<std::string>());
  moved.rows[1].energy_J /= 2;
  EXPECT_EQ(again(moved)->differences.size(), 1U);
}

TEST_F(KeptPanel, AreSealedByTheirHashes) {
  const Artifact artifact = artifact_of("artifact", "often");
  EXPECT_EQ(altered_inputs(artifact.folder), std::vector<std::string>());
  const auto inputs = read_inputs(artifact.folder).value();
  ASSERT_EQ(inputs.tasks.at("arm_tracking").size(), 2U);
  const std::string policy = inputs.tasks.at("arm_tracking").at("../policies/reach.onnx");
  ASSERT_TRUE(monitor::replace_file(artifact.folder.inputs() + "/" + policy, "another"));
  const std::string why = "inputs/" + policy + " is not what was kept";
  EXPECT_EQ(altered_inputs(artifact.folder), std::vector{"../policies/reach.onnx of arm_tracking: " + why});
  EXPECT_EQ(again(artifact).error(), why);
  ASSERT_TRUE(monitor::replace_file(artifact.folder.inputs_file(), "{}\n"));
  EXPECT_EQ(open_artifact(artifact.folder.path()).error(),
            artifact.folder.path() + ": inputs.json is not the file that was sealed");
  std::filesystem::remove(artifact.folder.inputs_file());
  EXPECT_FALSE(open_artifact(artifact.folder.path()));
}

// Paths of a stranger lead nowhere but into the folders that are made for them.
TEST_F(KeptPanel, LeadNowhereElse) {
  const ArtifactFolder folder(path("forged"));
  std::filesystem::create_directories(folder.path());
  const std::string hash = keep_content(folder, "robot").value();
  for (const char* const name :
       {"/etc/passwd", "a/../../../b", "../../../../../../../../../../../../../../../../../x", "./a", "..", ""}) {
    ASSERT_TRUE(
        write_inputs(folder, {.tasks = {{"arm_tracking", {{"robot.yaml", hash}, {name, hash}}}}, .not_kept = {}}));
    EXPECT_EQ(UnpackedInputs::unpack(folder).error(), "inputs.json is not as it was written (takt.inputs/1)") << name;
  }
}

TEST_F(KeptPanel, GoAlongWhenArtifactsAreMerged) {
  const std::vector<Artifact> both{artifact_of("often", "often"), artifact_of("seldom", "seldom")};
  const auto merged = merge(path("merged"), both);
  ASSERT_TRUE(merged) << merged.error();
  std::filesystem::remove_all(path("lab"));
  EXPECT_EQ(again(*merged)->differences, std::vector<std::string>());
}

// A post-mortem that a person wrote, and one of each side, are there after a merge.
TEST_F(KeptPanel, AndSoDoPostMortems) {
  std::vector<Artifact> both{artifact_of("often", "often"), artifact_of("seldom", "seldom")};
  for (const Artifact& artifact : both)
    EXPECT_EQ(keep_post_mortem(artifact.folder, artifact.rows[0], "of " + artifact.rows[0].method), true);
  const Artifact merged = merge(path("merged"), both).value();
  for (const Artifact& artifact : both)
    EXPECT_EQ(monitor::read_file(merged.folder.post_mortem(artifact.rows[0])).value(), "of " + artifact.rows[0].method);
}

TEST(OutsideProgram, IsKnownByTheFilesThatItsCommandNames) {
  const auto files = outside_program("python3 -u 'tests/lab/panel/panel_run_test.cpp' {} --seed 7").files;
  ASSERT_EQ(files.size(), 1U);
  EXPECT_EQ(files.begin()->first, "tests/lab/panel/panel_run_test.cpp");
  EXPECT_EQ(outside_program("/bin/sh -c true").files.size(), 1U);
  EXPECT_EQ(outside_program("").files.size(), 0U);
  ArtifactManifest a, b;
  a.outside.world = b.outside.world = outside_program("sh config/arm6.yaml");
  EXPECT_EQ(difference_between(a, b), "");
  b.outside.world = outside_program("sh config/cart_pole.yaml");
  EXPECT_NE(difference_between(a, b).find("the world's program differs: A has "), std::string::npos);
}

// Goal: a panel ends with the seed that decides, killed and resumed or not. Method: two methods of which one never
// moves; six seeds that all say the same are too few (14.4 of 20), seven are enough (26.8).
class DecidedPanel : public test::TemporaryFolder {
 protected:
  DecidedPanel() {
    Panel panel = load_panel("config/panels/smoke.yaml").value();
    panel.methods = {panel.methods[0], panel.methods[0], panel.methods[0]};
    panel.methods[1].name = "still";
    panel.methods[2].name = "third";
    panel.seed_count = 50;
    rivals = keep_two_methods("still,takt", panel).value();
    plan = plan_of(panel, {});
  }
  [[nodiscard]] evidence::RolloutRow row_of(const PlannedRollout& planned, bool success) const {
    evidence::RolloutRow row;
    row.method = planned.method == 0 ? "takt" : "still";
    row.seed = planned.seed;
    row.success = success;
    return row;
  }
  std::array<std::string, 2> rivals;
  std::vector<PlannedRollout> plan;
};

TEST_F(DecidedPanel, LooksAfterWholeSeedsOnly) {
  SequentialDecision decision(rivals, plan);
  ASSERT_EQ(plan.size(), 500U) << "two methods, five perturbations";
  EXPECT_TRUE(std::ranges::is_sorted(plan, {}, &PlannedRollout::seed));
  for (const PlannedRollout& one : plan) {
    decision.add(row_of(one, one.method == 0));
    if (decision.is_made()) break;
  }
  EXPECT_EQ(decision.text(), "decided: takt succeeds more often than still after 7 seeds, evidence 26.8 of 20");
}

TEST_F(DecidedPanel, StaysUndecidedBetweenEquals) {
  SequentialDecision decision(rivals, plan);
  for (const PlannedRollout& one : plan) decision.add(row_of(one, one.seed % 2 == one.method));
  EXPECT_EQ(decision.seeds(), 50U);
  EXPECT_FALSE(decision.is_made());
  EXPECT_EQ(decision.text().substr(0, 51), "undecided between still and takt after 50 seeds, ev");
}

TEST(KeepTwoMethods, SaysWhatToWrite) {
  Panel panel = load_panel("config/panels/smoke.yaml").value();
  EXPECT_EQ(keep_two_methods("takt", panel).error(), "write two methods, such as takt,plain");
  EXPECT_EQ(keep_two_methods("takt,a,b", panel).error(), "write two methods, such as takt,plain");
  EXPECT_EQ(keep_two_methods("takt,takt", panel).error(), "write two different methods");
  EXPECT_EQ(keep_two_methods("takt,plain", panel).error(), "the panel has no method plain");
  EXPECT_EQ(panel.methods.size(), 1U);
}

// What the workers would still say does not fit into their pipes.
TEST(PanelRun, EndsWhenItIsEnough) {
  auto panel = load_panel("config/panels/smoke.yaml");
  panel->seed_count = 10'000;
  panel->duration = milliseconds(3'500);
  Contest contest = Contest::prepare(std::move(*panel)).value();
  for (const std::size_t workers : {1U, 2U, 3U}) {
    std::size_t delivered = 0;
    const auto done = run_in_workers(
        contest, plan_of(contest.panel(), {}), workers,
        [&](const RanRollout&) -> std::expected<void, std::string> {
          ++delivered;
          return {};
        },
        [&] { return delivered == 2; });
    EXPECT_TRUE(done.has_value());
    EXPECT_EQ(delivered, 2U);
  }
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
}  // namespace takt::lab

// SPDX-License-Identifier: Apache-2.0
// Goal: an artifact counts as audit-ready only when nothing that a sceptic asks for is missing.
// Method: a whole artifact with completed post-mortems is ready; then one thing at a time is taken away.
#include "lab/judge/audit.hpp"

#include <gtest/gtest.h>
#include <sys/stat.h>

#include <algorithm>
#include <array>
#include <expected>
#include <filesystem>

#include "lab/judge/post_mortem.hpp"
#include "lab/judge/run_audit.hpp"
#include "lab/panel/panel_promise.hpp"
#include "monitor/record/bounded_file.hpp"
#include "tests/lab/artifact/sample_artifact.hpp"
#include "tests/lab/artifact/sample_rows.hpp"
#include "tests/monitor/record/recorded_demo.hpp"
#include "tests/support/temporary_folder.hpp"

namespace takt::lab {
namespace {

class AuditTest : public test::TemporaryFolder {
 protected:
  const std::string folder = path("artifact");
  std::vector<evidence::RolloutRow> rows{sample_row("fast", 1), failed_row("fast", 1)};
  ArtifactManifest manifest;
  // The panel file's own words.
  PanelPromise promise{.claims = sample_manifest({}, 0).claims,
                       .methods = {{"fast", {}}},
                       .conditions = {{"reach", "none", 0}, {"reach", "stall", 400}},
                       .outcomes = {{"reach", {.bound_m = 0.02, .duration_s = 2}}},
                       .contracts = {{{"fast", "reach"}, {}}}};
  AuditTest() {
    rows[0].run_folder.clear();
    rows[1].run_folder.clear();
    rows[1].perturbation = "stall";
    rows[1].dose = 400;
    manifest = planned({"fast"}, 2);
  }
  // Of two rollouts per method: one seed, two conditions.
  static ArtifactManifest planned(const std::vector<std::string>& methods, std::uint64_t rollouts) {
    ArtifactManifest made = sample_manifest(methods, rollouts);
    made.seed_plan = {.rule = "seed 1", .seeds = {1}};
    return made;
  }
  [[nodiscard]] Audit judged(const Artifact& artifact) const { return audit(artifact, promise); }
  [[nodiscard]] std::string post_mortem() const { return folder + "/postmortems/reach.stall@400.fast.s1.md"; }
  void sign(const std::string& who) const {
    std::string text = monitor::read_file(post_mortem()).value();
    const std::string line = "completed-by:";
    text.replace(text.find(line), std::string::npos, line + who + "\n");
    ASSERT_TRUE(monitor::replace_file(post_mortem(), text));
  }
  void conclude(const std::string& what) const {
    std::string text = monitor::read_file(post_mortem()).value();
    ASSERT_TRUE(monitor::replace_file(post_mortem(), text.insert(text.find("completed-by:"), what + "\n\n")));
  }
  // Drafted and signed.
  [[nodiscard]] Artifact whole() const {
    Artifact artifact = write_artifact(folder, manifest, rows);
    EXPECT_EQ(draft_post_mortems(artifact), 1U);
    conclude("The policy stalled; the stop was right.");
    sign(" A. Tester");
    return artifact;
  }
  static std::vector<std::string> missing(const Audit& audit, std::string_view name) {
    return std::ranges::find(audit.items, name, &AuditItem::name)->missing;
  }
  using Missing = std::vector<std::string>;
};

TEST_F(AuditTest, AWholeArtifactIsReadyAndAnswersByName) {
  const Artifact artifact = whole();
  Audit result = judged(artifact);
  EXPECT_TRUE(result.is_consistent());
  EXPECT_FALSE(result.is_ready()) << "a forger who recomputes every hash gets here";
  EXPECT_TRUE(audit_text(result).ends_with(
      "rests on            consistent; no row computed anew\n"
      "consistent: nothing is missing; --recompute, --signed-by or --registered-by makes it audit-ready\n"));
  result.recomputed = Recomputed{.rows = 1, .of = 2, .differences = {}};
  const std::string id = artifact.manifest.artifact_id;
  EXPECT_EQ(audit_text(result),
            "metric contract     fast on reach: Pr(age > 40 ms) <= 5 % at 95 % confidence\n"
            "perturbation panel  smoke, 1 seeds (seed 1): none 1, stall 1.\n"
            "monitor state       ended in damped_stop (command_lost) 1, tracking 1\n"
            "artifact id         " +
                id +
                "\n"
                "run folders         none was kept\n"
                "inputs              none kept: --recompute needs --panel\n"
                "registration        none\n"
                "fault verdicts      the panel plants no cause that the classifier names\n"
                "conceptual claim    late actions destabilise\n"
                "systems claim       how stale chunks are refused\n"
                "evidence claim      p95 age and success under stalls\n"
                "post-mortems        1 of 1 failed rollouts\n"
                "rests on            consistent; 1 of 2 rows computed anew\n"
                "audit-ready\n");
  EXPECT_EQ(to_json(result)["audit_ready"], true);
  result.recomputed->differences = {"row 2 says 1 where 2 comes out"};
  EXPECT_FALSE(result.is_ready());
  EXPECT_TRUE(
      audit_text(result).ends_with("recomputed          differs: row 2 says 1 where 2 comes out\n"
                                   "rests on            consistent; 1 of 2 rows computed anew, 1 came out otherwise\n"
                                   "not audit-ready\n"));
}

TEST_F(AuditTest, AKeyThatTheReaderNamesMakesItReady) {
  Audit result = judged(whole());
  result.vouching.signed_by = "3f9a2c";
  EXPECT_TRUE(result.is_ready());
  EXPECT_TRUE(audit_text(result).ends_with("consistent; no row computed anew; signed by 3f9a2c\naudit-ready\n"));
  EXPECT_EQ(to_json(result)["signed_by"]["key"], "3f9a2c");
  result.vouching.signed_by = std::unexpected("it is not signed by that key");
  EXPECT_FALSE(result.is_consistent());
  EXPECT_TRUE(
      audit_text(result).ends_with("signature           differs: it is not signed by that key\n"
                                   "rests on            consistent; no row computed anew; not signed by that key\n"
                                   "not audit-ready\n"));
}

// A registration makes it ready as well, where it is older than the first row and nothing ran otherwise; it says
// nothing of the rows.
TEST_F(AuditTest, ARegistrationThatHoldsMakesItReady) {
  Audit result = judged(whole());
  Registered registered{.key = "3f9a2c",
                        .unix_ns = 1'000'000'000,
                        .stamped_by = "CN=clock",
                        .first_row_unix_ns = 2'000'000'000,
                        .comparison = "b against a, margin 2 %",
                        .differences = {}};
  result.registered = registered;
  EXPECT_TRUE(result.is_ready());
  EXPECT_TRUE(audit_text(result).ends_with(
      "registered          1970-01-01T00:00:01.000Z by CN=clock; the first row is not older than "
      "1970-01-01T00:00:02.000Z\n"
      "                    to decide: b against a, margin 2 %\n"
      "rests on            consistent; no row computed anew; registered by 3f9a2c\naudit-ready\n"));
  EXPECT_EQ(to_json(result)["registered"]["older"], true);
  registered.differences = {"seeds: seed 1 registered, seed 2 ran"};
  result.registered = registered;
  EXPECT_FALSE(result.is_consistent());
  EXPECT_TRUE(audit_text(result).ends_with(
      "                    differs: seeds: seed 1 registered, seed 2 ran\n"
      "rests on            consistent; no row computed anew; registered otherwise than it ran\nnot audit-ready\n"));
  registered.differences.clear();
  registered.unix_ns = 3'000'000'000;
  result.registered = registered;
  EXPECT_FALSE(result.is_consistent());
  EXPECT_NE(audit_text(result).find("differs: the panel had begun\n"), std::string::npos);
  result.registered = std::unexpected("it keeps no registration");
  EXPECT_FALSE(result.is_ready());
}

// Goal: whatever is done to a kept recording of a sealed artifact is missing by name. Method: each of its files
// altered, cut, taken away, made a pipe, in turn; what came to lie beside them later does not count.
TEST_F(AuditTest, EveryFileOfAKeptRunFolderIsSealed) {
  const std::string place = "runs/reach.none@0.fast.s1/run";
  rows[0].run_folder = place;
  std::filesystem::create_directories(folder + "/" + place + "/images");
  const std::array files{place + "/ticks.mcap", place + "/can.log", place + "/images/1.pgm",
                         std::string("runs/truth.jsonl")};
  for (const std::string& file : files) ASSERT_TRUE(monitor::replace_file(folder + "/" + file, "of " + file));
  const Artifact artifact = whole();
  EXPECT_EQ(missing(judged(artifact), "run folders"), Missing{});
  ASSERT_TRUE(monitor::replace_file(folder + "/" + place + "/report.html", "written later"));
  EXPECT_EQ(missing(judged(artifact), "run folders"), Missing{});
  for (const std::string& file : files) {
    const std::string path = folder + "/" + file;
    for (const char* const forged : {"of something else", "of ", ""}) {
      ASSERT_TRUE(monitor::replace_file(path, forged));
      EXPECT_EQ(missing(judged(artifact), "run folders"), Missing{file + " is not the file that was sealed"});
    }
    std::filesystem::remove(path);
    EXPECT_EQ(missing(judged(artifact), "run folders"), Missing{file + ": No such file or directory"});
    ASSERT_EQ(mkfifo(path.c_str(), 0600), 0);
    EXPECT_EQ(missing(judged(artifact), "run folders"), Missing{file + ": is not a regular file"});
    std::filesystem::remove(path);
    ASSERT_TRUE(monitor::replace_file(path, "of " + file));
  }
}

TEST_F(AuditTest, AFailureWithoutACompletedPostMortemIsNotReady) {
  const Artifact artifact = write_artifact(folder, manifest, rows);
  EXPECT_EQ(missing(judged(artifact), "post-mortems"),
            Missing{"row 2 failed (command_lost) and postmortems/reach.stall@400.fast.s1.md does not exist"});
  ASSERT_EQ(draft_post_mortems(artifact), 1U);
  const Audit drafted = judged(artifact);
  EXPECT_EQ(missing(drafted, "post-mortems"),
            Missing{"row 2 failed (command_lost) and postmortems/reach.stall@400.fast.s1.md is not completed"});
  EXPECT_FALSE(drafted.is_consistent());
  EXPECT_TRUE(audit_text(drafted).ends_with("1 missing; no row computed anew\nnot audit-ready\n"));
  EXPECT_EQ(to_json(drafted)["audit_ready"], false);
  sign("  ");
  EXPECT_FALSE(judged(artifact).is_consistent());
  sign(" A. Tester");
  EXPECT_EQ(
      missing(judged(artifact), "post-mortems"),
      Missing{"row 2 failed (command_lost) and postmortems/reach.stall@400.fast.s1.md has a name and no conclusion"});
  conclude("It stalled.");
  EXPECT_FALSE(judged(artifact).is_consistent()) << "two words";
  conclude("The stop was right.");
  EXPECT_TRUE(judged(artifact).is_consistent());
  // What a person wrote stays.
  EXPECT_EQ(draft_post_mortems(artifact), 0U);
  EXPECT_EQ(completed_by(monitor::read_file(post_mortem()).value()), "A. Tester");
}

TEST_F(AuditTest, NamesEveryMissingClaim) {
  manifest.claims = promise.claims = {};
  const Audit result = judged(whole());
  for (const char* claim : {"conceptual", "systems", "evidence"}) {
    EXPECT_EQ(missing(result, std::string(claim) + " claim"),
              Missing{std::string("the panel file has no claims.") + claim});
  }
}

TEST_F(AuditTest, AClaimThatThePanelDoesNotMakeIsNamed) {
  manifest.claims.evidence = "anything at all";
  const Audit result = judged(whole());
  EXPECT_EQ(missing(result, "evidence claim"), Missing{"the manifest claims otherwise: anything at all"});
  EXPECT_EQ(std::ranges::find(result.items, "evidence claim", &AuditItem::name)->answer,
            "p95 age and success under stalls");
  EXPECT_TRUE(missing(result, "systems claim").empty());
}

TEST_F(AuditTest, AClaimIsASentence) {
  manifest.claims = promise.claims = {"c", "s", "two words"};
  const Audit result = judged(whole());
  EXPECT_EQ(missing(result, "conceptual claim"), Missing{"claims.conceptual claims nothing in 1 words"});
  EXPECT_EQ(missing(result, "systems claim"), Missing{"claims.systems claims nothing in 1 words"});
  EXPECT_EQ(missing(result, "evidence claim"), Missing{"claims.evidence claims nothing in 2 words"});
}

// Goal: a method that did badly is not left out in silence. Method: the panel file has one more than the manifest.
TEST_F(AuditTest, AMethodOfThePanelThatIsNotShownIsNamed) {
  promise.methods["slow"];
  EXPECT_EQ(missing(judged(whole()), "perturbation panel"), Missing{"not shown: method slow of panel.yaml"});
}

// Goal: a row's end is one that the panel's rollouts can have. Method: one row at a time, sound but for that.
TEST_F(AuditTest, ARowThatThePanelContradictsIsNamed) {
  const auto named = [&](void (*spoil)(evidence::RolloutRow&)) {
    const std::vector<evidence::RolloutRow> sound = rows;
    spoil(rows[0]);
    std::filesystem::remove_all(folder);
    const Missing found = missing(judged(write_artifact(folder, manifest, rows)), "monitor state");
    rows = sound;
    return found;
  };
  EXPECT_EQ(named([](evidence::RolloutRow&) {}), Missing{});
  EXPECT_EQ(named([](evidence::RolloutRow& row) { row.tracking_error_rms_m = 5; }),
            Missing{"row 1 is a success with 5 m of error, and panel.yaml's bound is 0.02 m"});
  EXPECT_EQ(named([](evidence::RolloutRow& row) { row.success = false, row.failure_label = "tracking_error"; }),
            Missing{"row 1 failed by an error of 0.01 m, and panel.yaml's bound is 0.02 m"});
  EXPECT_EQ(named([](evidence::RolloutRow& row) {
              row.ticks = 1;
              row.misses_per_tick = {.misses = 0, .count = 0, .rate = 0, .effective_count = 0, .upper_bound = 1};
              row.mode_share = {0, 0, 1, 0, 0, 0};
            }),
            Missing{"row 1 is a success of 1 ticks, and 2 s have at least 10"});
  EXPECT_EQ(named([](evidence::RolloutRow& row) { row.ticks = 30'000; }),
            Missing{"row 1 has 30000 ticks, and 2 s have at most 20001"});
}

TEST_F(AuditTest, AConditionThatNoMethodRanIsNamed) {
  promise.conditions.push_back({"reach", "policy_freeze", 500});
  EXPECT_EQ(missing(judged(whole()), "perturbation panel"),
            Missing{"no method ran 1 of the 3 conditions of panel.yaml, such as reach.policy_freeze@500 with seed 1"});
  promise.conditions.erase(promise.conditions.begin() + 1, promise.conditions.end());
  EXPECT_EQ(missing(judged(*open_artifact(folder)), "perturbation panel"),
            Missing{"1 conditions are not in panel.yaml"});
}

TEST_F(AuditTest, AContractThatThePanelDoesNotGiveIsNamed) {
  promise.contracts.at({"fast", "reach"}) = {.max_age_ms = 25, .epsilon = 0.05, .confidence = {}};
  EXPECT_EQ(missing(judged(whole()), "metric contract"),
            Missing{"panel.yaml gives method fast on reach max_age in ms 25, the manifest says 40"});
  promise.contracts.clear();
  EXPECT_EQ(missing(judged(*open_artifact(folder)), "metric contract"),
            Missing{"panel.yaml has no method fast on reach"});
}

TEST_F(AuditTest, APanelThatCannotBeReadIsNamed) {
  const Audit result = audit(whole(), std::unexpected("panel.yaml:1:1: holds no panel"));
  EXPECT_EQ(missing(result, "perturbation panel"),
            Missing{"panel.yaml is no panel of this version: panel.yaml:1:1: holds no panel"});
  EXPECT_FALSE(result.is_consistent());
}

// What a panel file in an artifact's folder says, its robot files being elsewhere.
TEST_F(AuditTest, APanelsPromiseIsItsFilesOwn) {
  ASSERT_TRUE(monitor::replace_file(path("panel.yaml"), R"(schema: takt.panel/1
panel: lab
duration: 4 s
seeds: { count: 2 }
claims: { conceptual: why, systems: which, evidence: what }
tasks:
  - { task: arm_tracking, robot: nowhere.yaml, scored: 1 s, bound: 5 mm, override: [{ key: freshness.max_age, value: 200 ms }] }
  - { task: cart_pole_balance, robot: nowhere.yaml, scored: 1 s, bound: 5 mm }
methods:
  - { name: a }
  - { name: b, override: [{ key: freshness.max_age, value: 250 ms }, { key: freshness.epsilon, value: "0.01" }] }
perturbations:
  - { kind: none }
  - { kind: policy_freeze, dose: 400, tasks: [arm_tracking] }
)"));
  const auto said = panel_promise(path("panel.yaml"));
  ASSERT_TRUE(said) << said.error();
  EXPECT_EQ(said->claims, (Claims{"why", "which", "what"}));
  ASSERT_EQ(said->conditions.size(), 3U);
  EXPECT_EQ(said->conditions[1], (PanelPromise::Condition{"arm_tracking", "policy_freeze", 400}));
  EXPECT_EQ(said->conditions[2], (PanelPromise::Condition{"cart_pole_balance", "none", 0}));
  EXPECT_EQ(said->methods.at("a"), PanelPromise::Configuration());
  EXPECT_EQ(said->methods.at("b"),
            (PanelPromise::Configuration{{"freshness.epsilon", "0.01"}, {"freshness.max_age", "250 ms"}}));
  EXPECT_EQ(said->outcomes.at("cart_pole_balance").bound_m, 0.005);
  EXPECT_EQ(said->outcomes.at("arm_tracking").duration_s, 4);
  EXPECT_EQ(said->contracts.at({"a", "arm_tracking"}).max_age_ms, 200);
  EXPECT_EQ(said->contracts.at({"b", "arm_tracking"}).max_age_ms, 250);
  EXPECT_EQ(said->contracts.at({"b", "cart_pole_balance"}).epsilon, 0.01);
  EXPECT_FALSE(said->contracts.at({"a", "cart_pole_balance"}).max_age_ms);
  ASSERT_TRUE(monitor::replace_file(path("panel.yaml"), "panel"));
  EXPECT_FALSE(panel_promise(path("panel.yaml")));
}

TEST_F(AuditTest, NamesWhatThePanelLacks) {
  rows.erase(rows.begin());
  manifest.planned_rollouts = 1;
  promise.conditions.erase(promise.conditions.begin());
  const Artifact artifact = whole();
  EXPECT_EQ(missing(judged(artifact), "perturbation panel"), Missing{"no rollout was nominal"});
  ASSERT_TRUE(monitor::replace_file(folder + "/panel.yaml", "another"));
  EXPECT_EQ(missing(judged(artifact), "perturbation panel"),
            (Missing{"no rollout was nominal", "panel.yaml is not the panel that the manifest names"}));
  std::filesystem::remove(folder + "/panel.yaml");
  EXPECT_EQ(missing(judged(artifact), "perturbation panel").back(), "panel.yaml is not in the folder");
}

TEST_F(AuditTest, NamesHolesUnfinishedPanelsAndForeignColumns) {
  manifest = planned({"fast", "slow"}, 4);
  manifest.methods.at("slow").tasks.at("reach").epsilon = 0;
  promise.contracts[{"slow", "reach"}];
  rows.push_back(sample_row("slow", 1));
  rows.back().replay_hash.clear();
  Artifact artifact = write_artifact(folder, manifest, rows);
  Audit result = judged(artifact);
  EXPECT_EQ(missing(result, "metric contract"), Missing{"method slow states no freshness contract on reach"});
  EXPECT_EQ(missing(result, "perturbation panel"), Missing{"method slow lacks 1 of 2 conditions"});
  EXPECT_EQ(missing(result, "monitor state"), Missing{"1 rows have no replay hash"});
  EXPECT_EQ(missing(result, "artifact id"), Missing{"the panel is unfinished: 3 of 4 planned rollouts"});

  artifact = write_artifact(path("done"), sample_manifest({"fast"}, 1), {rows[0]});
  ASSERT_TRUE(monitor::replace_file(artifact.folder.parquet(), "PAR1"));
  EXPECT_EQ(missing(judged(artifact), "artifact id"),
            Missing{"rollouts.parquet does not hold the rows of rollouts.jsonl"});
}

// From records: causes by the classifier, the timeline, twenty ticks around the stop, and the command that replays.
TEST_F(AuditTest, APostMortemIsDraftedFromTheRunFolder) {
  rows[1].run_folder = "run";
  const Artifact artifact = write_artifact(folder, manifest, rows);
  (void)monitor::record_demo(folder + "/run");
  ASSERT_EQ(draft_post_mortems(artifact), 1U);
  const std::string text = monitor::read_file(post_mortem()).value();
  EXPECT_TRUE(text.starts_with("# Post-mortem: reach.stall@400.fast.s1\n")) << text;
  EXPECT_TRUE(text.ends_with("\ncompleted-by:\n")) << text;
  for (const std::string& part :
       std::vector<std::string>{"| failure | command_lost |", "- inference_stall: ", "| damped_stop | command_lost |",
                                "| damped_stop (command_lost) |", "takt replay " + folder + "/run\n"}) {
    EXPECT_NE(text.find(part), std::string::npos) << part << " in\n" << text;
  }
  const std::size_t table = text.find("| tick | mode |");
  EXPECT_EQ(std::count(text.begin() + static_cast<std::ptrdiff_t>(table), text.end(), '|') / 13, 2 + 21);
}

TEST(FailureWatch, KeepsTheWorstFailureWithTenTicksOnEachSide) {
  FailureWatch watch;
  TickRecordHeader header;
  header.mode = Mode::tracking;
  for (std::uint64_t tick = 1; tick <= 100; ++tick) {
    header.tick = tick;
    header.previous_mode = header.mode;
    if (tick == 30) header.mode = Mode::degraded;
    if (tick == 50) header.mode = Mode::damped_stop;
    if (tick == 70) header.mode = Mode::standby;
    watch.tick(header);
  }
  ASSERT_EQ(watch.around().size(), 21U);
  EXPECT_EQ(watch.around().front().tick, 40U);
  EXPECT_EQ(watch.around().back().tick, 60U);
  EXPECT_EQ(watch.transitions().size(), 3U);
}

TEST(FailureWatch, WithoutAStopKeepsTheLastTicks) {
  FailureWatch watch;
  TickRecordHeader header;
  for (header.tick = 1; header.tick <= 100; ++header.tick) watch.tick(header);
  EXPECT_EQ(watch.around().back().tick, 100U);
  EXPECT_EQ(watch.around().size(), 11U);
}

// Goal: leaving outputs out of a run's record makes no run consistent. Method: a sealed run that reproduces, then the
// same with an output that was not compared.
TEST(RunAudit, ARunThatLacksAnOutputIsNotConsistent) {
  evidence::ReplayReport replay;
  replay.ticks = replay.identical = 10;
  RunAudit audit{"run", monitor::CheckedSeal{}, replay, {}};
  audit.seal->closed = true;
  EXPECT_TRUE(audit.is_consistent());
  audit.replay->not_compared = {"tau_command"};
  EXPECT_FALSE(audit.is_consistent());
  EXPECT_NE(audit_text(audit).find("replayed in part"), std::string::npos) << audit_text(audit);
}

}  // namespace
}  // namespace takt::lab

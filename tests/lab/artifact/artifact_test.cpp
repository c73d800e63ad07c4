// SPDX-License-Identifier: Apache-2.0
// Goal: an artifact holds exactly the rows that its manifest stands for, through crashes and against mixtures.
// Method: artifacts written, cut at every byte of a row, resumed; rows and manifests altered by hand.
#include "lab/artifact/artifact.hpp"

#include <gtest/gtest.h>
#include <unistd.h>

#include <filesystem>
#include <functional>

#include "config/load.hpp"
#include "lab/artifact/rollout_fields.hpp"
#include "lab/artifact/rollout_json.hpp"
#include "monitor/record/bounded_file.hpp"
#include "tests/lab/artifact/sample_artifact.hpp"
#include "tests/lab/artifact/sample_rows.hpp"
#include "tests/support/files.hpp"
#include "tests/support/temporary_folder.hpp"

namespace takt::lab {
namespace {

class ArtifactTest : public test::TemporaryFolder {
 protected:
  const std::string folder = path("artifact");
  const ArtifactManifest manifest = sample_manifest({"method-a", "method-b"}, 4);
  const std::vector<evidence::RolloutRow> rows{sample_row("method-a", 1), failed_row("method-a", 2),
                                               sample_row("method-b", 1), sample_row("method-b", 2)};

  void replace(const std::string& file, const std::string& what, const std::string& by) const {
    std::string text = monitor::read_file(file).value();
    const std::size_t place = text.find(what);
    ASSERT_NE(place, std::string::npos) << what;
    ASSERT_TRUE(monitor::replace_file(file, text.replace(place, what.size(), by)));
  }
  [[nodiscard]] std::string refusal() const {
    const auto artifact = open_artifact(folder);
    return artifact ? "opened" : artifact.error();
  }
  [[nodiscard]] std::string resume_refusal(const ArtifactManifest& wanted) const {
    const auto writer = ArtifactWriter::resume(folder, wanted);
    return writer ? "resumed" : writer.error();
  }
};

TEST_F(ArtifactTest, ComesBackAsItWasWritten) {
  const Artifact artifact = write_artifact(folder, manifest, rows);
  EXPECT_TRUE(artifact.manifest.complete);
  EXPECT_EQ(artifact.manifest.artifact_id, artifact_id_of(manifest, rows));
  EXPECT_TRUE(artifact.manifest.artifact_id.starts_with("smoke-"));
  EXPECT_GE(artifact.manifest.ended_unix_ns, artifact.manifest.started_unix_ns);
  EXPECT_EQ(artifact.manifest.methods, manifest.methods);
  EXPECT_EQ(artifact.manifest.seed_plan, manifest.seed_plan);
  EXPECT_EQ(artifact.manifest.claims, manifest.claims);
  ASSERT_EQ(artifact.rows.size(), rows.size());
  for (std::size_t index = 0; index < rows.size(); ++index) {
    EXPECT_EQ(row_text(artifact.rows[index]), row_text(rows[index]));
  }
  EXPECT_TRUE(std::filesystem::exists(artifact.folder.parquet()));
  EXPECT_EQ(monitor::read_file(artifact.folder.schema()).value(), rollout_schema());
}

TEST_F(ArtifactTest, TheIdDependsOnEveryRowButNotOnHostOrOrder) {
  std::vector<evidence::RolloutRow> other = rows;
  other[3].host.wall_s = 77;
  EXPECT_EQ(artifact_id_of(manifest, other), artifact_id_of(manifest, rows));
  std::swap(other[0], other[2]);
  EXPECT_EQ(artifact_id_of(manifest, other), artifact_id_of(manifest, rows));
  other[3].energy_J += 1e-9;
  EXPECT_NE(artifact_id_of(manifest, other), artifact_id_of(manifest, rows));
}

TEST_F(ArtifactTest, TheIdDependsOnWhatTheRowsDoNotSayOfThemselves) {
  const auto other = [&](const std::function<void(ArtifactManifest&)>& change) {
    ArtifactManifest changed = manifest;
    change(changed);
    return artifact_id_of(changed, rows) != artifact_id_of(manifest, rows);
  };
  const auto facts = [](ArtifactManifest& m) -> TaskFacts& { return m.methods.at("method-b").tasks.at("reach"); };
  EXPECT_TRUE(other([&](ArtifactManifest& m) { facts(m).max_age_ms = 25; }));
  EXPECT_TRUE(other([&](ArtifactManifest& m) { facts(m).epsilon = 0.5; }));
  EXPECT_TRUE(other([&](ArtifactManifest& m) { facts(m).confidence = 0.5; }));
  EXPECT_TRUE(other([](ArtifactManifest& m) { m.seed_plan.seeds.pop_back(); }));
  EXPECT_TRUE(other([](ArtifactManifest& m) { m.timing = Timing::real; }));
  EXPECT_FALSE(other([](ArtifactManifest& m) { m.merged_from.emplace_back("smoke-1"); })) << "shards make the same";
}

// A writer killed inside any write of the third row: the two before it are there, the panel goes on, and the finished
// bytes are those of a panel that was never interrupted.
TEST_F(ArtifactTest, ResumesBehindATornRow) {
  write_artifact(path("whole"), manifest, rows);
  const std::string whole = monitor::read_file(path("whole") + "/rollouts.jsonl").value();
  const std::size_t second = whole.find('\n', whole.find('\n') + 1) + 1;
  const std::size_t third = whole.find('\n', second);
  write_artifact(folder, manifest, {rows[0], rows[1]});
  const std::string file = folder + "/rollouts.jsonl";
  for (std::size_t cut = second; cut <= third; cut += 97) {
    ASSERT_TRUE(monitor::replace_file(file, whole.substr(0, cut)));
    if (cut > second) {
      ASSERT_EQ(
          refusal(),
          file + ": row 3 is cut off; go on with an unfinished panel by --resume, take a whole copy of a finished one");
    }
    const auto writer = ArtifactWriter::resume(folder, manifest);
    ASSERT_TRUE(writer) << writer.error();
    ASSERT_EQ(writer->rows().size(), 2U);
    ASSERT_TRUE(writer->has(rows[1]));
    ASSERT_FALSE(writer->has(rows[2]));
  }
  auto writer = ArtifactWriter::resume(folder, manifest);
  ASSERT_TRUE(writer);
  EXPECT_EQ(writer->finish().error(), folder + " has 2 of 4 planned rollouts");
  ASSERT_TRUE(writer->append(rows[2]));
  ASSERT_TRUE(writer->append(rows[3]));
  ASSERT_TRUE(writer->finish());
  EXPECT_EQ(monitor::read_file(file).value(), whole);
  EXPECT_EQ(resume_refusal(manifest), "cannot go on with " + folder + ": it is complete");
}

// A writer killed between a row and its seal: the row is written again.
TEST_F(ArtifactTest, ResumesBehindARowWithoutItsSeal) {
  write_artifact(folder, manifest, {rows[0], rows[1]});
  const std::string seals = monitor::read_file(folder + "/rollouts.sha256").value();
  for (const std::string& left : {seals.substr(0, 65), seals.substr(0, 100)}) {
    ASSERT_TRUE(monitor::replace_file(folder + "/rollouts.sha256", left));
    auto writer = ArtifactWriter::resume(folder, manifest);
    ASSERT_TRUE(writer) << writer.error();
    EXPECT_EQ(writer->rows().size(), 1U);
    ASSERT_TRUE(writer->append(rows[1]));
    EXPECT_EQ(monitor::read_file(folder + "/rollouts.sha256").value(), seals);
  }
}

// Goal: the schema beside the rows is theirs, even with new seals. Method: it is exchanged in an artifact that
// has no seal yet.
TEST_F(ArtifactTest, TheSchemaFileIsTheOneThatTheManifestNames) {
  write_artifact(folder, manifest, {rows[0]});
  ASSERT_TRUE(monitor::replace_file(folder + "/rollout.schema.json", "{}"));
  EXPECT_EQ(refusal(), folder + "/rollout.schema.json: not the row schema that manifest.json names");
  EXPECT_EQ(resume_refusal(manifest), refusal());
}

// Goal: the tool that finishes an artifact takes no row that it did not write. Method: a finished artifact is made
// unfinished by hand, as a forger who wants other rows does it, and gone on with.
TEST_F(ArtifactTest, EditedRowsAreNotSealedByGoingOn) {
  write_artifact(folder, manifest, rows);
  const std::string file = folder + "/rollouts.jsonl", id = artifact_id_of(manifest, rows);
  replace(folder + "/manifest.json", "\"complete\": true", "\"complete\": false");
  replace(folder + "/manifest.json", id, "");
  EXPECT_EQ(resume_refusal(manifest),
            folder + ": manifest.json says that it is unfinished, and seal.json that it was finished");
  ASSERT_TRUE(std::filesystem::remove(folder + "/seal.json"));
  replace(file, "\"energy_J\":12.5", "\"energy_J\":12.25");
  EXPECT_EQ(resume_refusal(manifest),
            folder + ": row 1 is not the one that was written: its seal in rollouts.sha256 is another's");
  const std::string text = monitor::read_file(file).value();
  ASSERT_TRUE(monitor::replace_file(file, text + text.substr(0, text.find('\n') + 1)));
  EXPECT_NE(resume_refusal(manifest), "resumed") << "a row twice";
}

TEST_F(ArtifactTest, EveryFileOfAFinishedArtifactIsSealed) {
  write_artifact(folder, manifest, rows);
  for (const char* const name : {"manifest.json", "panel.yaml", "rollout.schema.json", "rollouts.sha256",
                                 "rollouts.parquet", "confusion.json"}) {
    const std::string file = folder + "/" + name, text = monitor::read_file(file).value();
    ASSERT_TRUE(monitor::replace_file(file, text + "\n"));
    EXPECT_NE(refusal(), "opened") << name;
    ASSERT_TRUE(monitor::replace_file(file, text));
    ASSERT_EQ(refusal(), "opened") << name;
  }
  ASSERT_TRUE(monitor::replace_file(folder + "/manifest.json",
                                    monitor::read_file(folder + "/manifest.json").value() + std::string("\0{}", 3)));
  EXPECT_EQ(refusal(), folder + "/manifest.json is not JSON: it has a NUL byte");
}

TEST_F(ArtifactTest, TwoWritersAreOneTooMany) {
  const auto first = ArtifactWriter::create(folder, manifest, kPanelText);
  ASSERT_TRUE(first) << first.error();
  EXPECT_EQ(resume_refusal(manifest),
            folder + " is being written by process " + std::to_string(::getpid()) + "; wait for it, or end it");
}

// Goal: a row that cannot be is refused, by its own sentence. Method: one field of a sound row at a time.
TEST_F(ArtifactTest, ARowThatContradictsItselfIsRefused) {
  const auto refused = [&](void (*spoil)(evidence::RolloutRow&)) {
    evidence::RolloutRow row = rows[0];
    spoil(row);
    const auto fine = check(row);
    return fine ? "taken" : fine.error();
  };
  EXPECT_EQ(refused([](evidence::RolloutRow&) {}), "taken");
  EXPECT_EQ(refused([](evidence::RolloutRow& row) { row.final_mode = Mode::fault_latched; }),
            "is a success that ended in fault_latched");
  EXPECT_EQ(refused([](evidence::RolloutRow& row) { row.fell = true; }), "is a success that fell");
  EXPECT_EQ(refused([](evidence::RolloutRow& row) { row.age_per_tick.total.p99_ms = 10; }),
            "age_per_tick.total has p50 30, p95 30.1, p99 10 ms, which do not rise");
  EXPECT_EQ(refused([](evidence::RolloutRow& row) { row.age_per_tick.infer.p95_ms.reset(); }),
            "age_per_tick.infer has some of its quantiles");
  EXPECT_EQ(refused([](evidence::RolloutRow& row) {
              row.age_per_command.queue = {.p50_ms = 30, .p95_ms = 31, .p99_ms = 32};
            }),
            "age_per_command.queue.p50 is 30 ms, more than the total's 20");
  EXPECT_EQ(refused([](evidence::RolloutRow& row) { row.misses_per_tick.misses = 500; }),
            "misses_per_tick.rate is 0.003, and 500 of 1000 are 0.5");
  EXPECT_EQ(refused([](evidence::RolloutRow& row) { row.mode_share[0] = 0.9; }), "mode_share adds up to 1.8, not to 1");
  EXPECT_EQ(refused([](evidence::RolloutRow& row) { row.ticks = 1; }), "misses_per_tick.count is 1000 of only 1 ticks");
  EXPECT_EQ(refused([](evidence::RolloutRow& row) { row.mode_share = {0.2, 0, 0, 0, 0.8, 0}; }),
            "ended in tracking, where it spent none of its ticks");
}

// Goal: a short rollout's row is taken. Method: of few commands the p99 lies beyond the largest age, of a part farther
// than of the whole: so it came out of 40 commands; of 1,000 it cannot.
TEST_F(ArtifactTest, APartsQuantileBeyondItsSamplesContradictsNothing) {
  const auto said = [&](std::uint64_t commands, double p99_ms) {
    evidence::RolloutRow row = rows[0];
    row.misses_per_command = {.misses = 0,
                              .count = commands,
                              .rate = 0,
                              .effective_count = static_cast<double>(commands),
                              .upper_bound = 0.1};
    row.age_per_command.total = {.p50_ms = 40, .p95_ms = 80, .p99_ms = 86};
    row.age_per_command.sense = {.p50_ms = 10, .p95_ms = 70, .p99_ms = p99_ms};
    const auto fine = check(row);
    return fine ? "taken" : fine.error();
  };
  EXPECT_EQ(said(40, 92), "taken");
  EXPECT_EQ(said(40, 160), "age_per_command.sense.p99 is 160 ms, more than the total's 86");
  EXPECT_EQ(said(1'000, 92), "age_per_command.sense.p99 is 92 ms, more than the total's 86");
}

TEST_F(ArtifactTest, OneRolloutUnderTwoSeedsIsRefused) {
  std::vector<evidence::RolloutRow> twice = rows;
  twice[1] = rows[0];
  twice[1].seed = 2;
  auto writer = ArtifactWriter::create(folder, manifest, kPanelText);
  ASSERT_TRUE(writer);
  for (const evidence::RolloutRow& row : twice) ASSERT_TRUE(writer->append(row));
  ASSERT_TRUE(writer->finish());
  EXPECT_EQ(refusal(), folder + "/rollouts.jsonl: row 2 has the ticks of row 1 (replay_hash): one rollout is no two");
}

TEST_F(ArtifactTest, AFolderWithFilesOfAnothersKeepsThem) {
  std::filesystem::create_directories(folder);
  const std::string notes = folder + "/rollouts.jsonl";
  std::ofstream(notes) << "mine";
  EXPECT_EQ(ArtifactWriter::create(folder, manifest, kPanelText).error(),
            notes + " is there already, and " + folder + " is no artifact; name a new folder");
  EXPECT_EQ(test::text_of(notes), "mine");
}

TEST_F(ArtifactTest, RefusesToGoOnWithSomethingElse) {
  write_artifact(folder, manifest, {rows[0]});
  EXPECT_EQ(ArtifactWriter::create(folder, manifest, kPanelText).error(),
            folder + " holds an artifact already; go on with it by --resume, or name another");
  ArtifactManifest other = manifest;
  other.panel_sha256 = config::sha256_hex("another");
  EXPECT_EQ(resume_refusal(other), "cannot go on with " + folder + ": the panel differs: " + folder + " has smoke " +
                                       manifest.panel_sha256.substr(0, 12) + ", this panel has smoke " +
                                       other.panel_sha256.substr(0, 12));
  other = manifest;
  other.methods["method-b"].tasks["reach"].config_sha256 = config::sha256_hex("tuned");
  EXPECT_EQ(resume_refusal(other), "cannot go on with " + folder + ": it was begun with other methods");
}

TEST_F(ArtifactTest, AppendRefusesWhatDoesNotFit) {
  auto writer = ArtifactWriter::create(folder, manifest, kPanelText);
  ASSERT_TRUE(writer) << writer.error();
  ASSERT_TRUE(writer->append(rows[0]));
  const auto refused = [&](void (*spoil)(evidence::RolloutRow&)) {
    evidence::RolloutRow row = rows[2];
    spoil(row);
    const auto done = writer->append(row);
    return done ? "appended" : done.error();
  };
  EXPECT_EQ(refused([](evidence::RolloutRow& row) { row = sample_row("method-a", 1); }),
            "row 2 is rollout reach.none@0.method-a.s1, which is there already");
  EXPECT_EQ(refused([](evidence::RolloutRow& row) { row.energy_J = -1; }), "row 2: energy_J is -1, outside 0 or more");
  EXPECT_EQ(refused([](evidence::RolloutRow& row) { row.seed = 21; }),
            "row 2 has seed 21, which is not in the seed plan");
  EXPECT_EQ(refused([](evidence::RolloutRow& row) { row.method = "method-c"; }),
            "row 2 has method method-c, which is not in the manifest");
  EXPECT_EQ(refused([](evidence::RolloutRow& row) { row.plant_sha256 = row.panel_sha256; }),
            "row 2 comes from another plant");
  EXPECT_EQ(refused([](evidence::RolloutRow& row) { row.script_version = "0.0.9"; }),
            "row 2 comes from another script");
  EXPECT_EQ(refused([](evidence::RolloutRow& row) { row.panel_sha256 = row.plant_sha256; }),
            "row 2 comes from another panel");
  EXPECT_EQ(refused([](evidence::RolloutRow& row) { row.config_sha256 = row.plant_sha256; }),
            "row 2 comes from another configuration of its method");
  EXPECT_EQ(refused([](evidence::RolloutRow& row) { row.policy_sha256.clear(); }),
            "row 2 comes from another policy file of its method");
  EXPECT_EQ(writer->rows().size(), 1U);
  EXPECT_EQ(open_artifact(folder)->rows.size(), 1U);
}

TEST_F(ArtifactTest, OpeningRefusesAlteredFiles) {
  write_artifact(folder, manifest, rows);
  const std::string file = folder + "/rollouts.jsonl";
  replace(file, "\"energy_J\":12.5", "\"energy_J\":12.25");
  EXPECT_EQ(refusal(), folder + ": not the rows, contracts and seed plan that " + artifact_id_of(manifest, rows) +
                           " was named after");
  replace(file, "\"energy_J\":12.25", "\"energy_J\":12.5");
  EXPECT_EQ(refusal(), "opened");
  replace(file, "\"seed\":2", "\"seed\":1");
  EXPECT_EQ(refusal(), file + ": row 2 is rollout reach.none@0.method-a.s1, which row 1 is already");
  replace(folder + "/manifest.json", "\"planned_rollouts\": 4", "\"planned\": 4");
  EXPECT_EQ(refusal(), "manifest.json is not an artifact's manifest: manifest.planned_rollouts is missing");
  replace(folder + "/manifest.json", "\"planned\": 4", "\"planned_rollouts\": 4, \"note\": 1");
  EXPECT_EQ(refusal(), "manifest.json is not an artifact's manifest: manifest.note is unknown");
}

TEST_F(ArtifactTest, AContractThatTheRowsWereNotMadeByIsRefused) {
  write_artifact(folder, manifest, rows);
  replace(folder + "/manifest.json", "\"max_age_ms\": 40.0", "\"max_age_ms\": 25.0");
  EXPECT_EQ(refusal(), folder + ": not the rows, contracts and seed plan that " + artifact_id_of(manifest, rows) +
                           " was named after");
}

// Rows taken out, and the id made anew of those that are left.
TEST_F(ArtifactTest, FewerRowsThanPlannedAreRefused) {
  write_artifact(folder, manifest, rows);
  const std::vector<evidence::RolloutRow> left(rows.begin(), rows.end() - 1);
  std::string text = monitor::read_file(folder + "/rollouts.jsonl").value();
  text.erase(text.rfind('\n', text.size() - 2) + 1);
  ASSERT_TRUE(monitor::replace_file(folder + "/rollouts.jsonl", text));
  replace(folder + "/manifest.json", artifact_id_of(manifest, rows), artifact_id_of(manifest, left));
  EXPECT_EQ(refusal(), folder + ": says that it is complete, and holds 3 of 4 planned rollouts");
}

// Goal: a run in the place of an artifact is named as one, with the command that compares runs. Method: the manifest of
// a run folder.
TEST_F(ArtifactTest, ARunIsNamedWithTheCommandThatComparesRuns) {
  std::filesystem::create_directories(folder);
  ASSERT_TRUE(monitor::replace_file(ArtifactFolder(folder).manifest(), R"({"schema": "takt.run/1", "robot": "arm6"})"));
  EXPECT_EQ(refusal(), folder + " is a run, not the artifact of a panel; compare two runs by takt report " + folder +
                           " --against RUN");
}

TEST(ArtifactManifest, NamesTheFirstDifference) {
  const ArtifactManifest a = sample_manifest({"m"}, 1);
  const auto difference = [&](void (*change)(ArtifactManifest&)) {
    ArtifactManifest b = a;
    change(b);
    return difference_between(a, b);
  };
  const auto digits = [](const std::string& text) { return config::sha256_hex(text).substr(0, 12); };
  EXPECT_EQ(difference([](ArtifactManifest&) {}), "");
  EXPECT_EQ(difference([](ArtifactManifest& b) { b.seed_plan.seeds.pop_back(); }),
            "the seed plan differs: A has 20 seeds, \"seeds 1 to 20, the same for every method\", B has 19 seeds, "
            "\"seeds 1 to 20, the same for every method\"");
  EXPECT_EQ(difference([](ArtifactManifest& b) { b.timing = Timing::real; }),
            "the timing differs: A has virtual, B has real");
  EXPECT_EQ(difference([](ArtifactManifest& b) { b.script_version = "0.2.0"; }),
            "the script differs: A has takt 0.1.0 " + digits("sources") + ", B has takt 0.2.0 " + digits("sources"));
  EXPECT_EQ(difference([](ArtifactManifest& b) { b.plants["reach"] = config::sha256_hex("moon"); }),
            "the plant of task reach differs: A has " + digits("plant") + ", B has " + digits("moon"));
  EXPECT_EQ(difference([](ArtifactManifest& b) { b.plants["walk"] = "x"; }), "the plant of task walk is only in B");
  EXPECT_EQ(difference([](ArtifactManifest& b) { b.schema_sha256 = "0123456789abcdef"; }),
            "the row schema differs: A has not known, B has 0123456789ab");
}

}  // namespace
}  // namespace takt::lab

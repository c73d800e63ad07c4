// SPDX-License-Identifier: Apache-2.0
// Goal: what the balancer's file offers as safe is what the committed panel shows, and what does not keep it on its
// feet is refused as evidence. Method: the panel anew, in virtual time; a person's stop that holds the wheels. Replay
// hashes are not compared: they change with every record of every tick, and the committed files name the sources that
// they belong to.
//
// TAKT_WRITE_ATTESTATIONS=1 writes config/shown/balancer.*.json anew.
#include <gtest/gtest.h>

#include <algorithm>
#include <cstdlib>
#include <filesystem>

#include "config/load.hpp"
#include "evidence/attestation/attestation.hpp"
#include "lab/judge/attest.hpp"
#include "lab/panel/attested_again.hpp"
#include "lab/panel/panel_plan.hpp"
#include "lab/panel/worker_pool.hpp"
#include "monitor/record/bounded_file.hpp"
#include "tests/support/temporary_folder.hpp"

namespace takt::lab {
namespace {

constexpr const char* kPanel = "config/panels/stops.yaml";

class StopsPanel : public test::TemporaryFolder {
 protected:
  // Of one method; `kind` empty: under every perturbation.
  Artifact run(const std::string& method, const std::string& kind = {}, std::uint64_t seeds = 0,
               const std::string& robot_file = {}) {
    Panel panel = load_panel(kPanel).value();
    std::erase_if(panel.methods, [&](const PanelMethod& one) { return one.name != method; });
    if (!kind.empty()) std::erase_if(panel.perturbations, [&](const auto& one) { return one.kind != kind; });
    if (seeds != 0) panel.seed_count = seeds;
    panel.robot = robot_file;
    panel_text_ = panel.text;
    fall_ = {panel.tasks[0].base_velocity.least_height, panel.tasks[0].base_velocity.most_tilt};
    auto contest = Contest::prepare(std::move(panel)).value();
    robot_ = contest.contestant({}).robot;
    const auto plan = plan_of(contest.panel(), {});
    auto writer =
        ArtifactWriter::create(path("artifact." + method), contest.manifest(plan.size()), contest.panel().text).value();
    const auto done = run_in_workers(contest, plan, 2, [&](const RanRollout& ran) { return writer.append(ran.row); });
    EXPECT_TRUE(done) << done.error();
    EXPECT_TRUE(writer.finish());
    return open_artifact(path("artifact." + method)).value();
  }
  config::RobotConfig robot_;
  std::string panel_text_;
  evidence::FallRule fall_;
};

// Outcomes, not hashes.
std::string outcomes_of(const evidence::Attestation& attestation) {
  evidence::Attestation bare = attestation;
  bare.artifact_id = bare.script_source_sha256 = "";
  for (evidence::AttestedCondition& condition : bare.conditions)
    for (evidence::AttestedTrial& trial : condition.trials)
      trial.replay_hash = trial.row_sha256 = "", trial.seconds = std::round(trial.seconds);
  return evidence::attestation_text(bare);
}

TEST_F(StopsPanel, ShowsWhatTheBalancersFileOffers) {
  const Artifact artifact = run("file");
  for (const auto& [of, name] :
       {std::pair{"fallbacks.stand", "stand"}, std::pair{"stops.operator_stop", "operator_stop"},
        std::pair{"stops.bad_commands", "bad_commands"}, std::pair{"stops.overrun", "overrun"}}) {
    const auto made = attest(artifact, panel_text_, robot_, of, "file", fall_);
    ASSERT_TRUE(made) << made.error();
    EXPECT_EQ(evidence::shortcoming(*made, robot_, of), "");
    const std::string file = std::string("config/shown/balancer.") + name + ".json";
    if (std::getenv("TAKT_WRITE_ATTESTATIONS") != nullptr) {
      ASSERT_TRUE(monitor::replace_file(file, evidence::attestation_text(*made)));
    }
    const auto committed = evidence::attestation_of(monitor::read_file(file).value());
    ASSERT_TRUE(committed) << file << " " << committed.error();
    EXPECT_EQ(outcomes_of(*committed), outcomes_of(*made)) << file;
  }
  const evidence::Standing standing = evidence::standing_of(config::load("config/balancer.yaml").value());
  EXPECT_EQ(standing.shown.size(), 4U);
  EXPECT_TRUE(standing.not_shown.empty()) << standing.not_shown.front();
}

TEST_F(StopsPanel, HoldingTheWheelsIsRefusedAsEvidence) {
  const Artifact artifact = run("held", "operator_stop", 30);
  const auto made = attest(artifact, panel_text_, robot_, "stops.operator_stop", "held", fall_);
  ASSERT_TRUE(made) << made.error();
  EXPECT_EQ(evidence::shortcoming(*made, robot_, "stops.operator_stop"),
            "0 of 30 stood under operator_stop 1: at least 0.00 at 95 % confidence; 0.9 is asked");
  EXPECT_NE(evidence::shortcoming(*made, config::load("config/balancer.yaml").value(), "stops.operator_stop")
                .find("has changed"),
            std::string::npos)
      << "and it is not what the file says";
}

// Goal: an attestation that no panel gave is found, and so is one that leaves out a fall. Method: of a method of
// which no rollout stands, one that says that all do; of one that stands, a trial less; both computed anew.
TEST_F(StopsPanel, AnInventedAttestationIsFound) {
  const auto again = [&](const evidence::Attestation& said) {
    Panel panel = attested_panel(said).value();
    std::erase_if(panel.perturbations, [](const auto& one) { return one.kind != "operator_stop"; });
    panel.robot = "config/balancer.yaml";
    auto contest = Contest::prepare(std::move(panel)).value();
    auto plan = plan_of(contest.panel(), {});
    plan.resize(2);
    return recompute(said, contest, plan, 2);
  };
  evidence::Attestation invented =
      attest(run("held", "operator_stop", 30), panel_text_, robot_, "stops.operator_stop", "held", fall_).value();
  for (evidence::AttestedTrial& trial : invented.conditions.at(0).trials) trial.stood = true, trial.seconds = 7;
  ASSERT_EQ(evidence::shortcoming(invented, robot_, "stops.operator_stop"), "") << "it is believed";
  EXPECT_EQ(again(invented)->differences,
            (std::vector<std::string>{"operator_stop@1 with seed 1 did not stand, as it is said to",
                                      "operator_stop@1 with seed 2 did not stand, as it is said to"}));
  evidence::Attestation honest =
      attest(run("file", "operator_stop", 30), panel_text_, robot_, "stops.operator_stop", "file", fall_).value();
  EXPECT_EQ(again(honest)->differences, std::vector<std::string>());
  honest.conditions.at(0).trials.at(0).row_sha256 = "00";
  honest.conditions.at(0).trials.at(1).replay_hash = "00";
  EXPECT_EQ(again(honest)->differences,
            (std::vector<std::string>{"operator_stop@1 with seed 1 has another row than is said (row_sha256)",
                                      "operator_stop@1 with seed 2 has other ticks than are said (replay_hash)"}));
  auto& trials = honest.conditions.at(0).trials;
  trials.push_back(trials.back());
  trials.back().seed = 31;
  trials.erase(trials.begin());
  EXPECT_EQ(again(honest)->differences.at(0), "operator_stop@1 with seed 1 is a trial that the attestation leaves out");
  honest.method = "another";
  EXPECT_EQ(attested_panel(honest).error(), "its panel has no method another in a task base_velocity");
}

// Goal: rows of two models are never compared. Method: one robot file, its MJCF changed between two panels.
TEST_F(StopsPanel, AChangedModelIsAnotherPlant) {
  for (const char* file : {"balancer.yaml", "balancer.xml", "balancer.onnx"})
    std::filesystem::copy_file(std::string("config/") + file, path(file));
  const auto plant = [&] {
    Panel panel = load_panel(kPanel).value();
    panel.robot = path("balancer.yaml");
    return Contest::prepare(std::move(panel)).value().contestant({}).plant_sha256;
  };
  const std::string before = plant();
  EXPECT_EQ(plant(), before);
  std::string model = monitor::read_file(path("balancer.xml")).value();
  model.replace(model.find("mass=\""), 6, "mass=\"1");
  ASSERT_TRUE(monitor::replace_file(path("balancer.xml"), model));
  EXPECT_NE(plant(), before);
}

}  // namespace
}  // namespace takt::lab

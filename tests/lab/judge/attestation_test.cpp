// SPDX-License-Identifier: Apache-2.0
// Goal: what a robot file offers as safe counts as shown only by an attestation that is whole, of this robot as it is
// today, of this stop, and whose trials are many and good enough. Method: one that is, then one thing at a time made
// otherwise; the line that is told is read.
#include "evidence/attestation/attestation.hpp"

#include <gtest/gtest.h>

#include <algorithm>
#include <functional>
#include <nlohmann/json.hpp>

#include "config/load.hpp"
#include "executive/contract/version.hpp"
#include "lab/judge/attest.hpp"
#include "monitor/record/bounded_file.hpp"
#include "tests/lab/artifact/sample_artifact.hpp"
#include "tests/lab/artifact/sample_rows.hpp"
#include "tests/support/temporary_folder.hpp"

namespace takt::lab {
namespace {

constexpr const char* kOf = "stops.operator_stop";

class AttestationTest : public test::TemporaryFolder {
 protected:
  const config::RobotConfig robot = config::load("config/balancer.yaml").value();
  evidence::Attestation whole;

  AttestationTest() {
    whole = {.of = kOf,
             .robot = robot.robot,
             .parts_sha256 = evidence::moving_parts_sha256(robot).value(),
             .artifact_id = "stops-3f9a2c41d07b",
             .panel = "stops",
             .panel_text = "panel",
             .task = "base_velocity",
             .method = "file",
             .timing = "virtual",
             .script_version = std::string(release()),
             .script_source_sha256 = std::string(source_sha256()),
             .fall = {.least_height = 0.6, .most_tilt = 1},
             .conditions = {{"operator_stop", 1, {}}, {"push", 20, {}}}};
    for (evidence::AttestedCondition& condition : whole.conditions)
      for (std::uint64_t seed = 1; seed <= 30; ++seed) condition.trials.push_back({seed, "00ff17", "a5", 6.5, true});
  }
  // The file that the robot's stop names holds `text`; what is said of that stop, and whether it is said to be shown.
  std::pair<bool, std::string> told_of(const std::string& text) {
    EXPECT_TRUE(monitor::replace_file(path("shown.json"), text));
    config::RobotConfig asked = robot;
    std::erase_if(asked.stops, [](const config::StopConfig& stop) { return stop.name != "operator_stop"; });
    asked.stops[0].shown_by = path("shown.json");
    asked.degraded.behaviour = config::Degraded::slow;  // no fallback is offered
    const evidence::Standing standing = evidence::standing_of(asked);
    EXPECT_EQ(standing.shown.size() + standing.not_shown.size(), 1U);
    const bool shown = !standing.shown.empty();
    return {shown, shown ? standing.shown[0] : standing.not_shown[0]};
  }
};

TEST_F(AttestationTest, OneThatIsWholeIsBelievedAndReadBack) {
  const std::string text = evidence::attestation_text(whole);
  const auto again = evidence::attestation_of(text);
  ASSERT_TRUE(again) << again.error();
  EXPECT_EQ(evidence::attestation_text(*again), text);
  const auto [shown, line] = told_of(text);
  EXPECT_TRUE(shown);
  EXPECT_EQ(line,
            "stops.operator_stop: 30 of 30 stood under operator_stop 1, 30 of 30 stood under push 20: at least "
            "0.90 at 95 % confidence (" +
                path("shown.json") + ")");
}

// Still shown: what moves the robot is as it was. Its line says that other sources computed it.
TEST_F(AttestationTest, OneOfOtherSourcesIsNamedAsSuch) {
  whole.script_source_sha256 = config::sha256_hex("sources");
  const auto [shown, line] = told_of(evidence::attestation_text(whole));
  EXPECT_TRUE(shown);
  const std::string its = whole.script_source_sha256.substr(0, 12), own(source_sha256().substr(0, 12));
  EXPECT_TRUE(line.ends_with("; takt of other sources (" + its + ") computed it, this one is of " + own +
                             ": run panel stops again"))
      << line;
  whole.script_source_sha256 = "";
  EXPECT_NE(told_of(evidence::attestation_text(whole)).second.find("takt of unknown sources"), std::string::npos);
}

TEST_F(AttestationTest, NoneOrOneThatIsGoneShowsNothing) {
  config::RobotConfig asked = robot;
  for (config::StopConfig& stop : asked.stops) stop.shown_by = "none";
  asked.fallbacks[0].shown_by = path("gone.json");
  const evidence::Standing standing = evidence::standing_of(asked);
  EXPECT_TRUE(standing.shown.empty());
  ASSERT_EQ(standing.not_shown.size(), 4U);
  EXPECT_EQ(standing.not_shown[0], "fallbacks.stand: a fallback policy, and the base is free: not shown by " +
                                       path("gone.json") + ": it cannot be read");
  EXPECT_EQ(
      standing.not_shown[1],
      "stops.operator_stop: the fallback policy, and the base is free: nothing shows that this robot stays on its "
      "feet by it; run a panel and name what `takt panel attest` makes of it in shown_by");
  asked.imu.reset();
  EXPECT_TRUE(evidence::standing_of(asked).not_shown.empty()) << "an arm on its table does not fall";
}

// A forger who turns a fall into a stand, or a seed into two, has to make the hash anew; and then the bound is counted.
TEST_F(AttestationTest, EveryChangedByteIsNoticed) {
  const std::string text = evidence::attestation_text(whole);
  for (const std::string_view part : {"\"stood\":true", "00ff17", "6.5", "operator_stop\"", "balancer", "30 of 30",
                                      "\"fell_below\"", "stops-3f9a", "\"dose\": 20"}) {
    std::string changed = text;
    const std::size_t at = changed.find(part);
    ASSERT_NE(at, std::string::npos) << part;
    changed[at + part.size() - 1] = changed[at + part.size() - 1] == '7' ? '8' : '7';
    EXPECT_FALSE(evidence::attestation_of(changed)) << part;
    EXPECT_FALSE(told_of(changed).first) << part;
  }
  EXPECT_FALSE(evidence::attestation_of(text.substr(0, text.size() / 2)));
  EXPECT_FALSE(evidence::attestation_of("{}"));
}

struct Doubt {
  const char* why;
  std::function<void(evidence::Attestation&)> make;
  const char* told;
};

TEST_F(AttestationTest, EachDoubtIsTold) {
  const Doubt doubts[] = {
      {"too many fell", [](evidence::Attestation& a) { a.conditions[1].trials[7].stood = false; },
       "30 of 30 stood under operator_stop 1, 29 of 30 stood under push 20: at least 0.85 at 95 % confidence; 0.9 is "
       "asked"},
      {"too few were tried", [](evidence::Attestation& a) { a.conditions[0].trials.resize(20); },
       "at least 0.86 at 95 %"},
      {"none was tried", [](evidence::Attestation& a) { a.conditions.clear(); }, "at least 0.00 at 95 %"},
      {"watched too shortly", [](evidence::Attestation& a) { a.conditions[0].trials[3].seconds = 1.5; },
       "under operator_stop 1 it was watched for 1.5 s, and 5 s are asked"},
      {"a trial twice", [](evidence::Attestation& a) { a.conditions[0].trials[3].seed = 3; }, "a trial is in it twice"},
      {"of another stop", [](evidence::Attestation& a) { a.of = "stops.overrun"; }, "it is of stops.overrun"},
      {"of another robot", [](evidence::Attestation& a) { a.robot = "g1", a.parts_sha256[0] = 'x'; },
       "it is of robot g1"},
      {"of this robot before a change", [](evidence::Attestation& a) { a.parts_sha256[0] = 'x'; },
       "this robot has changed since (file, policy or model); run panel stops again"},
      {"of another version", [](evidence::Attestation& a) { a.script_version = "0.0.1"; },
       "takt 0.0.1 computed it, and this is"},
      {"a panel that calls nothing a fall", [](evidence::Attestation& a) { a.fall.most_tilt = 3.2; },
       "its panel called a robot fallen below 0.6 of its height or beyond 3.2 rad only"},
  };
  for (const Doubt& doubt : doubts) {
    evidence::Attestation made = whole;
    doubt.make(made);
    const auto [shown, line] = told_of(evidence::attestation_text(made));
    EXPECT_FALSE(shown) << doubt.why;
    EXPECT_NE(line.find(doubt.told), std::string::npos) << doubt.why << ": " << line;
  }
}

// What moves the robot counts, wherever its files lie; what only records or tells does not.
TEST_F(AttestationTest, PartsThatMoveTheRobotAreItsIdentity) {
  const std::string parts = evidence::moving_parts_sha256(robot).value();
  const auto with = [&](const std::string& key, const std::string& value) {
    const std::vector<config::Override> overrides{{key, value}};
    const auto changed = config::with_overrides(robot, overrides);
    EXPECT_TRUE(changed) << changed.error();
    return evidence::moving_parts_sha256(*changed).value();
  };
  for (const auto& [key, value] :
       {std::pair{"stops.operator_stop.for", "3 s"}, std::pair{"stops.operator_stop.how", "hold"},
        std::pair{"freshness.max_age", "70 ms"}, std::pair{"imu.tilt", "0.9 rad"}})
    EXPECT_NE(with(key, value), parts) << key;
  for (const auto& [key, value] :
       {std::pair{"stops.operator_stop.shown_by", "none"}, std::pair{"record.directory", "/tmp"}})
    EXPECT_EQ(with(key, value), parts) << key;
  for (const char* file : {"balancer.onnx", "balancer.xml"}) {
    const std::string text = monitor::read_file(std::string("config/") + file).value();
    ASSERT_TRUE(monitor::replace_file(path(file), text));
  }
  config::RobotConfig elsewhere = robot;
  elsewhere.policy->file = path("balancer.onnx");
  elsewhere.simulation->mujoco->model = path("balancer.xml");
  EXPECT_EQ(evidence::moving_parts_sha256(elsewhere), parts);
  ASSERT_TRUE(monitor::replace_file(path("balancer.xml"), monitor::read_file(path("balancer.xml")).value() + " "));
  EXPECT_NE(evidence::moving_parts_sha256(elsewhere), parts) << "another model";
}

// Which rollouts are trials, and which of them stood.
class Attesting : public AttestationTest {
 protected:
  std::vector<evidence::RolloutRow> rows;
  ArtifactManifest manifest = sample_manifest({"file"}, 2);
  void add(std::uint64_t seed, const std::function<void(evidence::RolloutRow&)>& make) {
    evidence::RolloutRow row = failed_row("file", seed);
    row.task = "base_velocity";
    row.perturbation = "operator_stop";
    row.dose = 1;
    row.config_sha256 = robot.sha256;
    row.final_cause = Cause::operator_stop;
    row.fell = false;
    row.safety = {0, 1, 0, 0};
    row.ticks = 6000;  // of 2 ms
    row.mode_share = {0, 0, 0.5, 0, 0.5, 0};
    make(row);
    rows.push_back(row);
  }
  [[nodiscard]] std::expected<evidence::Attestation, std::string> made(const std::string& of = kOf) const {
    ArtifactManifest finished = manifest;
    finished.complete = true;
    finished.artifact_id = "stops-0";
    return attest({ArtifactFolder(path("artifact")), finished, rows}, "panel", robot, of, "file", {0.6, 1});
  }
};

TEST_F(Attesting, ARobotThatFellOrLatchedOtherwiseDidNotStand) {
  add(1, [](evidence::RolloutRow&) {});
  add(2, [](evidence::RolloutRow& row) { row.fell = true; });
  add(3,
      [](evidence::RolloutRow& row) { row.final_mode = Mode::fault_latched, row.final_cause = Cause::feedback_lost; });
  add(4, [](evidence::RolloutRow& row) { row.final_cause = Cause::tilt; });
  add(5, [](evidence::RolloutRow& row) {
    row.fell = true, row.safety = {0, 0, 0, 0}, row.final_mode = Mode::tracking;
  });
  add(6, [](evidence::RolloutRow& row) {
    row.safety = {0, 0, 0, 0}, row.final_mode = Mode::tracking;
  });                                                                                  // it never stopped
  add(7, [](evidence::RolloutRow& row) { row.mode_share = {0, 0, 0.9, 0, 0.1, 0}; });  // for 1.2 s only
  const auto attestation = made();
  ASSERT_TRUE(attestation) << attestation.error();
  ASSERT_EQ(attestation->conditions.size(), 1U);
  std::vector<std::pair<std::uint64_t, bool>> trials;
  for (const evidence::AttestedTrial& trial : attestation->conditions[0].trials)
    trials.emplace_back(trial.seed, trial.stood);
  const std::vector<std::pair<std::uint64_t, bool>> wanted{{1, true}, {2, false}, {3, false}, {4, false}, {5, false}};
  EXPECT_EQ(trials, wanted);
  EXPECT_DOUBLE_EQ(attestation->conditions[0].trials[0].seconds, 6);
}

TEST_F(Attesting, OfAFallbackTheTimeDegradedCounts) {
  add(1, [](evidence::RolloutRow& row) { row.mode_share = {0, 0, 0.5, 0.5, 0, 0}; });
  add(2, [](evidence::RolloutRow& row) { row.mode_share = {0, 0, 0.5, 0.5, 0, 0}, row.fell = true; });
  add(3, [](evidence::RolloutRow& row) { row.mode_share = {0, 0, 0.99, 0.01, 0, 0}; });
  // Ended by a fault that took the drives' power, before it could fall.
  add(4,
      [](evidence::RolloutRow& row) { row.mode_share = {0, 0, 0.5, 0.5, 0, 0}, row.safety.entered_fault_latched = 1; });
  const auto attestation = made("fallbacks.stand");
  ASSERT_TRUE(attestation) << attestation.error();
  ASSERT_EQ(attestation->conditions[0].trials.size(), 3U);
  EXPECT_EQ(attestation->conditions[0].stood(), 1U);
}

TEST_F(Attesting, RefusesRowsThatShowNothingOfIt) {
  add(1, [](evidence::RolloutRow& row) { row.final_cause = Cause::command_lost; });
  EXPECT_NE(made().error().find("no rollout of method `file` came to stops.operator_stop"), std::string::npos);
  EXPECT_NE(made("stops.tilt").error().find("`stops.tilt` is nothing that this robot is to stay on its feet by"),
            std::string::npos);
  rows[0].config_sha256[0] = 'x';
  EXPECT_NE(made().error().find("are of another robot file"), std::string::npos);
  rows[0].task = "arm_tracking";
  EXPECT_NE(made().error().find("tells whether a robot fell"), std::string::npos);
}

}  // namespace
}  // namespace takt::lab

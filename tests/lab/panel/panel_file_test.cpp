// SPDX-License-Identifier: Apache-2.0
// Goal: a panel file means what it says, or is refused with the place and the remedy; a method's overrides reach the
// robot. Method: a small panel, broken in one place at a time; the committed panels.
#include "lab/panel/panel_file.hpp"

#include <gtest/gtest.h>

#include <filesystem>
#include <fstream>

#include "lab/panel/panel_plan.hpp"
#include "tests/support/temporary_folder.hpp"

namespace takt::lab {
namespace {

const std::string kRobot = std::filesystem::absolute("config/arm6.yaml").string();

std::string small_panel() {
  return "schema: takt.panel/1\n"
         "panel: small\n"
         "duration: 4 s\n"
         "seeds: { first: 7, count: 2 }\n"
         "tasks:\n"
         "  - { task: arm_tracking, robot: " +
         kRobot +
         ", scored: 1 s, bound: 20 mm }\n"
         "methods:\n"
         "  - { name: takt }\n"
         "  - { name: lax, override: [{ key: freshness.max_age, value: 200 ms }] }\n"
         "perturbations:\n"
         "  - { kind: none }\n"
         "  - { kind: push, dose: 12.5, from: 1 s, for: 1 s }\n";
}

class PanelFile : public test::TemporaryFolder {
 protected:
  [[nodiscard]] std::string written(const std::string& text) const {
    std::ofstream(path("panel.yaml")) << text;
    return path("panel.yaml");
  }
};

std::string with(const std::string& from, const std::string& to) {
  std::string text = small_panel();
  const std::size_t at = text.find(from);
  EXPECT_NE(at, std::string::npos) << from;
  return text.replace(at, from.size(), to);
}

TEST_F(PanelFile, SaysWhatIsRun) {
  const auto panel = load_panel(written(small_panel()));
  ASSERT_TRUE(panel.has_value()) << panel.error();
  EXPECT_EQ(panel->tasks[0].bound_m, 0.02);
  EXPECT_EQ(panel->perturbations[1].dose, 12.5);
  const auto plan = plan_of(*panel, {});
  ASSERT_EQ(plan.size(), 8U);
  EXPECT_EQ(plan[0].seed, 7U);
  EXPECT_EQ(plan[7].seed, 8U);
  const auto first = plan_of(*panel, {1, 3}), second = plan_of(*panel, {2, 3}), third = plan_of(*panel, {3, 3});
  EXPECT_EQ(first.size() + second.size() + third.size(), plan.size());
  const auto contest = Contest::prepare(*panel);
  ASSERT_TRUE(contest.has_value()) << contest.error();
  EXPECT_EQ(contest->manifest(8).methods.at("lax").tasks.at("arm_tracking").max_age_ms, 200);
  EXPECT_EQ(contest->manifest(8).methods.at("takt").tasks.at("arm_tracking").max_age_ms, 150);
}

// Goal: built-in methods are named, and the artifact says how they judge age. Method: the small panel with all of them.
TEST_F(PanelFile, KnowsBuiltInMethodsByTheirNames) {
  const auto panel =
      load_panel(written(with("name: takt }",
                              "name: takt }\n  - { name: plain, description: mine }\n  - { name: timeout }\n"
                              "  - { name: timeout_1s }\n  - { name: hold_last }")));
  ASSERT_TRUE(panel.has_value()) << panel.error();
  EXPECT_EQ(panel->methods[1].method.built_in, evidence::BuiltIn::plain);
  EXPECT_EQ(panel->methods[1].description, "mine");
  EXPECT_EQ(panel->methods[2].description, evidence::find_built_in("timeout")->description);
  EXPECT_EQ(panel->methods[5].method.built_in, evidence::BuiltIn::takt) << "lax";
  const auto contest = Contest::prepare(*panel);
  ASSERT_TRUE(contest.has_value()) << contest.error();
  const auto methods = contest->manifest(1).methods;
  EXPECT_EQ(methods.at("plain").tasks.at("arm_tracking").max_age_ms, 150);
  EXPECT_EQ(methods.at("timeout_1s").tasks.at("arm_tracking").max_age_ms, 1000);
}

// Both tasks, one perturbation for each alone.
std::string two_task_panel() {
  std::string text = small_panel();
  text.replace(text.find("methods:"), 0,
               "  - { task: cart_pole_balance, robot: " + std::filesystem::absolute("config/cart_pole.yaml").string() +
                   ", scored: 1 s, bound: 400 mm }\n");
  text.replace(text.find("dose: 12.5,"), 0, "tasks: [arm_tracking], ");
  return text + "  - { kind: push, dose: 0.5, from: 1 s, for: 1 s, tasks: [cart_pole_balance] }\n";
}

TEST_F(PanelFile, TasksHaveTheirOwnPerturbationsAndConfigurations) {
  const auto panel = load_panel(written(two_task_panel()));
  ASSERT_TRUE(panel.has_value()) << panel.error();
  const auto plan = plan_of(*panel, {});
  EXPECT_EQ(plan.size(), 16U) << "2 tasks x 2 perturbations x 2 methods x 2 seeds";
  for (const PlannedRollout& one : plan)
    EXPECT_TRUE(panel->perturbations[one.perturbation].troubles(panel->tasks[one.task].task));
  const auto contest = Contest::prepare(*panel);
  ASSERT_TRUE(contest.has_value()) << contest.error();
  const ArtifactManifest manifest = contest->manifest(plan.size());
  EXPECT_EQ(manifest.plants.size(), 2U);
  const auto& lax = manifest.methods.at("lax").tasks;
  EXPECT_EQ(lax.at("arm_tracking").max_age_ms, 200);
  EXPECT_EQ(lax.at("cart_pole_balance").max_age_ms, 200);
  EXPECT_NE(lax.at("arm_tracking").config_sha256, lax.at("cart_pole_balance").config_sha256);
  const auto& takt = manifest.methods.at("takt").tasks;
  EXPECT_EQ(takt.at("cart_pole_balance").max_age_ms, 120);
  EXPECT_NE(takt.at("arm_tracking").policy_sha256, takt.at("cart_pole_balance").policy_sha256);
  evidence::RolloutRow row = contest->identity(plan.back());
  EXPECT_EQ(misfit(row, manifest), "");
  row.config_sha256 = lax.at("arm_tracking").config_sha256;
  EXPECT_EQ(misfit(row, manifest), "comes from another configuration of its method");
  const auto again = artifact_manifest_of(to_json(manifest));
  ASSERT_TRUE(again.has_value()) << again.error();
  EXPECT_EQ(again->methods, manifest.methods);
}

struct Refusal {
  const char *when, *from, *to, *complaint;
};
const Refusal kRefusals[] = {
    {"unknown key", "panel: small\n", "panel: small\ncolour: red\n", "3:1: unknown key `colour`"},
    {"unknown perturbation", "kind: push", "kind: pusch",
     "12:13: perturbations[1].kind: perturbation `pusch` is not known; did you mean `push`?"},
    {"dose out of range", "dose: 12.5", "dose: -1", "12:25: perturbations[1].dose: -1 is out of range"},
    {"a perturbation of a task that is not there", "dose: 12.5", "tasks: [cart_pole_balance], dose: 12.5",
     "perturbations[1].tasks: names a task that this panel does not have"},
    {"a task nobody knows", "dose: 12.5", "tasks: [arm_tracing], dose: 12.5", "did you mean `arm_tracking`?"},
    {"window past the end", "from: 1 s", "from: 3500 ms", "its window ends after the rollout's `duration`"},
    {"the same twice in one rollout", "for: 1 s }", "for: 1 s, with: [{ kind: push, dose: 3 }] }",
     "perturbations[1].with[0].kind: acts twice in one rollout; keep one of them"},
    {"something besides nothing", "kind: none }", "kind: none, with: [{ kind: push }] }",
     "perturbations[0].with: `none` is the nominal rollout"},
    {"nothing besides something", "for: 1 s }", "for: 1 s, with: [{ kind: none }] }",
     "perturbations[1].with[0].kind: `none` troubles nothing; leave it out"},
    {"besides, past the end", "for: 1 s }", "for: 1 s, with: [{ kind: can_loss, from: 3 s }] }",
     "perturbations[1].with[0].kind: its window ends after the rollout's `duration`"},
    {"one of several tasks, besides", "for: 1 s }", "for: 1 s, with: [{ kind: can_loss, tasks: [arm_tracking] }] }",
     "unknown key `tasks`"},
    {"bound without unit", "bound: 20 mm", "bound: 20", "6:"},
    {"twice the same", "kind: none }", "kind: push, dose: 12.5, from: 1 s, for: 1 s }", "is in the list twice"},
    {"scored too long", "scored: 1 s", "scored: 9 s", "is longer than the rollout's `duration`"},
    {"a built-in method with keys of its own", "name: lax", "name: plain",
     "9:13: methods[1].name: is a built-in method's name, which takes no `override` and no `link`"},
    {"a built-in method with a slip", "{ name: takt }", "{ name: plan }",
     "methods[0].name: `plan` is no built-in method and overrides nothing; did you mean `plain`?"},
    {"a built-in method with a link", "{ name: takt }", "{ name: timeout, link: repeat_last }",
     "methods[0].name: is a built-in method's name"},
    {"a plant of its own", "key: freshness.max_age, value: 200 ms", "key: simulation.step, value: 100 us",
     "methods[1].override[0].key: `simulation.step` would give this method a world of its own; override it in the "
     "task"},
    {"a model of its own", "key: freshness.max_age, value: 200 ms", "key: model, value: none",
     "methods[1].override[0].key: `model` would give this method"},
    {"a pace of its own", "key: freshness.max_age, value: 200 ms", "key: control.period, value: 2 ms",
     "methods[1].override[0].key: `control.period` would give"},
    {"capital letters", "name: lax", "name: Lax", "has capital letters"},
};

TEST_F(PanelFile, RefusesWhatIsWrongWithItsPlace) {
  for (const Refusal& refusal : kRefusals) {
    const auto panel = load_panel(written(with(refusal.from, refusal.to)));
    ASSERT_FALSE(panel.has_value()) << refusal.when;
    EXPECT_NE(panel.error().find(refusal.complaint), std::string::npos) << refusal.when << ": " << panel.error();
  }
}

TEST_F(PanelFile, RefusesOverridesThatTheRobotFileDoesNotKnowOrAllow) {
  const auto complaint = [&](const std::string& from, const std::string& to) {
    const auto panel = load_panel(written(with(from, to)));
    const auto contest = Contest::prepare(*panel);
    return contest ? std::string("none") : contest.error();
  };
  EXPECT_NE(complaint("freshness.max_age", "freshness.max_ago").find("method lax: "), std::string::npos);
  EXPECT_NE(complaint("freshness.max_age", "freshness.max_ago").find("`freshness.max_ago` is no key"),
            std::string::npos);
  EXPECT_NE(complaint("value: 200 ms", "value: 900 ms").find("900 ms"), std::string::npos);  // beyond stop_after
}

TEST_F(PanelFile, CommittedPanelsAreGood) {
  for (const auto& entry : std::filesystem::directory_iterator("config/panels")) {
    auto panel = load_panel(entry.path().string());
    ASSERT_TRUE(panel.has_value()) << panel.error();
    EXPECT_EQ(panel->name, entry.path().stem().string());
    if (panel->name == "walkers") continue;  // names no robot of ours: below
    const auto contest = Contest::prepare(std::move(*panel));
    EXPECT_TRUE(contest.has_value()) << contest.error();
  }
}

// Goal: a robot that walks is asked for what the file says, and the panel for walkers fits one. Method: its keys, and a
// refusal; the committed panel's overrides on a robot file of the tests.
// Goal: what acts besides a perturbation has the panel's window or its own, and rows name it. Method: the small panel
// with a push beside lost frames and a stall.
TEST_F(PanelFile, WhatActsBesidesIsNamed) {
  const auto panel = load_panel(written(
      with("for: 1 s }", "for: 1 s, with: [{ kind: can_loss }, { kind: inference_stall, dose: 50, from: 0 s }] }")));
  ASSERT_TRUE(panel.has_value()) << panel.error();
  const PanelPerturbation& push = panel->perturbations[1];
  EXPECT_EQ(push.name(), "push-with-can_loss-0.1-with-inference_stall-50");
  EXPECT_TRUE(push.has("can_loss"));
  EXPECT_FALSE(push.has("can_delay"));
  const evidence::Perturbation all = push.resolved();
  ASSERT_EQ(all.with.size(), 2U);
  EXPECT_EQ(all.from, seconds(1));
  EXPECT_EQ(all.with[0].from, seconds(2)) << "the panel's window";
  EXPECT_EQ(all.with[1].trouble, evidence::Trouble::inference_stall);
  EXPECT_EQ(all.with[1].from, Duration{});
  const auto contest = Contest::prepare(*panel);
  ASSERT_TRUE(contest.has_value()) << contest.error();
  const evidence::RolloutRow row = contest->identity({.task = 0, .perturbation = 1, .method = 0, .seed = 7});
  EXPECT_EQ(evidence::rollout_id(row), "arm_tracking.push-with-can_loss-0.1-with-inference_stall-50@12.5.takt.s7");
}

TEST_F(PanelFile, AsksARobotThatWalksForAVelocity) {
  const auto panel = load_panel("config/panels/walkers.yaml");
  ASSERT_TRUE(panel) << panel.error();
  const evidence::BaseVelocityTask& asked = panel->tasks[0].base_velocity;
  EXPECT_EQ(asked.command, (std::array<double, 3>{0.5, 0, 0}));
  EXPECT_EQ(asked.until, seconds(8));
  EXPECT_EQ(asked.least_height, 0.6);
  for (const char* file : {"tests/evidence/rollout/rover.yaml", "config/balancer.yaml"}) {  // the latter has `stops`
    const auto robot = config::load(file);
    ASSERT_TRUE(robot) << robot.error();
    for (const PanelMethod& method : panel->methods) {
      const auto overridden = config::with_overrides(*robot, method.overrides);
      EXPECT_TRUE(overridden) << file << ", " << method.name << ": " << overridden.error();
    }
  }
  const auto refused = load_panel(written(with("scored: 1 s,", "scored: 1 s, command: [1, 0, 0],")));
  ASSERT_FALSE(refused) << "an arm goes nowhere";
  EXPECT_NE(refused.error().find("command"), std::string::npos) << refused.error();
}

// Goal: --robot takes the place of every robot file that the panel names. Method: a panel whose own is not there.
TEST_F(PanelFile, AnotherRobotFileTakesThePlaceOfItsOwn) {
  auto panel = load_panel(written(with(kRobot, "nowhere.yaml")));
  ASSERT_TRUE(panel) << panel.error();
  EXPECT_FALSE(Contest::prepare(*panel));
  panel->robot = kRobot;
  const auto contest = Contest::prepare(*panel);
  EXPECT_TRUE(contest) << contest.error();
}

}  // namespace
}  // namespace takt::lab

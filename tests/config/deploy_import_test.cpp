// SPDX-License-Identifier: Apache-2.0
// Goal: a robot file imported from a deploy.yaml carries exactly what the export says, and nothing it does not say.
// Method: a small export written here, and Unitree's published G1 export where it is present; the FILL_INs are
// replaced by values made up for the test.
#include "config/deploy_import.hpp"

#include <fmt/format.h>
#include <fmt/ranges.h>
#include <gtest/gtest.h>

#include <filesystem>
#include <map>
#include <regex>
#include <set>

#include "config/load.hpp"
#include "config/model_import.hpp"
#include "config/observation_shape.hpp"
#include "tests/support/files.hpp"
#include "tests/support/shared_files.hpp"

namespace takt::config {
namespace {

constexpr std::string_view kDeploy = R"(joint_ids_map: [1, 0]
step_dt: 0.02
stiffness: [100.0, 40.0]
damping: [2.0, 1.0]
default_joint_pos: [-0.5, 0.3]
commands:
  base_velocity:
    ranges: { lin_vel_x: [-0.5, 1.0], ang_vel_z: [0.1, 0.2], heading: null }
actions:
  JointPositionAction:
    clip: null
    scale: [0.25, 0.5]
    offset: [-0.5, 0.3]
    joint_ids: !!python/object/apply:builtins.slice [null, null, null]
observations:
  base_ang_vel: { params: {}, clip: null, scale: [0.2, 0.2, 0.2], history_length: 5 }
  velocity_commands: { params: {}, clip: [-1, 1], scale: [1.0, 2.0], history_length: 5 }
  joint_pos_rel: { params: {}, clip: null, scale: [1.0, 1.0], history_length: 5 }
  last_action: { params: {}, clip: null, scale: [1.0, 1.0], history_length: 1 }
)";

std::string import(std::string_view deploy_text, std::vector<std::string> names = {}) {
  const auto deploy = read_deploy_file(deploy_text, "deploy.yaml");
  EXPECT_TRUE(deploy.has_value()) << deploy.error();
  if (!deploy) return {};
  const auto text = import_deploy_file(
      *deploy,
      {.robot = "walker", .policy_file = "policy.onnx", .joint_names = std::move(names), .source = "deploy.yaml"});
  EXPECT_TRUE(text.has_value()) << text.error();
  return text.value_or("");
}

// What a person would write in place of each FILL_IN; one bus is enough for a loader.
std::string filled_in(std::string text) {
  const std::vector<std::pair<std::string, std::string>> values{
      {"protocol", "mit"},
      {"variant", "tmotor"},
      {"model", "AK80-64, kd_range: 20 Nms/rad, position_after_power_up: absolute"},
      {"max_age", "70 ms"},
      {"epsilon", "0.01"},
      {"recover_after", "200 ms"},
      {"stop_after", "300 ms"},
      {"behaviour", "hold"},
      {"timeout", "100 ms"},
      {"position_margin", "0.1 rad"},
      {"velocity_hard", "7 rad/s"},
      {"velocity", "5 rad/s"},
      {"acceleration", "50 rad/s2"},
      {"torque_rate", "9000 Nm/s"},
      {"torque", "100 Nm"},
      {"inertia", "0.1 kgm2"},
      {"interface", "can0"},
      {"name", "bus0"},
      {"bus", "bus0"},
      {"reply_id", "0"}};
  for (const auto& [key, value] : values)
    text = std::regex_replace(text, std::regex(fmt::format("\\b{}: FILL_IN", key)), fmt::format("{}: {}", key, value));
  text = std::regex_replace(text, std::regex("\\[FILL_IN, FILL_IN\\]"), "[-3 rad, 3 rad]");
  for (int id = 1; text.find("id: FILL_IN") != std::string::npos; ++id)
    text.replace(text.find("id: FILL_IN"), 11, "id: " + std::to_string(id));
  return text;
}

TEST(DeployImport, CarriesGainsPoseAndMapIntoTheRobotsOrder) {
  const auto robot = parse(filled_in(import(kDeploy, {"hip", "knee"})), "r");
  ASSERT_TRUE(robot.has_value()) << robot.error();
  EXPECT_EQ(robot->joints[0].name, "hip");
  EXPECT_EQ(robot->joints[0].kp, 100) << "gains are in the robot's order";
  EXPECT_EQ(robot->joints[1].kd, 1);
  EXPECT_EQ(robot->joints[0].home, 0.3) << "the policy's joint 1 is the robot's joint 0";
  EXPECT_EQ(robot->joints[1].home, -0.5);
  const Policy& policy = *robot->policy;
  EXPECT_EQ(policy.joint_order, (std::vector<std::size_t>{1, 0}));
  EXPECT_EQ(policy.action.joint_of_output, policy.joint_order);
  EXPECT_EQ(policy.action.scale, (std::vector<double>{0.25, 0.5})) << "in the policy's order";
  EXPECT_EQ(policy.action.offset, OffsetKind::home);
  EXPECT_EQ(policy.action.interpolation, Interpolation::hold) << "as trained: no velocity target";
  EXPECT_EQ(policy.period, milliseconds(20));
}

TEST(DeployImport, CarriesTermsInOrderWithScaleAndHistory) {
  const auto robot = parse(filled_in(import(kDeploy)), "r");
  ASSERT_TRUE(robot.has_value()) << robot.error();
  const auto& terms = robot->policy->observation;
  ASSERT_EQ(terms.size(), 4U);
  EXPECT_EQ(terms[0].kind, TermKind::base_angular_velocity);
  ASSERT_TRUE(robot->imu);
  EXPECT_EQ(robot->imu->tilt, 1.0);
  EXPECT_EQ(terms[0].scale, std::vector<double>{0.2});
  EXPECT_EQ(terms[0].history, 5U);
  EXPECT_EQ(terms[1].kind, TermKind::command);
  ASSERT_TRUE(robot->sensors[0].command);
  EXPECT_EQ(robot->sensors[0].command->minimum, (std::vector<double>{-0.5, 0.1}));
  EXPECT_EQ(robot->sensors[0].command->maximum, (std::vector<double>{1, 0.2}));
  EXPECT_EQ(robot->sensors[0].command->when_absent, (std::vector<double>{0, 0.1}))
      << "zero, or what of the range is nearest to it";
  EXPECT_EQ(terms[1].scale, (std::vector<double>{1, 2}));
  EXPECT_EQ(terms[2].kind, TermKind::joint_position_relative);
  EXPECT_EQ(terms[3].kind, TermKind::last_action);
  EXPECT_EQ(robot->policy->history_layout, "by_term");
  EXPECT_EQ(observation_width(*robot), 3U * 5 + 2 * 5 + 2 * 5 + 2);
}

TEST(DeployImport, WhatTheExportCannotKnowIsNamedNotInvented) {
  const auto robot = parse(import(kDeploy), "walker.yaml");
  ASSERT_FALSE(robot.has_value());
  for (const char* key : {"freshness.max_age", "freshness.epsilon", "degraded.behaviour", "joints[0].drive.id",
                          "joints[1].limits.torque", "joints[1].limits.position", "joints[0].inertia", "joints[0].bus"})
    EXPECT_NE(robot.error().find(std::string(key) + ": is still FILL_IN"), std::string::npos) << key << "\n"
                                                                                              << robot.error();
}

std::string with(std::string_view from, std::string_view to) {
  std::string text(kDeploy);
  const std::size_t at = text.find(from);
  EXPECT_NE(at, std::string::npos) << from;
  return text.replace(at, from.size(), to);
}

// Joint ids count the policy's joints; its joint 0 is the robot's 1 here.
TEST(DeployImport, ATermOfChosenJointsObservesThoseInThatOrder) {
  const auto order_of = [](const std::string& text) {
    const auto robot = parse(filled_in(import(text)), "r");
    EXPECT_TRUE(robot.has_value()) << robot.error();
    return robot ? robot->policy->observation[2].joints : std::vector<std::size_t>{9};
  };
  EXPECT_EQ(
      order_of(with("joint_pos_rel: { params: {}", "joint_pos_rel: { params: { asset_cfg: { joint_ids: [1, 0] } }")),
      (std::vector<std::size_t>{0, 1}));
  for (const char* all : {"[0, 1]", "null", "!!python/object/apply:builtins.slice [null, null, null]"})
    EXPECT_TRUE(order_of(with("joint_pos_rel: { params: {}",
                              std::string("joint_pos_rel: { params: { asset_cfg: { joint_ids: ") + all + " } }"))
                    .empty())
        << all;
}

TEST(DeployImport, OutputsOfChosenJointsDriveThoseInThatOrder) {
  const auto robot = parse(filled_in(import(with("joint_ids: !!python/object/apply:builtins.slice [null, null, null]",
                                                 "joint_ids: [1, 0]"))),
                           "r");
  ASSERT_TRUE(robot.has_value()) << robot.error();
  EXPECT_EQ(robot->policy->action.joint_of_output, (std::vector<std::size_t>{0, 1}));
  EXPECT_EQ(robot->policy->action.offset, OffsetKind::values) << "in the outputs' order, so not the policy's home";
}

TEST(DeployImport, NullMeansThatNothingIsScaledOrMoved) {
  std::string text = with("scale: [0.25, 0.5]\n    offset: [-0.5, 0.3]", "scale: null\n    offset: null");
  text.replace(text.find("scale: [0.2, 0.2, 0.2]"), 22, "scale: null");
  text.replace(text.find("scale: [1.0, 2.0]"), 17, "scale: null");
  const auto robot = parse(filled_in(import(text)), "r");
  ASSERT_TRUE(robot.has_value()) << robot.error();
  EXPECT_EQ(robot->policy->action.scale, std::vector<double>{1});
  EXPECT_EQ(robot->policy->action.offset_values, (std::vector<double>{0, 0}));
  EXPECT_EQ(robot->policy->observation[0].scale, std::vector<double>{1});
  EXPECT_EQ(robot->policy->observation[1].kind, TermKind::command);
}

TEST(DeployImport, OneScaleIsForAllValues) {
  std::string text = with("scale: [0.25, 0.5]", "scale: 0.25");
  text.replace(text.find("scale: [0.2, 0.2, 0.2]"), 22, "scale: 0.2");
  const auto deploy = read_deploy_file(text, "d");
  ASSERT_TRUE(deploy) << deploy.error();
  EXPECT_EQ(deploy->action_scale, (std::vector<double>{0.25, 0.25}));
  EXPECT_EQ(deploy->terms.front().scale, (std::vector<double>{0.2, 0.2, 0.2}));
  text.replace(text.find("  base_ang_vel:"), 15, "  base_height:");
  EXPECT_NE(read_deploy_file(text, "d").error().find("one scale for all of `base_height`"), std::string::npos);
}

TEST(DeployImport, OneGroupIsTakenAndSeveralAreRefusedByWhatTheyMean) {
  const std::string text(kDeploy);
  const std::size_t at = text.find("observations:\n") + 14;
  std::string grouped = text.substr(0, at) + "  obs:\n    use_gym_history: true\n";
  std::string terms = text.substr(at);
  terms.replace(terms.find("history_length: 1"), 17, "history_length: 5");  // one instant needs equal histories
  for (std::size_t line = 0; line < terms.size(); line = terms.find('\n', line) + 1) {
    terms.insert(line, "  ");
    if (terms.find('\n', line) == std::string::npos) break;
  }
  const auto robot = parse(filled_in(import(grouped + terms)), "r");
  ASSERT_TRUE(robot.has_value()) << robot.error();
  EXPECT_EQ(robot->policy->observation.size(), 4U);
  EXPECT_EQ(robot->policy->history_layout, "by_time");
  const auto several =
      read_deploy_file(grouped + terms + "  critic:\n    base_lin_vel: { params: {}, scale: [1] }\n", "d");
  ASSERT_FALSE(several.has_value());
  EXPECT_NE(several.error().find("observations has several groups"), std::string::npos) << several.error();
}

// Goal: groups fill the network's inputs in its order, and one that is of the training is named. Method: the terms
// divided into two groups and a critic's.
TEST(DeployImport, GroupsFillTheInputsThatAreCalledLikeThem) {
  std::string text(kDeploy);
  for (const char* term : {"base_ang_vel", "velocity_commands", "joint_pos_rel", "last_action"})
    text.insert(text.find(std::string("  ") + term), "  ");
  text.insert(text.find("    base_ang_vel"), "  state:\n");
  text.insert(text.find("    joint_pos_rel"), "  joints:\n");
  text += "  critic:\n    base_lin_vel: { params: {}, scale: [1] }\n";
  const auto deploy = read_deploy_file(text, "d", {"joints", "h_in", "state"});
  ASSERT_TRUE(deploy) << deploy.error();
  EXPECT_EQ(deploy->inputs, (std::vector<std::string>{"joints", "state"}));
  ASSERT_EQ(deploy->terms.size(), 4U);
  EXPECT_EQ(deploy->terms[0].name, "joint_pos_rel");
  EXPECT_EQ(deploy->terms[2].name, "base_ang_vel");
  ASSERT_EQ(deploy->notes.size(), 1U);
  EXPECT_NE(deploy->notes[0].find("observations.critic"), std::string::npos);
  text.insert(text.find("    base_ang_vel"), "    use_gym_history: true\n");
  EXPECT_NE(read_deploy_file(text, "d", {"joints", "state"}).error().find("use_gym_history of several groups"),
            std::string::npos);
}

TEST(DeployImport, AKeyThatIsNotKnownIsNamed) {
  std::string text = with("step_dt: 0.02", "step_dt: 0.02\nsomething: 3");
  text.replace(text.find("clip: null, scale: [0.2"), 23, "noise: 0.1, scale: [0.2");
  const auto deploy = read_deploy_file(text, "d");
  ASSERT_TRUE(deploy) << deploy.error();
  ASSERT_EQ(deploy->notes.size(), 2U);
  EXPECT_EQ(deploy->notes[0], "base_ang_vel.noise: Takt does not know this key");
  EXPECT_EQ(deploy->notes[1], "something: Takt does not know this key");
}

TEST(DeployImport, VelocitiesAreCarriedOverAsSuch) {
  const std::string text = with("JointPositionAction:\n    clip: null\n    scale: [0.25, 0.5]\n    offset: [-0.5, 0.3]",
                                "JointVelocityAction:\n    clip: null\n    scale: [0.25, 0.5]\n    offset: null");
  EXPECT_NE(import(text).find("kind: joint_velocity, interpolation: hold, scale: [0.25, 0.5], offset: zero"),
            std::string::npos)
      << import(text);
}

// Goal: joints of any name are carried over. Method: names with each of the letters that a robot file cannot have, and
// two that would become one.
TEST(DeployImport, JointsOfAnyNameAreCarriedOver) {
  const auto robot = parse(filled_in(import(kDeploy, {"robot0:WRJ1", "left/waist.yaw 2"})), "r");
  ASSERT_TRUE(robot) << robot.error();
  EXPECT_EQ(robot->joints[0].name, "robot0_WRJ1");
  EXPECT_EQ(robot->joints[1].name, "left_waist_yaw_2");
  const auto both =
      import_deploy_file(read_deploy_file(kDeploy, "d").value(),
                         {.robot = "w", .policy_file = "p", .joint_names = {"a/b", "a.b"}, .source = "d"});
  ASSERT_FALSE(both);
  EXPECT_NE(both.error().find("two joints have one name"), std::string::npos);
}

TEST(DeployImport, TensorsAreNamedWhereTheNetworkCallsThemOtherwise) {
  const auto deploy = read_deploy_file(kDeploy, "d");
  const auto text = import_deploy_file(
      *deploy,
      {.robot = "w", .policy_file = "p", .joint_names = {}, .source = "d", .input = "state", .output = "out.0"});
  ASSERT_TRUE(text) << text.error();
  EXPECT_NE(text->find("  input: \"state\"\n  output: \"out.0\"\n"), std::string::npos) << *text;
}

TEST(DeployImport, AGaitsPeriodIsCarriedOver) {
  const std::string text =
      with("  last_action:",
           "  gait_phase: { params: { period: 0.8 }, clip: null, scale: [1, 1], history_length: 1 }\n  last_action:");
  EXPECT_NE(import(text).find("term: gait_phase, gait_period: 800 ms"), std::string::npos) << import(text);
}

TEST(DeployImport, AClipBehindOneScaleIsOneBeforeIt) {
  const std::string text =
      with("clip: null, scale: [0.2, 0.2, 0.2]", "clip: [-1, 1], scale_first: true, scale: [0.2, 0.2, 0.2]");
  EXPECT_NE(import(text).find("clip: [-5, 5], scale: 0.2"), std::string::npos) << import(text);
}

TEST(DeployImport, AClipBeforeTheScaleIsCarriedOverAndAnotherOneSaid) {
  EXPECT_NE(import(kDeploy).find("sensor: velocity_command, clip: [-1, 1], scale: [1, 2]"), std::string::npos);
  std::string other(kDeploy);
  other.insert(other.find("clip: [-1, 1]"), "scale_first: true, ");
  EXPECT_NE(import(other).find("# Not carried over: velocity_commands: clip"), std::string::npos);
}

struct BadDeploy {
  const char* when;
  const char* from;
  const char* to;
  const char* complaint;
};

TEST(DeployFile, RefusesWhatDoesNotFitTogether) {
  for (const BadDeploy& bad :
       {BadDeploy{"a map that is no permutation", "[1, 0]", "[1, 1]",
                  "d:1:16: joint_ids_map must name a slot of 0..63 for each joint, none twice"},
        BadDeploy{"a count that differs", "[100.0, 40.0]", "[100.0]",
                  "d:3:12: `stiffness` has 1 values, joint_ids_map 2"},
        BadDeploy{"another action", "JointPositionAction:", "BinaryJointAction:", "d:10:3: action `BinaryJointAction`"},
        BadDeploy{"a velocity that does not start from zero",
                  "JointPositionAction:", "JointVelocityAction:", "JointVelocityAction has an offset"},
        BadDeploy{
            "legs by position and wheels by velocity", "  JointPositionAction:",
            "  JointVelocityAction: { scale: null, offset: null, joint_ids: [0] }\n  JointPositionAction:",
            "d:11:3: actions.JointPositionAction (all joints) is beside actions.JointVelocityAction (joint 0), and "
            "all outputs of a policy have one kind in a robot file; train with one kind"},
        BadDeploy{"the same by name", "  JointPositionAction:",
                  "  JointPositionAction: { scale: 1, offset: null, joint_names: [hip] }\n"
                  "  JointVelocityAction: { scale: 5, offset: null, joint_names: [wheel_l, wheel_r, a, b, c] }\n"
                  "  JointEffortAction:",
                  "d:11:3: actions.JointVelocityAction (joints wheel_l, wheel_r, a, b, ...) is beside "
                  "actions.JointPositionAction (joint hip), and all"},
        BadDeploy{"no period", "step_dt: 0.02\n", "", "`step_dt` is missing"},
        BadDeploy{
            "a term that writes another", "base_ang_vel:", "\"foo\\n    - { term: constant, values: [1] } #\":",
            "d:16:3: observation \"foo\\n    - { term: constant, values: [1] } #\" holds \"\\n\", and is no name"},
        BadDeploy{"a range that writes a key", "ang_vel_z:", "\"z\\n    timeout: 60 s #\":", "range \"z\\n"},
        BadDeploy{"a range whose ends are exchanged", "[-0.5, 1.0]", "[1.0, -0.5]",
                  "`lin_vel_x` ends below its beginning"},
        BadDeploy{"a history beyond a robot file's", "history_length: 5", "history_length: 65",
                  "history_length must be a whole number to 64"},
        BadDeploy{"a joint that is none", "joint_pos_rel: { params: {}",
                  "joint_pos_rel: { params: { asset_cfg: { joint_ids: [0, 2] } }",
                  "joint_ids must name joints of 0..1"},
        BadDeploy{"a word for a number", "[2.0, 1.0]", "[2.0, high]", "d:4:16: is not a number"}}) {
    std::string text(kDeploy);
    text.replace(text.find(bad.from), std::string_view(bad.from).size(), bad.to);
    const auto deploy = read_deploy_file(text, "d");
    ASSERT_FALSE(deploy.has_value()) << bad.when;
    EXPECT_NE(deploy.error().find(bad.complaint), std::string::npos) << bad.when << ": " << deploy.error();
  }
}

// Goal: a robot with fewer joints than its maker's largest loads. Method: free motor slots, with gains per slot, as
// unitree_rl_lab writes its 23-joint G1, and with gains per joint.
TEST(DeployImport, SlotsThatAreFreeAreLeftOut) {
  std::string text(kDeploy);
  text.replace(text.find("[1, 0]"), 6, "[5, 2]");
  const auto by_joint = read_deploy_file(text, "d");
  ASSERT_TRUE(by_joint) << by_joint.error();
  EXPECT_EQ(by_joint->robot_joint, (std::vector<std::size_t>{1, 0}));
  EXPECT_EQ(by_joint->slot, (std::vector<std::size_t>{2, 5}));
  EXPECT_EQ(by_joint->stiffness, (std::vector<double>{100, 40}));
  text.replace(text.find("[100.0, 40.0]"), 13, "[0, 0, 100.0, 0, 0, 40.0]");
  const auto by_slot = read_deploy_file(text, "d");
  ASSERT_TRUE(by_slot) << by_slot.error();
  EXPECT_EQ(by_slot->stiffness, by_joint->stiffness);
}

// Goal: a 23-joint G1 loads. Method: the joint map that its joints' order makes, which leaves slots of the 29-joint one
// free: waist roll and pitch (13, 14), wrist pitch and yaw of both arms (20, 21, 27, 28); gains of all 29 slots, those
// of the free ones 0, and of the 23 joints alone.
TEST(DeployImport, ATwentyThreeJointHumanoidWithGapsInItsMap) {
  const std::vector<std::size_t> map{0, 6, 12, 1, 7, 15, 22, 2, 8, 16, 23, 3, 9, 17, 24, 4, 10, 18, 25, 5, 11, 19, 26};
  const std::set<std::size_t> used(map.begin(), map.end());
  ASSERT_EQ(used.size(), 23U);
  std::vector<double> pose, by_slot, by_joint;
  for (std::size_t k = 0; k < map.size(); ++k) pose.push_back(0.01 * static_cast<double>(k));
  for (std::size_t slot = 0; slot < 29; ++slot)
    by_slot.push_back(used.contains(slot) ? 100 + static_cast<double>(slot) : 0);
  for (const std::size_t slot : used) by_joint.push_back(100 + static_cast<double>(slot));
  const auto text = [&](const std::vector<double>& gains) {
    const std::vector<double> ones(23, 1.0);
    return fmt::format(
        "joint_ids_map: [{}]\nstep_dt: 0.02\nstiffness: [{}]\ndamping: [{}]\ndefault_joint_pos: [{}]\n"
        "actions:\n  JointPositionAction: {{ clip: null, scale: [{}], offset: [{}] }}\n"
        "observations:\n  joint_pos_rel: {{ clip: null, scale: [{}], history_length: 5 }}\n",
        fmt::join(map, ", "), fmt::join(gains, ", "), fmt::join(std::vector<double>(gains.size(), 2.0), ", "),
        fmt::join(pose, ", "), fmt::join(ones, ", "), fmt::join(pose, ", "), fmt::join(ones, ", "));
  };
  std::vector<std::string> names;
  for (const std::size_t slot : used) names.push_back(fmt::format("motor_{}", slot));
  for (const std::vector<double>& gains : {by_slot, by_joint}) {
    const auto robot = parse(filled_in(import(text(gains), names)), "r");
    ASSERT_TRUE(robot) << robot.error();
    ASSERT_EQ(robot->joints.size(), 23U);
    for (std::size_t k = 0; k < map.size(); ++k) {
      const Joint& joint = robot->joints[robot->policy->joint_order[k]];
      EXPECT_EQ(joint.name, fmt::format("motor_{}", map[k])) << "the policy's joint " << k;
      EXPECT_EQ(joint.kp, 100 + static_cast<double>(map[k]));
      EXPECT_EQ(joint.home, pose[k]);
    }
    EXPECT_EQ(outputs_per_step(*robot), 23U);
  }
}

ModelFacts two_hinges() {
  ModelFacts model;
  model.joints = {{.name = "hip", .position = {{-1, 2}}, .velocity = 20, .torque = 88, .inertia = 0.1},
                  {.name = "knee", .position = {{-2, 1}}, .velocity = {}, .torque = 139, .inertia = 0.2}};
  model.keyframe = "stand";
  model.imu_site = "torso";
  return model;
}

std::expected<std::string, std::string> import_with(const ModelFacts& model, bool simulated) {
  return import_deploy_file(read_deploy_file(kDeploy, "d").value(), {.robot = "walker",
                                                                     .policy_file = "policy.onnx",
                                                                     .joint_names = {},
                                                                     .source = "d",
                                                                     .model = model,
                                                                     .model_file = "walker.xml",
                                                                     .simulated = simulated});
}

// Goal: with a model the simulated robot needs no edit. Method: both files' values stand in the robot that is read.
TEST(DeployImport, AModelFillsTheRestOfASimulatedRobot) {
  const auto text = import_with(two_hinges(), true);
  ASSERT_TRUE(text) << text.error();
  EXPECT_EQ(text->find("FILL_IN"), std::string::npos);
  const auto robot = parse(*text, "r");
  ASSERT_TRUE(robot) << robot.error();
  EXPECT_EQ(robot->joints[1].name, "knee");
  EXPECT_EQ(robot->joints[1].limits.q_max, 1);
  EXPECT_EQ(robot->joints[1].limits.torque, 139);
  EXPECT_EQ(robot->joints[0].inertia, 0.1);
  EXPECT_EQ(robot->joints[0].home, 0.3);
  ASSERT_TRUE(robot->simulation && robot->simulation->mujoco);
  EXPECT_EQ(robot->simulation->mujoco->imu_site, "torso");
  EXPECT_EQ(robot->simulation->mujoco->keyframe, "stand");
}

// Goal: a wheel's limits are not made up without a word. Method: a model that gives one of two hinges no range.
TEST(DeployImport, AJointThatTurnsWithoutEndIsNamed) {
  ModelFacts model = two_hinges();
  EXPECT_EQ(import_with(model, true).value().find("without a range"), std::string::npos);
  model.joints[1].position.reset();
  EXPECT_NE(
      import_with(model, true)
          .value()
          .find("# Note: without a range in the model: knee. limits.position is made up, a turn to either side (a "
                "slide 1 m); widen it, and drive.position_range, of a wheel\n"),
      std::string::npos)
      << import_with(model, true).value();
}

// Goal: a torque is not made up without a word. Method: a robot of a model alone that says none of one of two hinges.
TEST(DeployImport, ATorqueThatTheModelDoesNotSayIsNamed) {
  ImportOptions options{.robot = "two", .policy_file = {}, .joint_names = {}, .source = "two.urdf"};
  options.model = two_hinges();
  options.model_file = "two.urdf";
  options.simulated = true;
  EXPECT_EQ(robot_of_model(options).value().find("without a torque"), std::string::npos);
  options.model->joints[1].torque.reset();
  EXPECT_NE(robot_of_model(options).value().find("# Note: without a torque in the model: knee. limits.torque 200 Nm"),
            std::string::npos);
}

// Goal: an offset of a slide is a length. Method: the second joint slides; the file's offsets are not its pose.
TEST(DeployImport, AnOffsetIsInItsJointsUnit) {
  ModelFacts model = two_hinges();
  model.joints[1].kind = JointKind::slide;
  model.joints[1].position = {-1, 1};
  const auto deploy = read_deploy_file(with("offset: [-0.5, 0.3]", "offset: [-0.05, 0.3]"), "d");
  ASSERT_TRUE(deploy) << deploy.error();
  const auto text = import_deploy_file(*deploy, {.robot = "walker",
                                                 .policy_file = "policy.onnx",
                                                 .joint_names = {},
                                                 .source = "d",
                                                 .model = model,
                                                 .model_file = "walker.xml",
                                                 .simulated = true});
  ASSERT_TRUE(text) << text.error();
  EXPECT_NE(text->find("offset: [-0.05 m, 0.3 rad]"), std::string::npos) << *text;
  const auto robot = parse(*text, "r");
  ASSERT_TRUE(robot) << robot.error();
  EXPECT_EQ(robot->policy->action.offset_values, (std::vector{-0.05, 0.3}));
}

// Goal: a model alone makes a robot that is simulated at once, and one of a real robot leaves open what no model knows.
// Method: two hinges, one without a torque; the text is read.
TEST(ModelImport, AModelAloneMakesARobotFile) {
  ModelFacts model = two_hinges();
  model.joints[0].home = 0.25;
  model.joints[1].torque.reset();
  model.joints[1].name = "arm/knee";
  ImportOptions options{.robot = "walker",
                        .policy_file = {},
                        .joint_names = {},
                        .source = "walker.xml",
                        .model = model,
                        .model_file = "walker.xml",
                        .simulated = true};
  const auto text = robot_of_model(options);
  ASSERT_TRUE(text) << text.error();
  EXPECT_EQ(text->find("FILL_IN"), std::string::npos) << *text;
  const auto robot = parse(*text, "r");
  ASSERT_TRUE(robot) << robot.error();
  EXPECT_FALSE(robot->policy);
  EXPECT_EQ(robot->joints[0].home, 0.25);
  EXPECT_EQ(robot->joints[0].limits.torque, 88);
  EXPECT_EQ(robot->joints[1].name, "arm_knee");
  EXPECT_GT(robot->joints[1].kp, 0);
  options.simulated = false;
  const std::string open = parse(robot_of_model(options).value(), "r").error();
  for (const char* key : {"joints[1].drive.id", "joints[0].drive.protocol", "freshness.max_age", "buses[0].interface"})
    EXPECT_NE(open.find(std::string(key) + ": is still FILL_IN"), std::string::npos) << open;
  for (const char* key : {"position:", "inertia"}) EXPECT_EQ(open.find(key), std::string::npos) << open;
}

// Goal: for a real robot the model's facts are carried over, and nothing about its hardware is invented.
TEST(DeployImport, AModelLeavesTheHardwareOfARealRobotOpen) {
  const auto text = import_with(two_hinges(), false);
  ASSERT_TRUE(text) << text.error();
  EXPECT_NE(text->find("position: [-1 rad, 2 rad], velocity: 20 rad/s, torque: 88 Nm"), std::string::npos) << *text;
  const std::string open = parse(*text, "r").error();
  for (const char* key : {"joints[1].drive.id", "joints[0].drive.protocol", "freshness.max_age"})
    EXPECT_NE(open.find(std::string(key) + ": is still FILL_IN"), std::string::npos) << open;
  EXPECT_EQ(open.find("inertia"), std::string::npos) << open;
}

// Goal: slots are motors, and makers number motors as the model's actuators stand. Method: actuators in another order
// than the bodies, in the same one, and for one hinge alone; what differs is said.
TEST(DeployImport, MotorsAreNumberedAsTheActuatorsStand) {
  ModelFacts model = two_hinges();
  model.motors = {"knee", "hip"};
  const auto crossed = import_with(model, true);
  ASSERT_TRUE(crossed) << crossed.error();
  const auto robot = parse(*crossed, "r");
  ASSERT_TRUE(robot) << robot.error();
  EXPECT_EQ(robot->joints[0].name, "knee") << "slot 0";
  EXPECT_EQ(robot->joints[0].kp, 100) << "gains stand by slot";
  EXPECT_EQ(robot->joints[0].limits.torque, 139) << "the model's facts go with the name";
  EXPECT_EQ(robot->joints[0].home, 0.3) << "the policy's second joint has slot 0";
  EXPECT_NE(crossed->find("# Note: motors are numbered as the model's actuators stand (knee, ...), not as its bodies "
                          "do (hip, ...)"),
            std::string::npos)
      << *crossed;
  model.motors = {"hip", "knee"};
  const std::string same = import_with(model, true).value();
  EXPECT_EQ(same, import_with(two_hinges(), true).value()) << "a model without actuators says as much";
  EXPECT_EQ(same.find("# Note"), std::string::npos);
  model.motors = {"knee"};
  const std::string partly = import_with(model, true).value();
  EXPECT_EQ(parse(partly, "r")->joints[0].name, "hip");
  EXPECT_NE(partly.find("# Note: motors are numbered as the model's bodies stand: 1 of its 2 joints have an actuator"),
            std::string::npos)
      << partly;
}

// Goal: text of others is text. Method: names of files and of a model's parts that would end a quote or a line.
TEST(DeployImport, WritesTextOfOthersAsText) {
  ModelFacts model = two_hinges();
  model.keyframe = "stand }\n  seed: 7 #";
  model.imu_site = "a: b";
  const auto text =
      import_deploy_file(read_deploy_file(kDeploy, "d").value(), {.robot = "walker",
                                                                  .policy_file = "p\"\n  nice: -20 #.onnx",
                                                                  .joint_names = {},
                                                                  .source = "d\nsensors: []",
                                                                  .model = model,
                                                                  .model_file = "m\\\".xml",
                                                                  .simulated = true});
  ASSERT_TRUE(text) << text.error();
  EXPECT_TRUE(text->starts_with("# Imported from d\\nsensors: [].\n")) << *text;
  for (const char* const line : {"\n  nice: -20", "\n  seed: 7", "\nsensors: []"})
    EXPECT_EQ(text->find(line), std::string::npos) << line << "\n" << *text;
  for (const char* const written : {R"(file: "p\"\n  nice: -20 #.onnx")", R"(model: "m\\\".xml")", R"(site: "a: b")"})
    EXPECT_NE(text->find(written), std::string::npos) << written << "\n" << *text;
}

TEST(DeployImport, AModelOfAnotherRobotIsRefused) {
  ModelFacts model = two_hinges();
  model.joints.resize(1);
  EXPECT_NE(import_with(model, true).error().find("the model has 1 joints, the policy moves 2"), std::string::npos);
}

TEST(DeployImport, RefusesNamesThatDoNotFit) {
  const auto deploy = read_deploy_file(kDeploy, "d");
  ASSERT_TRUE(deploy.has_value());
  EXPECT_FALSE(import_deploy_file(*deploy, {.robot = "w", .policy_file = "p", .joint_names = {"a"}, .source = "d"}));
  EXPECT_FALSE(
      import_deploy_file(*deploy, {.robot = "w", .policy_file = "p", .joint_names = {"a", "a"}, .source = "d"}));
  EXPECT_FALSE(import_deploy_file(*deploy, {.robot = "no name", .policy_file = "p", .joint_names = {}, .source = "d"}));
}

// Unitree's G1: 480 inputs, 29 outputs, as the published model has.
TEST(DeployImport, UnitreeG1GivesTheModelsShape) {
  const char* path = "../shared/policies/g1_velocity/deploy.yaml";
  TAKT_NEEDS_SHARED(path);
  const auto robot = parse(filled_in(import(test::text_of(path))), "g1.yaml");
  ASSERT_TRUE(robot.has_value()) << robot.error();
  EXPECT_EQ(observation_width(*robot), 480U);
  EXPECT_EQ(outputs_per_step(*robot), 29U);
  EXPECT_EQ(robot->policy->joint_order[1], 6U) << "the policy's second joint is the right hip";
  EXPECT_EQ(robot->joints[3].kp, 150) << "left knee";
  EXPECT_EQ(robot->joints[3].home, 0.3) << "left knee";
  EXPECT_EQ(robot->joints[13].kd, 5) << "waist";
  EXPECT_EQ(robot->sensors.size(), 2U) << "IMU and velocity command";
  EXPECT_EQ(robot->policy->observation[2].sensor, "velocity_command");
}

}  // namespace
}  // namespace takt::config

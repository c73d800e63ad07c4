// SPDX-License-Identifier: Apache-2.0
// Goal: what rl_sar, legged_rl_deploy and unitree_rl_gym show a network and make of its outputs, a robot file imported
// from their configuration does too. Method: small configurations in their form, played over eight observations against
// an implementation written here from what those programs do; published ones, where they are there, are imported.
#include <fmt/format.h>
#include <fmt/ranges.h>
#include <gtest/gtest.h>

#include <algorithm>
#include <cmath>
#include <deque>
#include <sstream>

#include "config/deploy_import.hpp"
#include "config/load.hpp"
#include "policy_host/chunk_builder.hpp"
#include "policy_host/observation_builder.hpp"
#include "tests/policy_host/imported_robot.hpp"
#include "tests/support/files.hpp"
#include "tests/support/shared_files.hpp"

namespace takt::policy_host {
namespace {

using Numbers = std::vector<double>;
using Indices = std::vector<std::size_t>;

constexpr std::size_t kJoints = 4;
constexpr double kPeriod = 0.02;

// Joint j of the policy is motor motors[j].
struct Case {
  std::string text;
  Indices motors;
  Numbers home, scale;  // by the policy's joints
  Indices history;      // instants of one input, 0 the newest
  bool by_time = false;
  double clip = 0;  // of what is scaled; 0: none
  double velocity_scale = 0;
  bool phase = false;
};

// One instant: each term's values, as scaled and clipped. `q`, `dq`: by motor.
std::vector<Numbers> shown(const Case& one, const Numbers& q, const Numbers& dq, const Numbers& last, int instant) {
  std::vector<Numbers> terms(3);
  for (std::size_t j = 0; j < kJoints; ++j) {
    terms[0].push_back(q[one.motors[j]] - one.home[j]);
    terms[1].push_back(dq[one.motors[j]] * one.velocity_scale);
    terms[2].push_back(last[j]);
  }
  for (Numbers& values : terms)
    for (double& value : values)
      if (one.clip > 0) value = std::clamp(value, -one.clip, one.clip);
  if (one.phase) {
    const double turn = 2 * M_PI * std::fmod((instant - 1) * kPeriod, 0.8) / 0.8;
    terms.push_back({std::sin(turn), std::cos(turn)});
  }
  return terms;
}

void expect_as_trained(const Case& one) {
  SCOPED_TRACE(one.text);
  const config::RobotConfig robot = imported_robot(one.text, "config.yaml", kJoints, milliseconds(20));
  ObservationBuilder builder(robot);
  std::deque<std::vector<Numbers>> past;  // the newest first
  Numbers last(kJoints, 0);
  for (int instant = 1; instant <= 8; ++instant) {
    Numbers q(kJoints), dq(kJoints);
    Observation observation;
    observation.id = static_cast<std::uint64_t>(instant);
    observation.published_at = MonoTime{} + milliseconds(20) * instant;
    observation.joint_count = kJoints;
    for (std::size_t j = 0; j < kJoints; ++j) {
      observation.q[j] = static_cast<float>(std::sin(1.3 * instant + static_cast<double>(j)));
      observation.dq[j] = static_cast<float>(9 * std::cos(0.7 * instant + 2.0 * static_cast<double>(j)));
      q[j] = static_cast<double>(observation.q[j]);
      dq[j] = static_cast<double>(observation.dq[j]);
    }
    const std::vector<float> said(last.begin(), last.end());
    const auto input = builder.build(observation, {}, said);
    past.push_front(shown(one, q, dq, last, instant));
    while (past.size() <= one.history.size()) past.push_back(past.back());
    Numbers wanted;
    const std::size_t terms = past.front().size();
    for (std::size_t outer = 0; outer < (one.by_time ? one.history.size() : terms); ++outer)
      for (std::size_t inner = 0; inner < (one.by_time ? terms : one.history.size()); ++inner) {
        const Numbers& values = past[one.history[one.by_time ? outer : inner]][one.by_time ? inner : outer];
        wanted.insert(wanted.end(), values.begin(), values.end());
      }
    ASSERT_EQ(input.size(), wanted.size());
    for (std::size_t i = 0; i < wanted.size(); ++i) EXPECT_NEAR(static_cast<double>(input[i]), wanted[i], 1e-6) << i;
    for (std::size_t j = 0; j < kJoints; ++j)
      last[j] = static_cast<double>(static_cast<float>(std::sin(instant + 0.5 * static_cast<double>(j))));
    CommandChunk chunk;
    ChunkBuilder(robot, 0).fill(chunk, observation, std::vector<float>(last.begin(), last.end()));
    for (std::size_t j = 0; j < kJoints; ++j) {
      const float told = chunk.values[value_index(chunk.header, CommandField::q, 0, one.motors[j])];
      EXPECT_NEAR(static_cast<double>(told), one.home[j] + one.scale[j] * last[j], 1e-6);
    }
  }
  for (std::size_t j = 0; j < kJoints; ++j)
    EXPECT_DOUBLE_EQ(robot.joints[one.motors[j]].limits.kp, 20 + 10 * static_cast<double>(j)) << "gains by motor";
}

Case of_rl_sar(const Indices& history, bool by_time, double clip) {
  Case one{.text = {},
           .motors = {2, 0, 3, 1},
           .home = {0.1, -0.2, 0.3, -0.4},
           .scale = {0.25, 0.5, 0.25, 0.125},
           .history = history.empty() ? Indices{0} : history,
           .by_time = by_time,
           .clip = clip,
           .velocity_scale = 0.05};
  one.text = fmt::format(
      "r/robot_lab:\n  model_name: policy.pt\n  num_observations: 12\n  observations: [dof_pos, dof_vel, actions]\n"
      "  observations_history: [{}]\n  observations_history_priority: {}\n  clip_obs: {}\n"
      "  rl_kp: [20, 30, 40, 50]\n  rl_kd: [1, 1, 1, 1]\n  num_of_dofs: 4\n  action_scale: [{}]\n  wheel_indices: []\n"
      "  ang_vel_scale: 0.25\n  dof_pos_scale: 1.0\n  dof_vel_scale: 0.05\n  commands_scale: [1, 1, 1]\n"
      "  torque_limits: [5, 6, 7, 8]\n  default_dof_pos: [{}]\n  joint_mapping: [{}]\n",
      fmt::join(history, ", "), by_time ? "time" : "term", clip, fmt::join(one.scale, ", "), fmt::join(one.home, ", "),
      fmt::join(one.motors, ", "));
  return one;
}

TEST(RlSar, ShowsAndMovesWhatItsProgramDoes) {
  for (const bool by_time : {true, false})
    for (const Indices& history : {Indices{}, Indices{0, 1, 2}, Indices{2, 1, 0}})
      for (const double clip : {100.0, 0.3}) expect_as_trained(of_rl_sar(history, by_time, clip));
}

std::string refusal(const std::string& text) {
  const auto deploy = config::read_deploy_file(text, "config.yaml");
  return deploy ? "was accepted" : deploy.error();
}

std::string changed(std::string text, const std::string& from, const std::string& to) {
  text.replace(text.find(from), from.size(), to);
  return text;
}

TEST(RlSar, WhatARobotFileCannotSayIsRefusedByItsMeaning) {
  const std::string sound = of_rl_sar({}, true, 100).text;
  EXPECT_NE(refusal(changed(sound, "wheel_indices: []", "wheel_indices: [3]"))
                .find("wheel_indices moves joint 3 by velocity and the rest by position"),
            std::string::npos);
  EXPECT_NE(refusal(changed(sound, "observations_history: []", "observations_history: [0, 2]")).find("whole histories"),
            std::string::npos);
  EXPECT_NE(refusal(changed(sound, "num_observations: 12", "num_observations: 13")).find("have 12 values"),
            std::string::npos);
  EXPECT_NE(refusal(changed(sound, "joint_mapping: [2, 0, 3, 1]", "joint_mapping: [2, 0, 3, 3]")).find("none twice"),
            std::string::npos);
}

TEST(RlSar, EarlierMappingsAreEachOthersInverse) {
  const std::string sound = of_rl_sar({}, true, 100).text, now = "joint_mapping: [2, 0, 3, 1]";
  const auto deploy = config::read_deploy_file(
      changed(sound, now, "state_mapping: [2, 0, 3, 1]\n  command_mapping: [1, 3, 0, 2]"), "config.yaml");
  ASSERT_TRUE(deploy) << deploy.error();
  EXPECT_EQ(deploy->robot_joint, (Indices{2, 0, 3, 1}));
  EXPECT_NE(refusal(changed(sound, now, "state_mapping: [2, 0, 3, 1]\n  command_mapping: [2, 0, 3, 1]"))
                .find("read at one motor and moved at another"),
            std::string::npos);
}

TEST(RlSar, EveryKeyIsUsedOrNamed) {
  const auto deploy = config::read_deploy_file(of_rl_sar({}, true, 100).text + "  new_key: 3\n", "config.yaml");
  ASSERT_TRUE(deploy) << deploy.error();
  const std::string notes = fmt::format("{}", fmt::join(deploy->notes, "\n"));
  for (const char* key : {"model_name", "new_key"}) EXPECT_NE(notes.find(key), std::string::npos) << notes;
  EXPECT_EQ(deploy->torque, (Numbers{6, 8, 5, 7})) << "by motor";
  EXPECT_EQ(deploy->step_dt.ns, 0) << "in base.yaml";
}

std::string rl_gym(const std::string& without, int values) {
  return fmt::format(
      "policy_path: p.pt\nsimulation_dt: 0.002\ncontrol_decimation: 10\nkps: [20, 30, 40, 50]\nkds: [1, 1, 1, 1]\n"
      "default_angles: [0.1, -0.2, 0.3, -0.4]\nang_vel_scale: 0.25\ndof_pos_scale: 1.0\ndof_vel_scale: 0.05\n"
      "action_scale: 0.25\ncmd_scale: [2.0, 2.0, 0.25]\nmax_cmd: [0.8, 0.5, 1.57]\nnum_actions: 4\nnum_obs: {}\n{}",
      values, without);
}

TEST(RlGym, TermsScalesAndOrderAreItsPrograms) {
  const auto deploy = config::read_deploy_file(rl_gym("leg_joint2motor_idx: [2, 0, 3, 1]\n", 23), "g1.yaml");
  ASSERT_TRUE(deploy) << deploy.error();
  const std::vector<std::pair<const char*, Numbers>> wanted{{"base_ang_vel", {0.25, 0.25, 0.25}},
                                                            {"projected_gravity", {1, 1, 1}},
                                                            {"velocity_commands", {2, 2, 0.25}},
                                                            {"joint_pos_rel", Numbers(4, 1)},
                                                            {"joint_vel_rel", Numbers(4, 0.05)},
                                                            {"last_action", Numbers(4, 1)},
                                                            {"gait_phase", {1, 1}}};
  ASSERT_EQ(deploy->terms.size(), wanted.size());
  for (std::size_t i = 0; i < wanted.size(); ++i) {
    EXPECT_EQ(deploy->terms[i].name, wanted[i].first);
    EXPECT_EQ(deploy->terms[i].scale, wanted[i].second) << wanted[i].first;
  }
  EXPECT_EQ(deploy->terms.back().gait_period, milliseconds(800));
  EXPECT_EQ(deploy->step_dt, milliseconds(20));
  EXPECT_EQ(deploy->stiffness, (Numbers{30, 50, 20, 40})) << "by motor";
  EXPECT_EQ(deploy->default_position, (Numbers{0.1, -0.2, 0.3, -0.4})) << "by the policy's joints";
  EXPECT_EQ(deploy->action_offset, deploy->default_position);
  ASSERT_EQ(deploy->command_ranges.size(), 3U);
  EXPECT_EQ(deploy->command_ranges[2], (std::pair<std::string, std::pair<double, double>>{"ang_vel_z", {-1.57, 1.57}}));
  EXPECT_NE(refusal(rl_gym("", 30)).find("`num_obs` is 30"), std::string::npos);
  EXPECT_EQ(config::read_deploy_file(rl_gym("", 21), "g1.yaml")->terms.size(), 6U) << "without a phase";
}

Case of_legged_rl(const Indices& history, double clip, bool with_phase) {
  Case one{.text = {},
           .motors = {2, 0, 3, 1},
           .home = {0.1, -0.2, 0.3, -0.4},
           .scale = {0.25, 0.5, 0.25, 0.125},
           .history = history,
           .by_time = true,
           .clip = clip,
           .velocity_scale = 0.05,
           .phase = with_phase};
  const std::string bounds = fmt::format("min: -{0}, max: {0}", clip);
  Numbers away;
  for (const double home : one.home) away.push_back(-home);
  one.text = fmt::format(
      "llc_config_file: go2.yaml\nll_dt: 0.005\npolicy:\n  backend: ort\n  model_path: p.onnx\n  input_dim: {0}\n"
      "  output_dim: 4\n  policy_dt: 0.02\n  joint_ids_map: [{1}]\n  stiffness: [20, 30, 40, 50]\n  damping: [1, 1, 1, "
      "1]\n"
      "  commands: {{}}\n  actions:\n    JointPositionAction: {{ process_order: [scale, offset], scale: [{2}], offset: "
      "[{3}] }}\n"
      "  observations:\n    stack: {{ length: {4}, order: {5} }}\n    terms:\n"
      "      joint_pos: {{ process_order: [offset, scale, clip], offset: [{6}], scale: 1.0, {7} }}\n"
      "      joint_vel: {{ process_order: [scale, clip], scale: [0.05, 0.05, 0.05, 0.05], {7} }}\n"
      "      last_action: {{ process_order: [clip], {7} }}\n",
      (with_phase ? 14 : 12) * history.size(), fmt::join(one.motors, ", "), fmt::join(one.scale, ", "),
      fmt::join(one.home, ", "), history.size(), history.front() == 0 ? "newest_first" : "oldest_first",
      fmt::join(away, ", "), bounds);
  if (with_phase) one.text += "      gait_phase_2: { params: { cycle_time: 0.8 } }\n";
  return one;
}

TEST(LeggedRl, ShowsAndMovesWhatItsProgramDoes) {
  for (const Indices& history : {Indices{0}, Indices{0, 1, 2}, Indices{2, 1, 0}})
    for (const double clip : {100.0, 0.3})
      for (const bool with_phase : {false, true}) expect_as_trained(of_legged_rl(history, clip, with_phase));
}

// Goal: steps in any order come out as one clip and one scale, or are named. Method: by hand.
TEST(LeggedRl, StepsInAnyOrder) {
  const std::string sound = of_legged_rl({0}, 100, false).text;
  const auto read = [&](const std::string& from, const std::string& to) {
    const auto deploy = config::read_deploy_file(changed(sound, from, to), "config.yaml");
    EXPECT_TRUE(deploy) << deploy.error();
    return deploy.value_or(config::DeployFile{});
  };
  const auto velocity = [&](const std::string& text) {
    return read("process_order: [scale, clip], scale: [0.05, 0.05, 0.05, 0.05], min: -100, max: 100", text).terms.at(1);
  };
  EXPECT_EQ(velocity("process_order: [clip, scale], scale: 0.05, min: -2, max: 3").clip, (Numbers{-2, 3}));
  EXPECT_EQ(velocity("process_order: [scale, clip], scale: 0.5, min: [-2], max: [3]").clip, (Numbers{-4, 6}));
  EXPECT_EQ(velocity("process_order: [scale, clip], scale: -0.5, min: -2, max: 3").clip, (Numbers{-6, 4}));
  EXPECT_TRUE(velocity("scale: 7, min: -2, max: 3").clip.empty()) << "no step";
  EXPECT_EQ(velocity("scale: 7, min: -2, max: 3").scale, Numbers(4, 1));
  const config::DeployFile shifted = read("process_order: [offset, scale, clip]", "process_order: [clip, offset]");
  EXPECT_TRUE(shifted.terms.at(0).clip.empty());
  EXPECT_NE(fmt::format("{}", fmt::join(shifted.notes, "\n")).find("clip of joint_pos_rel"), std::string::npos);
  const config::DeployFile driven = read("commands: {}",
                                         "commands: { base_velocity: { process_order: [scale, clip], scale: [2, 0.5, "
                                         "1], min: [-0.5, -1, -1], max: [1, 1, 1] } }");
  using Range = std::pair<std::string, std::pair<double, double>>;
  EXPECT_EQ(driven.command_ranges,
            (std::vector<Range>{{"lin_vel_x", {-0.5, 1}}, {"lin_vel_y", {-0.5, 0.5}}, {"ang_vel_z", {-1, 1}}}));
}

TEST(LeggedRl, EveryKeyIsUsedNamedOrRefusedByItsMeaning) {
  const std::string sound = of_legged_rl({0}, 100, false).text;
  const auto deploy = config::read_deploy_file("new_key: 3\n" + sound, "config.yaml");
  ASSERT_TRUE(deploy) << deploy.error();
  const std::string notes = fmt::format("{}", fmt::join(deploy->notes, "\n"));
  for (const char* key : {"new_key", "model_path", "ll_dt"}) EXPECT_NE(notes.find(key), std::string::npos) << notes;
  for (const auto& [from, to, why] : std::vector<std::array<std::string, 3>>{
           {"input_dim: 12", "input_dim: 13", "the terms have 12 values"},
           {"output_dim: 4", "output_dim: 5", "has 4 joints"},
           {"joint_ids_map: [2, 0, 3, 1]", "joint_ids_map: [2, 0, 3, 3]", "none twice"},
           {"policy_dt: 0.02", "policy_dt: 0", "policy_dt is not positive"},
           {"process_order: [clip]", "process_order: [clamp]", "process_order knows clip, scale and offset"},
           {"joint_vel: { process_order: [scale, clip]", "joint_vel: { process_order: [offset], offset: 1, xs: [clip]",
            "only joint positions have one"},
           {"stack: {", "assemble: [{ terms: [joint_pos] }]\n    stack: {", "some of the terms only"},
           {"stack: {", "layout: { blocks: [{ kind: current_frame }, { kind: current_frame }] }\n    stack: {",
            "several blocks"},
           {"JointPositionAction", "JointVelocityAction",
            "actions.JointVelocityAction (all joints) is beside actions.JointPositionAction"}})
    EXPECT_NE(refusal(changed(sound, from, to)).find(why), std::string::npos) << refusal(changed(sound, from, to));
  EXPECT_NE(refusal("go2: { dt: 0.005, decimation: 4, joint_mapping: [0, 1] }\n").find("is no deploy.yaml"),
            std::string::npos)
      << "rl_sar's base.yaml alone";
  EXPECT_NE(refusal("fsm: { policies: { walk: { config: a.yaml } } }\n").find("import one of those"),
            std::string::npos);
  EXPECT_EQ(config::read_deploy_file(
                changed(sound, "stack: {", "assemble: [{ terms: [joint_vel, joint_pos, last_action] }]\n    stack: {"),
                "c.yaml")
                ->terms.front()
                .name,
            "joint_vel_rel");
}

using test::text_of;

// A sensor's history is of its samples, a command's of observations: limits that no file says are to be filled in.
TEST(RlSar, ACommandIsNoSensor) {
  std::string text = of_rl_sar({2, 1, 0}, true, 0.5).text;
  text = changed(text, "observations: [dof_pos,", "observations: [commands, dof_pos,");
  const auto deploy = config::read_deploy_file(changed(text, "num_observations: 12", "num_observations: 15"), "c.yaml");
  ASSERT_TRUE(deploy) << deploy.error();
  const auto robot = config::import_deploy_file(
      *deploy, {.robot = "r", .policy_file = "p.onnx", .joint_names = {}, .source = "c.yaml"});
  ASSERT_TRUE(robot) << robot.error();
  EXPECT_NE(robot->find("{ term: command, sensor: velocity_command, clip: [-0.5, 0.5], scale: 1, history: 3 }"),
            std::string::npos)
      << *robot;
  EXPECT_NE(robot->find("minimum: [FILL_IN, FILL_IN, FILL_IN]"), std::string::npos) << *robot;
}

TEST(OtherExports, PublishedOnesAreRead) {
  const std::filesystem::path shared = "../shared/policies";
  TAKT_NEEDS_SHARED(shared);
  for (const char* name : {"rl_sar_b2/config.yaml", "rl_sar_go2_himloco/config.yaml", "unitree_rl_gym_g1/g1.yaml"}) {
    const auto deploy = config::read_deploy_file(text_of(shared / name), name);
    ASSERT_TRUE(deploy) << deploy.error();
    EXPECT_EQ(deploy->robot_joint.size(), 12U) << name;
    for (const std::string& note : deploy->notes) EXPECT_EQ(note.find("does not know"), std::string::npos) << note;
  }
  const auto himloco = config::read_deploy_file(text_of(shared / "rl_sar_go2_himloco/config.yaml"), "config.yaml");
  EXPECT_TRUE(himloco->newest_first && himloco->history_by_time);
  EXPECT_EQ(himloco->terms[0].history, 6U);
}

}  // namespace
}  // namespace takt::policy_host

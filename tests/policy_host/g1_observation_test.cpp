// SPDX-License-Identifier: Apache-2.0
// Goal: a published humanoid's policy sees its input exactly as its exporter laid it out, and answers as the exporter's
// engine does. Method: the deploy.yaml and reference vectors in ../shared; each reference input is taken apart into
// five instants of a robot (drives, IMU, command), which the builder puts together again. Skipped, loudly, without
// them.
#include <fmt/format.h>
#include <gtest/gtest.h>

#include <algorithm>
#include <array>
#include <cmath>
#include <nlohmann/json.hpp>
#include <optional>
#include <span>
#include <string>
#include <vector>

#include "config/deploy_file.hpp"
#include "config/robot_config.hpp"
#include "policy_host/observation_builder.hpp"
#include "policy_host/onnx_policy.hpp"
#include "tests/support/files.hpp"
#include "tests/support/shared_files.hpp"

namespace takt::policy_host {
namespace {

const std::string kFolder = "../shared/policies/g1_velocity/";
constexpr std::size_t kJoints = 29, kInstants = 5;

using test::text_of;

config::TermKind kind_of(const std::string& name) {
  if (name == "base_ang_vel") return config::TermKind::base_angular_velocity;
  if (name == "projected_gravity") return config::TermKind::projected_gravity;
  if (name == "velocity_commands") return config::TermKind::command;
  if (name == "joint_pos_rel") return config::TermKind::joint_position_relative;
  if (name == "joint_vel_rel") return config::TermKind::joint_velocity;
  return config::TermKind::last_action;
}

// As config::import_deploy_file would, without drives and limits.
config::RobotConfig robot_of(const config::DeployFile& deploy) {
  config::RobotConfig robot;
  robot.joints.resize(kJoints);
  robot.sensors.push_back({.name = "velocity_command", .values = 3, .timeout = seconds(1)});
  config::Policy& policy = robot.policy.emplace();
  policy.joint_order = deploy.robot_joint;
  policy.action.joint_of_output = deploy.robot_joint;
  for (std::size_t k = 0; k < kJoints; ++k) robot.joints[deploy.robot_joint[k]].home = deploy.default_position[k];
  for (const config::DeployTerm& term : deploy.terms) {
    config::ObservationTerm& added = policy.observation.emplace_back();
    added.kind = kind_of(term.name);
    added.scale = term.scale;
    added.history = term.history;
    if (added.kind == config::TermKind::command) added.sensor = "velocity_command";
  }
  return robot;
}

// A quaternion, of whatever length, whose projected gravity is `g`; none where there is none.
std::optional<std::array<float, 4>> leaning_to(std::span<const double> g) {
  const double r = std::sqrt((g[2] + 1) / 2), w = std::hypot(g[0], g[1]) / (2 * r);
  if (!(g[2] > -1) || !(w > 0)) return std::nullopt;
  return std::array{static_cast<float>(w), static_cast<float>(-g[1] / (2 * w)), static_cast<float>(g[0] / (2 * w)),
                    0.0F};
}

struct Instant {
  Observation observation;
  SensorSample command;
  std::vector<float> last_action;
};

class G1Observation : public testing::Test {
 protected:
  void SetUp() override {
    TAKT_NEEDS_SHARED(kFolder + "reference.json", kFolder + "deploy.yaml");
    deploy = config::read_deploy_file(text_of(kFolder + "deploy.yaml"), "deploy.yaml").value();
    cases = nlohmann::json::parse(text_of(kFolder + "reference.json")).at("cases");
  }
  // None: such a robot cannot lean so.
  std::optional<Instant> instant(const std::vector<double>& input, std::size_t index) const {
    Instant now;
    std::size_t begin = 0;
    for (const config::DeployTerm& term : deploy.terms) {
      const std::size_t width = term.scale.size();
      std::vector<double> values;
      for (std::size_t i = 0; i < width; ++i) values.push_back(input[begin + index * width + i] / term.scale[i]);
      begin += width * kInstants;
      if (!put(term.name, values, now)) return std::nullopt;
    }
    return now;
  }

  config::DeployFile deploy;
  nlohmann::json cases;

 private:
  bool put(const std::string& name, const std::vector<double>& values, Instant& now) const {
    Observation& seen = now.observation;
    const auto narrow = [](double value) { return static_cast<float>(value); };
    if (name == "base_ang_vel") std::ranges::transform(values, seen.imu.angular_velocity, narrow);
    if (name == "velocity_commands") std::ranges::transform(values, now.command.values, narrow);
    if (name == "last_action") std::ranges::transform(values, std::back_inserter(now.last_action), narrow);
    for (std::size_t k = 0; k < values.size() && values.size() == kJoints; ++k) {
      const std::size_t joint = deploy.robot_joint[k];
      if (name == "joint_pos_rel") seen.q[joint] = narrow(values[k] + deploy.default_position[k]);
      if (name == "joint_vel_rel") seen.dq[joint] = narrow(values[k]);
    }
    if (name != "projected_gravity") return true;
    const auto rotation = leaning_to(values);
    if (rotation) std::ranges::copy(*rotation, seen.imu.rotation);
    return rotation.has_value();
  }
};

TEST_F(G1Observation, IsBuiltExactlyAsTheReferenceVectorsAre) {
  const config::RobotConfig robot = robot_of(deploy);
  ObservationBuilder builder(robot);
  ASSERT_EQ(builder.input_size(), 480U);
  auto policy = load_onnx_policy(kFolder + "policy.onnx", "obs", "actions");
  ASSERT_TRUE(policy) << policy.error();
  int compared = 0;
  for (const auto& one : cases) {
    const auto wanted = one.at("obs").get<std::vector<double>>();
    builder.reset();
    std::span<const float> input;
    bool possible = true;
    for (std::size_t i = 0; i < kInstants && possible; ++i) {
      const auto now = instant(wanted, i);
      possible = now.has_value();
      if (possible) input = builder.build(now->observation, std::span(&now->command, 1), now->last_action);
    }
    if (!possible) continue;
    ++compared;
    for (std::size_t i = 0; i < wanted.size(); ++i)
      ASSERT_NEAR(input[i], wanted[i], 1e-5 * std::max(1.0, std::abs(wanted[i]))) << "value " << i;
    std::vector<float> actions((*policy)->output_size());
    (*policy)->reset();
    (*policy)->infer(input, actions);
    const auto answered = one.at("actions").get<std::vector<double>>();
    for (std::size_t i = 0; i < answered.size(); ++i)
      EXPECT_NEAR(actions[i], answered[i], 1e-4 * std::max(1.0, std::abs(answered[i]))) << "output " << i;
  }
  EXPECT_GE(compared, 4) << "of " << cases.size();
}

}  // namespace
}  // namespace takt::policy_host

// SPDX-License-Identifier: Apache-2.0
// Goal: how far MuJoCo in process (Debian's 2.2.2) and npm's @mujoco/mujoco drift apart on the same robots is known,
// and a policy does its task in both. Method: the demo arm as MJCF, the balancer and, where ../shared has it, Unitree's
// G1: each held at home by its own gains from the same state, in process and behind the world protocol; then by its
// policy. Where node or the npm package is missing, all skip; not with TAKT_REQUIRE_NODE=1.
#include <fmt/format.h>
#include <gtest/gtest.h>
#include <unistd.h>

#include <algorithm>
#include <cmath>
#include <cstdlib>
#include <filesystem>
#include <fstream>
#include <numbers>

#include "config/load.hpp"
#include "evidence/rollout/rollout.hpp"
#include "policy_host/onnx_policy.hpp"
#include "simulation/mechanics.hpp"
#include "tests/evidence/rollout/published_g1.hpp"
#include "tests/simulation/arm_as_mjcf.hpp"
#include "tests/support/shared_files.hpp"

namespace takt::lab {
namespace {

// At most this far apart; the figures are in docs/mujoco.md.
constexpr double kArmDrift_rad = 1e-6, kBalancerDrift = 1e-3, kG1Drift = 1e-3;
constexpr evidence::WorldProcess::Patience kPatience{seconds(120), {seconds(60), seconds(60)}};

class MujocoVersions : public testing::Test {
 protected:
  void SetUp() override {
    const bool there = std::system("node --version >/dev/null 2>&1") == 0 &&
                       std::filesystem::exists("tests/node/node_modules/@mujoco/mujoco");
    const char* const required = getenv("TAKT_REQUIRE_NODE");
    if (there) return;
    ASSERT_FALSE(required && std::string_view(required) == "1") << "node or @mujoco/mujoco is missing";
    GTEST_SKIP() << "SKIPPED: node or tests/node/node_modules/@mujoco/mujoco is missing";
  }
  ~MujocoVersions() override {
    std::remove(arm_model_.c_str());
    std::remove(g1_.c_str());
  }
  static std::string command_of(const config::RobotConfig& robot) {
    const config::MujocoWorld& model = *robot.simulation->mujoco;
    return fmt::format("exec node tests/node/mujoco_model_world.mjs '{}' {{}} '{}' '{}'", model.model, model.imu_site,
                       model.keyframe);
  }
  config::RobotConfig arm() const {
    config::RobotConfig robot = config::load("config/arm6.yaml").value();
    std::ofstream(arm_model_) << takt::test::arm_as_mjcf(robot);
    robot.simulation->mujoco = config::MujocoWorld{arm_model_, {}, {}};
    return robot;
  }
  config::RobotConfig g1() const {
    test::import_g1(g1_);
    return config::load(g1_).value();
  }

  const std::string arm_model_ = testing::TempDir() + fmt::format("takt-arm-{}.xml", getpid());
  const std::string g1_ = testing::TempDir() + fmt::format("takt-g1-{}.yaml", getpid());
};

// Each joint to its home, and a tenth of a radian around it in a second, as far as its torque goes.
Eigen::VectorXd torque_of(const config::RobotConfig& robot, const simulation::ArmState& state, double time_s) {
  Eigen::VectorXd torque(state.q.size());
  for (std::size_t j = 0; j < robot.joints.size(); ++j) {
    const auto i = static_cast<Eigen::Index>(j);
    const config::Joint& joint = robot.joints[j];
    const double turn = 2 * std::numbers::pi, wanted = joint.home + 0.1 * std::sin(turn * time_s);
    const double speed = 0.1 * turn * std::cos(turn * time_s);
    const double most = joint.limits.torque;
    torque[i] = std::clamp(joint.kp * (wanted - state.q[i]) + joint.kd * (speed - state.dq[i]), -most, most);
  }
  return torque;
}

struct Drift {
  double joint_rad = 0, base_m = 0, moved_rad = 0;
};

Drift drift_of(const config::RobotConfig& robot, Duration horizon, const std::string& command) {
  evidence::WorldProcess world(command, kPatience);
  auto there = world.begin(robot, 1);
  if (!there) throw std::runtime_error(there.error().sentence);
  const auto here = simulation::make_mechanics(robot).value();
  simulation::ArmState a = (*there)->begin(), b = a;
  const simulation::ArmState began = a;
  const std::vector<simulation::Friction> friction(robot.joints.size(), {robot.simulation->viscous, 0});
  Drift most;
  for (Duration at; at < horizon; at = at + robot.simulation->step) {
    here->integrate(a, torque_of(robot, a, at.seconds()), friction, robot.simulation->step);
    (*there)->integrate(b, torque_of(robot, b, at.seconds()), friction, robot.simulation->step);
    if ((*there)->end()) throw std::runtime_error((*there)->end()->sentence);
    most.joint_rad = std::max(most.joint_rad, (a.q - b.q).cwiseAbs().maxCoeff());
    most.moved_rad = std::max(most.moved_rad, (a.q - began.q).cwiseAbs().maxCoeff());
    const auto base = here->base(), other = (*there)->base();
    for (std::size_t i = 0; i < 3; ++i)
      most.base_m = std::max(most.base_m, std::abs(base->position[i] - other->position[i]));
  }
  return most;
}

void report(const char* robot, Duration horizon, const Drift& drift) {
  fmt::print("{}: {:.2g} rad and {:.2g} m apart at most within {:.1f} s, in which a joint moved {:.2f} rad\n", robot,
             drift.joint_rad, drift.base_m, horizon.seconds(), drift.moved_rad);
}

TEST_F(MujocoVersions, TheArmDriftsLittle) {
  const config::RobotConfig robot = arm();
  const Drift drift = drift_of(robot, seconds(2), command_of(robot));
  report("arm6", seconds(2), drift);
  EXPECT_GT(drift.moved_rad, 0.05);
  EXPECT_LT(drift.joint_rad, kArmDrift_rad);
}

TEST_F(MujocoVersions, TheBalancerDriftsLittle) {
  const config::RobotConfig robot = config::load("config/balancer.yaml").value();
  const Drift drift = drift_of(robot, milliseconds(500), command_of(robot));
  report("balancer", milliseconds(500), drift);
  EXPECT_GT(drift.moved_rad, 0.05);
  EXPECT_LT(drift.joint_rad, kBalancerDrift);
  EXPECT_LT(drift.base_m, kBalancerDrift);
}

TEST_F(MujocoVersions, ThePublishedHumanoidDriftsLittle) {
  TAKT_NEEDS_SHARED(test::kG1Model, test::kG1Policy + "policy.onnx", test::kG1Policy + "deploy.yaml");
  const config::RobotConfig robot = g1();
  const Drift drift = drift_of(robot, milliseconds(500), command_of(robot));
  report("g1", milliseconds(500), drift);
  EXPECT_GT(drift.moved_rad, 0.05);
  EXPECT_LT(drift.joint_rad, kG1Drift);
  EXPECT_LT(drift.base_m, kG1Drift);
}

// Goal: the two engines' drift is none that a policy notices. Method: the same rollout in both.
void expect_task_done_in_both(const config::RobotConfig& robot, const std::string& command) {
  const auto policy =
      policy_host::load_onnx_policy(robot.policy->file, robot.policy->input, robot.policy->output).value();
  const auto fallback = evidence::load_fallback_host(robot).value();
  evidence::WorldProcess world(command, kPatience);
  evidence::RolloutSetup setup{.robot = robot,
                               .policy = *policy,
                               .policy_hash = 1,
                               .fallback = fallback.get(),
                               .task = evidence::Task::base_velocity,
                               .timing = {.inference = milliseconds(2)},
                               .perturbation = {},
                               .seed = 1,
                               .duration = seconds(8),
                               .scored = seconds(2),
                               .bound_m = 0.3};
  double error_m[2] = {};
  for (const bool outside : {false, true}) {
    setup.world = outside ? &world : nullptr;
    evidence::RolloutRow row;
    const auto done = evidence::run_rollout(setup, row);
    ASSERT_TRUE(done) << done.error();
    EXPECT_TRUE(row.success) << (outside ? "npm's: " : "in process: ") << row.failure_label;
    error_m[outside ? 1 : 0] = row.tracking_error_rms_m;
  }
  fmt::print("{} by its policy, 8 s: {:.1f} mm off its commanded way in a second in process, {:.1f} mm in the other\n",
             robot.robot, 1e3 * error_m[0], 1e3 * error_m[1]);
  EXPECT_NEAR(error_m[0], error_m[1], 0.05);
}

TEST_F(MujocoVersions, TheBalancersPolicyNoticesNothing) {
  const config::RobotConfig robot = config::load("config/balancer.yaml").value();
  expect_task_done_in_both(robot, command_of(robot));
}

TEST_F(MujocoVersions, ThePublishedHumanoidWalksInBoth) {
  TAKT_NEEDS_SHARED(test::kG1Model, test::kG1Policy + "policy.onnx", test::kG1Policy + "deploy.yaml");
  const config::RobotConfig robot = g1();
  expect_task_done_in_both(robot, command_of(robot));
}

}  // namespace
}  // namespace takt::lab

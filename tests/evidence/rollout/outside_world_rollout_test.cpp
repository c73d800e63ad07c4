// SPDX-License-Identifier: Apache-2.0
// Goal: a rollout in a world of another process is the rollout in process, bit for bit, where the mechanics are the
// same; how such a world ends is how the rollout ends. Method: the demo arm's own dynamics and the balancer in MuJoCo
// behind takt/world.h in a forked child, beside the same in process; then worlds that end in every way there is.
#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <algorithm>
#include <map>
#include <set>

#include "config/observation_shape.hpp"
#include "evidence/rollout/rollout.hpp"
#include "policy_host/onnx_policy.hpp"
#include "simulation/mechanics.hpp"
#include "tests/evidence/rollout/arm_rollouts.hpp"
#include "tests/simulation/forked_world.hpp"

namespace takt::lab {
namespace {

using takt::test::ForkedWorld;
using testing::HasSubstr;
constexpr simulation::WorldProcess::Patience kPatience{seconds(60), {seconds(60), seconds(60)}};
constexpr simulation::WorldProcess::Patience kImpatience{seconds(60), {seconds(60), milliseconds(500)}};
constexpr std::uint32_t kEverything = TAKT_WORLD_POINT | TAKT_WORLD_BASE | TAKT_WORLD_IMU | TAKT_WORLD_PUSH;

// What the robot file describes, as another process: one simulation after the other. `spoil` has the last word on every
// state; false: the process ends.
using Spoil = std::function<bool(const takt_world&, takt_world_state&)>;

class RobotFilesWorld {
 public:
  explicit RobotFilesWorld(const config::RobotConfig& robot) : robot_(robot) {}

  void answer(const takt_world& world, takt_world_state& state) {
    const std::size_t count = robot_.joints.size();
    if (world.kind == TAKT_WORLD_RESET) {
      mechanics_ = simulation::make_mechanics(robot_).value();
      now_ = {Eigen::Map<const Eigen::VectorXd>(world.reset.q, static_cast<Eigen::Index>(count)),
              Eigen::VectorXd::Zero(static_cast<Eigen::Index>(count))};
    } else {
      std::vector<simulation::Friction> friction(count);
      for (std::size_t i = 0; i < count; ++i) friction[i] = {world.step.viscous[i], world.step.coulomb[i]};
      mechanics_->hoist(world.step.hangs != 0);
      mechanics_->push(std::to_array(world.step.push), {});
      mechanics_->integrate(now_,
                            Eigen::Map<const Eigen::VectorXd>(world.step.torque, static_cast<Eigen::Index>(count)),
                            friction, robot_.simulation->step);
    }
    std::copy_n(now_.q.data(), count, state.q);
    std::copy_n(now_.dq.data(), count, state.dq);
    std::ranges::copy(mechanics_->controlled_point(now_.q), state.point);
    state.base_orientation[0] = 1;
    if (const auto base = mechanics_->base()) {
      std::ranges::copy(base->position, state.base_position);
      std::ranges::copy(base->orientation, state.base_orientation);
    }
    if (const auto imu = mechanics_->imu()) {
      std::ranges::copy(imu->orientation, state.orientation);
      std::ranges::copy(imu->angular_velocity, state.angular_velocity);
      std::ranges::copy(imu->acceleration, state.acceleration);
    }
  }

 private:
  const config::RobotConfig& robot_;
  std::unique_ptr<simulation::Mechanics> mechanics_;
  simulation::ArmState now_;
};

void play(const std::string& path, const config::RobotConfig& robot, std::uint32_t gives, const Spoil& spoil) {
  takt_world world;
  if (takt_world_listen(&world, path.c_str()) != 0) return;
  RobotFilesWorld body(robot);
  while (takt_world_accept(&world, "forked", gives) == 0) {
    takt_world_state state{};
    state.orientation[0] = 1;
    while (takt_world_next(&world) == 0) {
      state.time_ns = world.kind == TAKT_WORLD_RESET ? 0 : world.step.time_ns + world.step.step_ns;
      body.answer(world, state);
      if (spoil && !spoil(world, state)) return;
      if (takt_world_answer(&world, &state) != 0) break;
    }
  }
}

// The rover of base_velocity_rollout_test has a policy of its own; the balancer's is in config/.
struct Balancer {
  config::RobotConfig robot = config::load("config/balancer.yaml").value();
  std::unique_ptr<policy_host::Policy> policy =
      policy_host::load_onnx_policy(robot.policy->file, "obs", "actions").value();
  std::unique_ptr<evidence::FallbackHost> fallback = std::move(evidence::load_fallback_host(robot).value());

  evidence::RolloutSetup setup(std::string_view perturbation, double dose) {
    return {.robot = robot,
            .policy = *policy,
            .policy_hash = 1,
            .fallback = fallback.get(),
            .task = evidence::Task::base_velocity,
            .timing = {},
            .perturbation = {evidence::find_perturbation(perturbation)->as<evidence::Trouble>(), dose, seconds(4),
                             seconds(2)},
            .seed = 5,
            .duration = seconds(8),
            .scored = seconds(2),
            .bound_m = 0.3};
  }
};

void expect_same(evidence::RolloutSetup setup, evidence::WorldProcess& world) {
  setup.world = nullptr;
  const evidence::RolloutRow inside = test::run(setup);
  setup.world = &world;
  const evidence::RolloutRow outside = test::run(setup), again = test::run(setup);
  EXPECT_TRUE(inside.success) << inside.failure_label;
  EXPECT_EQ(inside.replay_hash, outside.replay_hash);
  EXPECT_EQ(inside.tracking_error_rms_m, outside.tracking_error_rms_m);
  EXPECT_EQ(again.replay_hash, outside.replay_hash);
}

TEST(OutsideWorldRollout, TheArmInAnotherProcessIsTheSameRolloutBitForBit) {
  const ForkedWorld process([](const std::string& path) { play(path, test::arm(), TAKT_WORLD_POINT, {}); });
  evidence::WorldProcess world(process.path(), kPatience);
  expect_same(test::setup(), world);
}

#ifdef TAKT_HAS_MUJOCO
TEST(OutsideWorldRollout, MujocoInAnotherProcessIsTheSameRolloutBitForBit) {
  Balancer balancer;
  const ForkedWorld process([&](const std::string& path) { play(path, balancer.robot, kEverything, {}); });
  evidence::WorldProcess world(process.path(), kPatience);
  expect_same(balancer.setup("none", 0), world);
  expect_same(balancer.setup("push", 20), world);
}

TEST(OutsideWorldRollout, WhatAWorldDoesNotGiveIsRefused) {
  Balancer balancer;
  const std::map<std::uint32_t, const char*> missing{
      {kEverything ^ TAKT_WORLD_BASE, "does not give the base's pose"},
      {kEverything ^ TAKT_WORLD_IMU, "gives no IMU's readings"},
      {kEverything ^ TAKT_WORLD_PUSH, "push: world forked does not push"},
  };
  for (const auto& [gives, says] : missing) {
    const ForkedWorld process([&](const std::string& path) { play(path, balancer.robot, gives, {}); });
    evidence::WorldProcess world(process.path(), kPatience);
    evidence::RolloutSetup setup = balancer.setup("push", 20);
    setup.world = &world;
    evidence::RolloutRow row;
    const auto done = evidence::run_rollout(setup, row);
    ASSERT_FALSE(done);
    EXPECT_THAT(done.error(), HasSubstr(says));
  }
}
#endif

// --- ends ---

struct End {
  const char* when;
  Spoil how;  // after the reset
  const char* label;
  const char* says;
};

bool is_late(const takt_world& world) {
  return world.kind == TAKT_WORLD_STEP && world.step.time_ns > 3'000'000'000;
}

TEST(OutsideWorldRollout, HowAWorldEndsIsHowTheRolloutEnds) {
  const std::vector<End> ends{
      {"hangs", [](const auto& w, auto&) { return !is_late(w) || pause() == 0; }, "world_hung", "in time"},
      {"dies", [](const auto& w, auto&) { return !is_late(w); }, "world_died", "went away"},
      {"says nonsense",
       [](const auto& w, auto& s) {
         if (is_late(w)) s.q[0] = NAN;
         return true;
       },
       "world_nonsense", "joint 0 at nan rad"},
      {"gives up",
       [](const auto& w, auto& s) {
         if (is_late(w)) s.outcome = TAKT_WORLD_UNABLE;
         return true;
       },
       "world_unable", "cannot go on"},
      {"loses",
       [](const auto& w, auto& s) {
         if (is_late(w)) s.outcome = TAKT_WORLD_FAILED;
         return true;
       },
       "failed", "beyond help"},
      {"is done",
       [](const auto& w, auto& s) {
         if (is_late(w)) s.outcome = TAKT_WORLD_SUCCEEDED;
         return true;
       },
       "", "the task is done"},
      {"dies at once", [](const auto&, auto&) { return false; }, "world_died", "went away"},
  };
  for (const End& end : ends) {
    const ForkedWorld process([&](const std::string& path) { play(path, test::arm(), TAKT_WORLD_POINT, end.how); });
    evidence::WorldProcess world(process.path(), kImpatience);
    evidence::RolloutSetup setup = test::setup();
    std::string sentence;
    setup.world = &world;
    setup.on_world_end = [&](const simulation::WorldEnd& ended) { sentence = ended.sentence; };
    const evidence::RolloutRow row = test::run(setup);
    EXPECT_EQ(row.failure_label, end.label) << end.when;
    EXPECT_EQ(row.success, row.failure_label.empty()) << end.when;
    EXPECT_THAT(sentence, HasSubstr(end.says)) << end.when;
    EXPECT_LT(row.ticks, 3'100U) << end.when;
    EXPECT_EQ(row.ticks > 2'900U, std::string_view(end.when) != "dies at once") << end.when;
  }
}

TEST(OutsideWorldRollout, WithoutAWorldThereIsNoRow) {
  evidence::WorldProcess nowhere("/tmp/takt-no-such-world.sock", {seconds(1), {milliseconds(50), milliseconds(50)}});
  evidence::RolloutSetup setup = test::setup();
  setup.world = &nowhere;
  evidence::RolloutRow row;
  const auto done = evidence::run_rollout(setup, row);
  ASSERT_FALSE(done);
  EXPECT_THAT(done.error(), HasSubstr("start the world first"));
  evidence::WorldProcess broken("exit 3 # {}", kPatience);
  setup.world = &broken;
  const auto ended = evidence::run_rollout(setup, row);
  ASSERT_FALSE(ended);
  EXPECT_THAT(ended.error(), HasSubstr("world `exit 3 # {}`: exited with 3 before it listened"));
}

TEST(OutsideWorldRollout, ItsOwnTaskNeedsAWorldThatPlaysThePolicysSensors) {
  evidence::RolloutSetup setup = test::setup();
  setup.task = evidence::Task::world;
  evidence::RolloutRow row;
  EXPECT_THAT(evidence::run_rollout(setup, row).error(),
              HasSubstr("needs sensor target, which the simulator does not play"));
  const ForkedWorld process([](const std::string& path) { play(path, test::arm(), TAKT_WORLD_ERROR, {}); });
  evidence::WorldProcess world(process.path(), kPatience);
  EXPECT_EQ(evidence::task_of(test::arm(), &world).value(), evidence::Task::world);
  setup.world = &world;
  EXPECT_THAT(evidence::run_rollout(setup, row).error(),
              HasSubstr("needs sensor target, which world forked does not play"));
}

// Keeps the last three numbers that it is shown: a command's.
class Listener final : public policy_host::Policy {
 public:
  explicit Listener(const config::RobotConfig& robot) : robot_(robot) {}
  [[nodiscard]] std::size_t input_size() const override { return config::observation_width(robot_); }
  [[nodiscard]] std::size_t output_size() const override { return config::output_width(robot_); }
  void infer(std::span<const float> input, std::span<float> output) override {
    heard.emplace(input.end() - 3, input.end());
    std::ranges::fill(output, 0.0F);
  }
  void reset() override {}
  std::set<std::vector<float>> heard;

 private:
  const config::RobotConfig& robot_;
};

TEST(OutsideWorldRollout, ASampleOfOneSensorIsNoCommandOfAsManyValues) {
  config::RobotConfig robot = test::arm();
  config::Sensor& wish = robot.sensors.emplace_back(robot.sensors.front());
  wish.name = "wish";
  wish.command = config::CommandLimits{{-9, -9, -9}, {9, 9, 9}, {4, 5, 6}};
  config::ObservationTerm& term = robot.policy->observation.emplace_back(robot.policy->observation.front());
  term = {};
  term.kind = config::TermKind::command;
  term.sensor = "wish";
  Listener listener(robot);
  evidence::RolloutSetup setup = test::setup();
  const evidence::RolloutSetup heard{.robot = robot,
                                     .policy = listener,
                                     .timing = {},
                                     .perturbation = {},
                                     .duration = setup.duration,
                                     .scored = setup.scored,
                                     .bound_m = setup.bound_m};
  (void)test::run(heard);
  EXPECT_EQ(listener.heard, (std::set<std::vector<float>>{{4, 5, 6}})) << "nobody says anything, and the camera sees";
}

}  // namespace
}  // namespace takt::lab

// SPDX-License-Identifier: Apache-2.0
// Goal: targets lie on the documented path at every instant. Method: known chunks, closed-form positions, and a check
// that slope and path agree.
#include "executive/pipeline/chunk_player.hpp"

#include <gtest/gtest.h>

#include <array>
#include <memory>

#include "tests/executive/pipeline/rig.hpp"

namespace takt::pipeline {
namespace {

constexpr MonoTime kStart{1'000'000'000};
constexpr std::uint8_t kPositionAndVelocity =
    static_cast<std::uint8_t>(CommandField::q) | static_cast<std::uint8_t>(CommandField::dq);

struct Player {
  TickConfig config = testing::robot(2);
  std::unique_ptr<CommandChunk> chunk =
      std::make_unique<CommandChunk>(testing::chunk_for(config, 1, kStart, kStart, 1, 0.0F, 4));
  std::array<JointTarget, kMaxJoints> targets{};

  void use(std::uint8_t fields, Interpolation interpolation) {
    chunk->header.fields = fields;
    config.interpolation = interpolation;
  }
  void set(CommandField field, std::size_t step, std::size_t joint, float value) {
    chunk->values[value_index(chunk->header, field, step, joint)] = value;
  }
  std::uint8_t at(Duration since) { return play({}, {*chunk, kStart}, kStart + since, config, targets); }
};

TEST(ChunkPlayer, PositionsFollowStraightLines) {
  Player player;
  for (std::size_t step = 0; step < 4; ++step)
    player.set(CommandField::q, step, 1, 0.1F * static_cast<float>(step * step));
  EXPECT_EQ(player.at(milliseconds(0)), 0);
  EXPECT_EQ(player.targets[1].q, 0.0F);
  EXPECT_EQ(player.at(milliseconds(15)), 1);
  EXPECT_NEAR(player.targets[1].q, 0.25F, 1e-6F);
  EXPECT_NEAR(player.targets[1].dq, 30.0F, 1e-4F);
  EXPECT_EQ(player.targets[0].q, 0.0F) << "the other joint";
}

TEST(ChunkPlayer, TheLastTargetIsHeldForItsPeriod) {
  Player player;
  player.set(CommandField::q, 3, 0, 0.5F);
  EXPECT_EQ(player.at(milliseconds(39)), 3);
  EXPECT_EQ(player.targets[0].q, 0.5F);
  EXPECT_EQ(player.targets[0].dq, 0.0F);
}

TEST(ChunkPlayer, AbsentFieldsTakeTheJointsDefaults) {
  Player player;
  player.at(milliseconds(5));
  EXPECT_EQ(player.targets[0].kp, player.config.joints[0].kp);
  EXPECT_EQ(player.targets[0].kd, player.config.joints[0].kd);
  EXPECT_EQ(player.targets[0].tau_ff, 0.0F);
}

TEST(ChunkPlayer, GainsAndTorqueAreInterpolated) {
  Player player;
  player.use(kAllCommandFields, Interpolation::cubic);
  for (std::size_t step = 0; step < 4; ++step) {
    player.set(CommandField::kp, step, 0, 100.0F);
    player.set(CommandField::kd, step, 0, static_cast<float>(step));
    player.set(CommandField::tau_ff, step, 0, 4.0F * static_cast<float>(step));
  }
  player.at(milliseconds(12));
  EXPECT_NEAR(player.targets[0].kp, 100.0F, 1e-4F);
  EXPECT_NEAR(player.targets[0].kd, 1.2F, 1e-5F);
  EXPECT_NEAR(player.targets[0].tau_ff, 4.8F, 1e-5F);
}

TEST(ChunkPlayer, WithVelocitiesThePathIsACubicThroughThem) {
  Player player;
  player.use(kPositionAndVelocity, Interpolation::cubic);
  const auto cubic = [](float t) { return 0.3F + 2.0F * t - 40.0F * t * t + 300.0F * t * t * t; };
  const auto slope = [](float t) { return 2.0F - 80.0F * t + 900.0F * t * t; };
  for (std::size_t step = 0; step < 4; ++step) {
    player.set(CommandField::q, step, 0, cubic(0.01F * static_cast<float>(step)));
    player.set(CommandField::dq, step, 0, slope(0.01F * static_cast<float>(step)));
  }
  for (int ms = 0; ms < 30; ++ms) {
    player.at(milliseconds(ms));
    EXPECT_NEAR(player.targets[0].q, cubic(0.001F * static_cast<float>(ms)), 1e-5F) << ms << " ms";
    EXPECT_NEAR(player.targets[0].dq, slope(0.001F * static_cast<float>(ms)), 1e-2F) << ms << " ms";
  }
}

TEST(ChunkPlayer, HeldStepsAreStairs) {
  Player player;
  player.use(kAllCommandFields, Interpolation::hold);
  player.targets[0].speed = player.config.joints[0].limits.velocity;
  for (std::size_t step = 0; step < 4; ++step) {
    player.set(CommandField::q, step, 0, 0.1F * static_cast<float>(step));
    player.set(CommandField::dq, step, 0, -0.5F * static_cast<float>(step));
    player.set(CommandField::kp, step, 0, 10.0F * static_cast<float>(step));
  }
  for (const int ms : {20, 25, 29}) {
    EXPECT_EQ(player.at(milliseconds(ms)), 2);
    EXPECT_EQ(player.targets[0].q, 0.2F) << ms << " ms";
    EXPECT_EQ(player.targets[0].dq, 0.0F) << "a stair has no slope";
    EXPECT_EQ(player.targets[0].dq_held, -1.0F) << "what the chunk says";
    EXPECT_EQ(player.targets[0].kp, 20.0F);
  }
  player.targets[0].speed = 0.25F;
  player.at(milliseconds(25));
  EXPECT_EQ(player.targets[0].dq_held, -0.25F) << "within the present speed limit";
  player.use(static_cast<std::uint8_t>(CommandField::q), Interpolation::hold);
  player.at(milliseconds(25));
  EXPECT_EQ(player.targets[0].dq_held, 0.0F) << "a chunk without velocities means none";
}

// Goal: what a policy says beyond a joint's range is brought into it, joint by joint, and marked where it was played.
TEST(ChunkPlayer, ValuesOutOfRangeAreBroughtIntoItAndMarked) {
  const auto played = [](CommandField field, float value, Interpolation interpolation) {
    Player player;
    player.use(kAllCommandFields, interpolation);
    player.config.joints[1].limits.target_margin = 0.1F;
    player.targets[1].speed = player.config.joints[1].limits.velocity;
    std::fill_n(player.chunk->values, player.chunk->value_count(), 0.0F);
    player.set(field, 2, 1, value);
    player.at(milliseconds(20));
    EXPECT_FALSE(player.targets[0].out_of_range) << "the other joint";
    return player.targets[1];
  };
  const JointLimits limits = testing::robot(2).joints[1].limits;
  for (const Interpolation how : {Interpolation::hold, Interpolation::cubic}) {
    EXPECT_FALSE(played(CommandField::q, limits.q_max + 0.09F, how).out_of_range) << "within target_margin";
    EXPECT_TRUE(played(CommandField::q, limits.q_max + 0.11F, how).out_of_range);
    EXPECT_EQ(played(CommandField::q, 1e5F, how).q, limits.q_max + 0.1F);
    EXPECT_EQ(played(CommandField::q, -1e5F, how).q, limits.q_min - 0.1F);
    EXPECT_TRUE(played(CommandField::kp, -0.1F, how).out_of_range);
    EXPECT_EQ(played(CommandField::kp, -0.1F, how).kp, 0.0F);
    EXPECT_FALSE(played(CommandField::kd, kGainTolerance * limits.kd_max, how).out_of_range);
    EXPECT_EQ(played(CommandField::kd, 1e5F, how).kd, kGainTolerance * limits.kd_max);
    EXPECT_EQ(played(CommandField::tau_ff, -1e5F, how).tau_ff, -limits.torque);
    EXPECT_TRUE(played(CommandField::dq, 1e5F, how).out_of_range);
  }
  EXPECT_EQ(played(CommandField::dq, 1e5F, Interpolation::hold).dq_held, limits.velocity);
}

TEST(ChunkPlayer, ASingleStepIsHeld) {
  Player player;
  player.chunk->header.step_count = 1;
  player.chunk->values[0] = 0.4F;
  EXPECT_EQ(player.at(milliseconds(9)), 0);
  EXPECT_EQ(player.targets[0].q, 0.4F);
}

}  // namespace
}  // namespace takt::pipeline

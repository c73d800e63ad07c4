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

struct Player {
  TickConfig config = testing::robot(2);
  std::unique_ptr<CommandChunk> chunk =
      std::make_unique<CommandChunk>(testing::chunk_for(config, 1, kStart, kStart, 1, 0.0F, 4));
  std::array<JointTarget, kMaxJoints> targets{};

  void use(std::uint8_t fields) { chunk->header.fields = fields; }
  void set(CommandField field, std::size_t step, std::size_t joint, float value) {
    chunk->values[value_index(chunk->header, field, step, joint)] = value;
  }
  std::uint8_t at(Duration since) { return play(*chunk, kStart, kStart + since, config, targets); }
};

TEST(ChunkPlayer, PositionsFollowStraightLines) {
  Player player;
  for (std::size_t step = 0; step < 4; ++step) player.set(CommandField::q, step, 1, static_cast<float>(step * step));
  EXPECT_EQ(player.at(milliseconds(0)), 0);
  EXPECT_EQ(player.targets[1].q, 0.0F);
  EXPECT_EQ(player.at(milliseconds(15)), 1);
  EXPECT_NEAR(player.targets[1].q, 2.5F, 1e-6F);
  EXPECT_NEAR(player.targets[1].dq, 300.0F, 1e-3F);
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
  player.use(kAllCommandFields);
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
  player.use(static_cast<std::uint8_t>(CommandField::q) | static_cast<std::uint8_t>(CommandField::dq));
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

TEST(ChunkPlayer, ASingleStepIsHeld) {
  Player player;
  player.chunk->header.step_count = 1;
  player.chunk->values[0] = 0.4F;
  EXPECT_EQ(player.at(milliseconds(9)), 0);
  EXPECT_EQ(player.targets[0].q, 0.4F);
}

}  // namespace
}  // namespace takt::pipeline

// SPDX-License-Identifier: Apache-2.0
// Goal: outputs become the right joint's target, and `last_action` is the output that is due. Method: distinct numbers
// per step and output, checked by their place in the chunk.
#include "policy_host/chunk_builder.hpp"

#include <gtest/gtest.h>

#include <numeric>

#include "tests/policy_host/small_robot.hpp"

namespace takt::policy_host {
namespace {

float q(const CommandChunk& chunk, std::size_t step, std::size_t joint) {
  return chunk.values[value_index(chunk.header, CommandField::q, step, joint)];
}

std::vector<float> counting(std::size_t count) {
  std::vector<float> values(count);
  std::iota(values.begin(), values.end(), 0.0F);
  return values;
}

TEST(ChunkBuilder, FillsTheShapeAndOnlyPositions) {
  CommandChunk chunk;
  chunk.header.sequence = 77;  // left over from another chunk
  ChunkBuilder(small_robot(), 0xABCD).fill(chunk, small_observation(9), counting(12));
  EXPECT_EQ(chunk.header.observation_id, 9U);
  EXPECT_EQ(chunk.header.policy_hash, 0xABCDU);
  EXPECT_EQ(chunk.header.step_period, milliseconds(10));
  EXPECT_EQ(chunk.header.step_count, 4);
  EXPECT_EQ(chunk.header.joint_count, 3);
  EXPECT_EQ(chunk.header.fields, static_cast<std::uint8_t>(CommandField::q));
  EXPECT_EQ(chunk.header.sequence, 0U);
  EXPECT_EQ(chunk.value_count(), 12U);
}

TEST(ChunkBuilder, AddsHomeAndScales) {
  auto robot = small_robot();
  robot.policy->action.scale = {1, 10, 100};
  CommandChunk chunk;
  ChunkBuilder(robot, 0).fill(chunk, small_observation(1), counting(12));
  EXPECT_FLOAT_EQ(q(chunk, 0, 0), 1 + 0);
  EXPECT_FLOAT_EQ(q(chunk, 0, 2), 3 + 100 * 2);
  EXPECT_FLOAT_EQ(q(chunk, 3, 1), 2 + 10 * 10);
}

TEST(ChunkBuilder, OffsetMayBeZeroOrGivenPerOutput) {
  auto robot = small_robot();
  robot.policy->action.offset = config::OffsetKind::zero;
  CommandChunk chunk;
  ChunkBuilder(robot, 0).fill(chunk, small_observation(1), counting(12));
  EXPECT_FLOAT_EQ(q(chunk, 1, 0), 3);
  robot.policy->action.offset = config::OffsetKind::values;
  robot.policy->action.offset_values = {0.5, 0.25, 0.125};
  ChunkBuilder(robot, 0).fill(chunk, small_observation(1), counting(12));
  EXPECT_FLOAT_EQ(q(chunk, 1, 2), 5.125);
}

TEST(ChunkBuilder, MapsOutputsToJointsAndKeepsTheOthersAtHome) {
  auto robot = small_robot();
  robot.policy->action.joint_of_output = {2, 0};
  robot.policy->action.offset = config::OffsetKind::values;
  robot.policy->action.offset_values = {100, 200};
  CommandChunk chunk;
  ChunkBuilder(robot, 0).fill(chunk, small_observation(1), counting(8));
  EXPECT_FLOAT_EQ(q(chunk, 1, 2), 100 + 2) << "first output drives joint 2, with its own offset";
  EXPECT_FLOAT_EQ(q(chunk, 1, 0), 200 + 3);
  EXPECT_FLOAT_EQ(q(chunk, 1, 1), 2) << "home";
}

float of(const CommandChunk& chunk, CommandField field, std::size_t step, std::size_t joint) {
  return chunk.values[value_index(chunk.header, field, step, joint)];
}

TEST(ChunkBuilder, MeasuredTargetsStartFromTheAnsweredObservation) {
  auto robot = small_robot();
  robot.policy->action.offset = config::OffsetKind::measured;
  robot.policy->action.joint_of_output = {2, 0};
  CommandChunk chunk;
  ChunkBuilder(robot, 0).fill(chunk, small_observation(1), counting(8));
  EXPECT_FLOAT_EQ(q(chunk, 1, 2), 3.5F + 2) << "the first output's joint was seen at 3.5";
  EXPECT_FLOAT_EQ(q(chunk, 1, 0), 1.5F + 3);
  EXPECT_FLOAT_EQ(q(chunk, 1, 1), 2) << "not driven: home";
}

TEST(ChunkBuilder, ACubicPathCarriesCentralDifferences) {
  auto robot = small_robot();
  robot.policy->action.interpolation = config::Interpolation::cubic;
  std::vector<float> outputs(12, 0.0F);
  for (std::size_t step = 0; step < 4; ++step) outputs[3 * step] = 0.01F * static_cast<float>(step * step);
  CommandChunk chunk;
  ChunkBuilder(robot, 0).fill(chunk, small_observation(1), outputs);
  EXPECT_NEAR(of(chunk, CommandField::dq, 0, 0), 1.0F, 1e-4F) << "10 ms apart";
  EXPECT_NEAR(of(chunk, CommandField::dq, 1, 0), 2.0F, 1e-4F);
  EXPECT_NEAR(of(chunk, CommandField::dq, 3, 0), 5.0F, 1e-4F);
  EXPECT_NEAR(of(chunk, CommandField::dq, 1, 1), 0.0F, 1e-4F);
}

TEST(ChunkBuilder, VelocitiesAndTorquesBringTheirGains) {
  auto robot = small_robot();
  for (config::Joint& joint : robot.joints) joint.kp = 100, joint.kd = 4;
  robot.policy->action.interpolation = config::Interpolation::hold;
  robot.policy->action.offset = config::OffsetKind::zero;
  robot.policy->action.joint_of_output = {2};
  CommandChunk chunk;
  robot.policy->action.kind = config::ActionKind::joint_velocity;
  ChunkBuilder(robot, 0).fill(chunk, small_observation(1), counting(4));
  EXPECT_FLOAT_EQ(of(chunk, CommandField::dq, 3, 2), 3);
  EXPECT_FLOAT_EQ(of(chunk, CommandField::kp, 3, 2), 0);
  EXPECT_FLOAT_EQ(of(chunk, CommandField::kd, 3, 2), 4);
  EXPECT_FLOAT_EQ(q(chunk, 3, 2), 3.5F);
  EXPECT_FLOAT_EQ(of(chunk, CommandField::kp, 3, 0), 100) << "not driven: held at home";
  EXPECT_FLOAT_EQ(q(chunk, 3, 0), 1);
  robot.policy->action.kind = config::ActionKind::joint_torque;
  ChunkBuilder(robot, 0).fill(chunk, small_observation(1), counting(4));
  EXPECT_FLOAT_EQ(of(chunk, CommandField::tau_ff, 2, 2), 2);
  EXPECT_FLOAT_EQ(of(chunk, CommandField::kp, 2, 2), 0);
  EXPECT_FLOAT_EQ(of(chunk, CommandField::kd, 2, 2), 0);
  EXPECT_FLOAT_EQ(of(chunk, CommandField::kd, 2, 1), 4);
}

// Goal: what a network says beside its action arrives as it is, at its joint and step. Method: an action of 4 steps for
// joints c and a, then velocities, stiffness, damping and torques, counted through.
TEST(ChunkBuilder, FurtherOutputsAreTakenAsTheyAre) {
  auto robot = small_robot();
  robot.policy->action.joint_of_output = {2, 0};
  robot.policy->action.interpolation = config::Interpolation::hold;
  robot.policy->action.velocity = "v";
  robot.policy->action.kp = "kp";
  robot.policy->action.kd = "kd";
  robot.policy->action.torque = "tau";
  robot.joints[1].kp = 60;
  robot.joints[1].kd = 2;
  CommandChunk chunk;
  ChunkBuilder(robot, 0).fill(chunk, small_observation(1), counting(5 * 4 * 2));
  EXPECT_EQ(chunk.header.fields, kAllCommandFields);
  const auto at = [&](CommandField field, std::size_t step, std::size_t joint) {
    return chunk.values[value_index(chunk.header, field, step, joint)];
  };
  EXPECT_EQ(at(CommandField::q, 1, 2), 3 + 2);  // home + output
  EXPECT_EQ(at(CommandField::dq, 0, 2), 8);
  EXPECT_EQ(at(CommandField::dq, 3, 0), 15);
  EXPECT_EQ(at(CommandField::kp, 1, 2), 18);
  EXPECT_EQ(at(CommandField::kd, 1, 0), 27);
  EXPECT_EQ(at(CommandField::tau_ff, 2, 2), 36);
  EXPECT_EQ(at(CommandField::kp, 2, 1), 60) << "no output drives it: its own gains";
  EXPECT_EQ(at(CommandField::kd, 2, 1), 2);
  EXPECT_EQ(at(CommandField::tau_ff, 2, 1), 0);
}

TEST(ChunkBuilder, VelocitiesOfItsOwnReplaceDifferences) {
  auto robot = small_robot();
  robot.policy->action.interpolation = config::Interpolation::cubic;
  robot.policy->action.velocity = "v";
  CommandChunk chunk;
  ChunkBuilder(robot, 0).fill(chunk, small_observation(1), counting(24));
  EXPECT_EQ(chunk.values[value_index(chunk.header, CommandField::dq, 0, 0)], 12);
}

TEST(LastAction, IsTheStepDueAtTheNextObservation) {
  LastAction last(*small_robot().policy, 3);
  const auto answered = small_observation(1);  // published at 20 ms
  const auto first_due_at = [&](std::int64_t us) { return last.due_at(MonoTime{} + microseconds(us))[0]; };
  EXPECT_EQ(first_due_at(40'000), 0.0F) << "nothing remembered";
  last.remember(answered, counting(12));
  EXPECT_EQ(first_due_at(20'000), 0.0F);
  EXPECT_EQ(first_due_at(30'000), 3.0F);
  EXPECT_EQ(first_due_at(39'950), 6.0F) << "the nearest step: the executive's period jitters";
  EXPECT_EQ(first_due_at(40'050), 6.0F);
  EXPECT_EQ(first_due_at(900'000), 9.0F) << "spent: the last step";
  EXPECT_EQ(first_due_at(0), 0.0F) << "time ran backwards: the first step";
  last.forget();
  EXPECT_EQ(first_due_at(40'000), 0.0F);
}

}  // namespace
}  // namespace takt::policy_host

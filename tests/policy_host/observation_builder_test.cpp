// SPDX-License-Identifier: Apache-2.0
// Goal: the network sees exactly the numbers, in exactly the order, that the robot file describes. Method: a
// three-joint robot whose input vector is worked out by hand, one property per test.
#include "policy_host/observation_builder.hpp"

#include <gtest/gtest.h>

#include <algorithm>
#include <array>
#include <cmath>

#include "tests/policy_host/small_robot.hpp"

namespace takt::policy_host {
namespace {

using config::TermKind;
using Values = std::vector<float>;

Values build(ObservationBuilder& builder, const Observation& observation, const SensorSample& sample,
             const Values& last_action) {
  const auto input = builder.build(observation, std::span(&sample, 1), last_action);
  return {input.begin(), input.end()};
}

TEST(ObservationBuilder, FollowsTheTermsInOrderWithTheirScales) {
  auto robot = small_robot();
  auto constant = term(TermKind::constant, 2);
  constant.constant = {7, 8};
  auto position = term(TermKind::joint_position, 1);
  position.scale = {1, 10, 100};
  robot.policy->observation = {constant,
                               term(TermKind::joint_velocity, 0.1),
                               position,
                               term(TermKind::joint_position_relative, 2),
                               term(TermKind::last_action, 3),
                               term(TermKind::sensor, -1)};
  ObservationBuilder builder(robot);
  EXPECT_EQ(builder.input_size(), 2U + 3U + 3U + 3U + 3U + 2U);
  const Values input = build(builder, small_observation(1), small_sample(1, 5, 6), {0.1F, 0.2F, 0.3F});
  const Values expected{14, 16, 1, 2, 3, 1.5F, 25, 350, 1, 1, 1, 0.3F, 0.6F, 0.9F, -5, -6};
  ASSERT_EQ(input.size(), expected.size());
  for (std::size_t i = 0; i < expected.size(); ++i) EXPECT_FLOAT_EQ(input[i], expected[i]) << "value " << i;
}

TEST(ObservationBuilder, JointOrderSelectsAndPermutes) {
  auto robot = small_robot();
  robot.policy->joint_order = {2, 0};
  robot.policy->observation = {term(TermKind::joint_velocity, 1)};
  ObservationBuilder builder(robot);
  EXPECT_EQ(build(builder, small_observation(1), {}, {}), (Values{30, 10}));
}

TEST(ObservationBuilder, FirstValueFillsTheHistoryAndTheNewestComesLast) {
  auto robot = small_robot();
  robot.policy->observation = {term(TermKind::last_action, 1, 3)};
  ObservationBuilder builder(robot);
  EXPECT_EQ(build(builder, small_observation(1), {}, {1, 1, 1}), (Values{1, 1, 1, 1, 1, 1, 1, 1, 1}));
  EXPECT_EQ(build(builder, small_observation(2), {}, {2, 2, 2}), (Values{1, 1, 1, 1, 1, 1, 2, 2, 2}));
  EXPECT_EQ(build(builder, small_observation(3), {}, {3, 3, 3}), (Values{1, 1, 1, 2, 2, 2, 3, 3, 3}));
  builder.reset();
  EXPECT_EQ(build(builder, small_observation(4), {}, {4, 4, 4}), (Values{4, 4, 4, 4, 4, 4, 4, 4, 4}));
}

TEST(ObservationBuilder, SensorHistoryGrowsPerSampleNotPerObservation) {
  auto robot = small_robot();
  robot.policy->observation = {term(TermKind::sensor, 1, 2)};
  ObservationBuilder builder(robot);
  EXPECT_EQ(build(builder, small_observation(1), small_sample(5, 1, 2), {}), (Values{1, 2, 1, 2}));
  EXPECT_EQ(build(builder, small_observation(2), small_sample(6, 3, 4), {}), (Values{1, 2, 3, 4}));
  EXPECT_EQ(build(builder, small_observation(3), small_sample(6, 3, 4), {}), (Values{1, 2, 3, 4}));
  EXPECT_EQ(build(builder, small_observation(4), small_sample(7, 5, 6), {}), (Values{3, 4, 5, 6}));
  // The sensor's process restarted: its sequences start over, its samples are still news.
  EXPECT_EQ(build(builder, small_observation(5), small_sample(1, 7, 8), {}), (Values{5, 6, 7, 8}));
}

TEST(ObservationBuilder, ByTimeInterleavesTheTermsOfAnInstant) {
  auto robot = small_robot();
  robot.policy->observation = {term(TermKind::joint_velocity, 1, 2), term(TermKind::last_action, 1, 2)};
  robot.policy->joint_order = {0};
  robot.policy->action.joint_of_output = {0};
  auto second = small_observation(2);
  second.dq[0] = 11;
  {
    ObservationBuilder builder(robot);
    build(builder, small_observation(1), {}, {1});
    EXPECT_EQ(build(builder, second, {}, {2}), (Values{10, 11, 1, 2}));
  }
  robot.policy->history_layout = "by_time";
  ObservationBuilder builder(robot);
  build(builder, small_observation(1), {}, {1});
  EXPECT_EQ(build(builder, second, {}, {2}), (Values{10, 1, 11, 2}));
}

TEST(ObservationBuilder, BaseTermsComeFromTheImu) {
  auto robot = small_robot();
  robot.policy->observation = {term(TermKind::base_angular_velocity, 0.2), term(TermKind::projected_gravity, 1)};
  ObservationBuilder builder(robot);
  Observation observation = small_observation(1);
  const float rolled[] = {std::cos(0.25F), std::sin(0.25F), 0, 0}, turning[] = {1, 2, 3};
  std::ranges::copy(rolled, observation.imu.rotation);
  std::ranges::copy(turning, observation.imu.angular_velocity);
  const Values input = build(builder, observation, {}, {});
  const Values expected{0.2F, 0.4F, 0.6F, 0, -std::sin(0.5F), -std::cos(0.5F)};
  ASSERT_EQ(input.size(), expected.size());
  for (std::size_t i = 0; i < expected.size(); ++i) EXPECT_NEAR(input[i], expected[i], 1e-6) << "value " << i;
}

TEST(ObservationBuilder, OrientationStandsInTheOrderThatIsDeclared) {
  auto robot = small_robot();
  robot.policy->observation = {term(TermKind::base_orientation, 1), term(TermKind::base_orientation, 1)};
  robot.policy->observation[1].order = config::QuaternionOrder::xyzw;
  ObservationBuilder builder(robot);
  Observation observation = small_observation(1);
  const float rotation[] = {0.1F, 0.2F, 0.3F, 0.4F};  // w x y z
  std::ranges::copy(rotation, observation.imu.rotation);
  EXPECT_EQ(build(builder, observation, {}, {}), (Values{0.1F, 0.2F, 0.3F, 0.4F, 0.2F, 0.3F, 0.4F, 0.1F}));
}

TEST(ObservationBuilder, DrivesOwnWordsOfTheTermsOwnJoints) {
  auto robot = small_robot();
  robot.policy->joint_order = {0, 1, 2};
  robot.policy->observation = {term(TermKind::joint_torque, 1), term(TermKind::drive_velocity, 1),
                               term(TermKind::joint_velocity, 1)};
  robot.policy->observation[1].joints = {2, 0};
  ObservationBuilder builder(robot);
  EXPECT_EQ(builder.input_size(), 8U);
  Observation observation = small_observation(1);
  for (std::size_t i = 0; i < 3; ++i) {
    observation.tau[i] = static_cast<float>(i) - 1;
    observation.dq_of_drive[i] = observation.dq[i] + 0.5F;
  }
  EXPECT_EQ(build(builder, observation, {}, {}), (Values{-1, 0, 1, 30.5F, 10.5F, 10, 20, 30}));
}

// (scale * clipped - mean) / standard deviation; not a number stays one, whatever the clip.
TEST(ObservationBuilder, ClipsScalesAndNormalisesInThisOrder) {
  auto robot = small_robot();
  auto velocity = term(TermKind::joint_velocity, 0.1);
  velocity.clip = {-15, 25};
  velocity.mean = {1, 1, 0.5};
  velocity.standard_deviation = {0.5};
  robot.policy->observation = {velocity};
  ObservationBuilder builder(robot);
  const Values input = build(builder, small_observation(1), {}, {});  // 10, 20, 30 clipped to 25
  const Values expected{0, 2, 4};
  for (std::size_t i = 0; i < 3; ++i) EXPECT_NEAR(input[i], expected[i], 1e-6) << "value " << i;
  Observation broken = small_observation(2);
  broken.dq[1] = std::nanf("");
  EXPECT_TRUE(std::isnan(build(builder, broken, {}, {})[1]));
}

TEST(ObservationBuilder, AHistoryMayBeginWithTheNewest) {
  auto robot = small_robot();
  robot.policy->observation = {term(TermKind::last_action, 1, 3), term(TermKind::constant, 1, 3)};
  robot.policy->observation[1].constant = {7};
  robot.policy->action.joint_of_output = {0};
  for (const auto& [layout, expected] :
       {std::pair{"by_term", Values{3, 2, 1, 7, 7, 7}}, std::pair{"by_time", Values{3, 7, 2, 7, 1, 7}}}) {
    robot.policy->history_layout = layout;
    robot.policy->history_order = "newest_first";
    ObservationBuilder builder(robot);
    build(builder, small_observation(1), {}, {1});
    build(builder, small_observation(2), {}, {2});
    EXPECT_EQ(build(builder, small_observation(3), {}, {3}), expected) << layout;
  }
}

TEST(ObservationBuilder, ACommandIsRememberedPerObservationAlsoWhileItIsTheSame) {
  auto robot = small_robot();
  auto wish = term(TermKind::command, 1, 3);
  wish.sensor = "eye";
  robot.policy->observation = {wish};
  ObservationBuilder builder(robot);
  build(builder, small_observation(1), small_sample(1, 1, 2), {});
  build(builder, small_observation(2), small_sample(2, 3, 4), {});
  EXPECT_EQ(build(builder, small_observation(3), small_sample(2, 3, 4), {}), (Values{1, 2, 3, 4, 3, 4}));
}

// Goal: pixels land where a network of the declared layout looks for them, and nowhere else. Method: an image of 2 x 3
// pixels of two channels, all bytes different.
class SeenImage : public testing::Test {
 protected:
  SeenImage() {
    robot.sensors[0] = {.name = "eye", .timeout = milliseconds(200), .image = config::ImageShape{2, 3, 2}};
    robot.policy->observation = {term(TermKind::sensor, 1)};
  }
  Values build(ObservationBuilder& builder, std::uint64_t sequence, const std::vector<std::uint8_t>& shown) {
    SensorSample sample;
    sample.sequence = sequence;
    sample.published_at = published;
    const std::array<std::span<const std::uint8_t>, 1> images{shown};
    const auto input = builder.build(small_observation(1), std::span(&sample, 1), {}, images);
    return {input.begin(), input.end()};
  }
  // As shares of 255.
  static void expect(const Values& input, const std::vector<float>& bytes) {
    ASSERT_EQ(input.size(), bytes.size());
    for (std::size_t i = 0; i < bytes.size(); ++i) EXPECT_FLOAT_EQ(input[i], bytes[i] / 255) << "value " << i;
  }
  config::RobotConfig robot = small_robot();
  MonoTime published;
  const std::vector<std::uint8_t> image{10, 110, 20, 120, 30, 130, 40, 140, 50, 150, 60, 255};
};

TEST_F(SeenImage, ChannelAfterChannelOrPixelAfterPixel) {
  ObservationBuilder by_channel(robot);
  EXPECT_EQ(by_channel.input_size(), 12U);
  expect(build(by_channel, 1, image), {10, 20, 30, 40, 50, 60, 110, 120, 130, 140, 150, 255});
  robot.policy->observation[0].layout = config::ImageLayout::hwc;
  ObservationBuilder by_pixel(robot);
  expect(build(by_pixel, 1, image), {10, 110, 20, 120, 30, 130, 40, 140, 50, 150, 60, 255});
}

TEST_F(SeenImage, IsClippedScaledAndNormalisedByChannel) {
  config::ObservationTerm& seen = robot.policy->observation[0];
  seen.clip = {0, 0.5};
  seen.scale = {1, 2};
  seen.mean = {0.1, 0.2};
  seen.standard_deviation = {0.5, 4};
  ObservationBuilder builder(robot);
  const Values input = build(builder, 1, image);
  EXPECT_FLOAT_EQ(input[0], (10 / 255.0F - 0.1F) / 0.5F);
  EXPECT_FLOAT_EQ(input[6], (2 * 110 / 255.0F - 0.2F) / 4);
  EXPECT_FLOAT_EQ(input[11], (2 * 0.5F - 0.2F) / 4) << "clipped before the scale";
}

// Stacked channels, as networks of several frames take them.
TEST_F(SeenImage, HistoryHoldsDistinctImagesOneAfterTheOther) {
  robot.policy->observation[0].history = 2;
  ObservationBuilder builder(robot);
  expect(build(builder, 1, std::vector<std::uint8_t>(12, 1)), std::vector<float>(24, 1));
  Values input = build(builder, 2, std::vector<std::uint8_t>(12, 2));
  EXPECT_FLOAT_EQ(input[11], 1 / 255.0F);
  EXPECT_FLOAT_EQ(input[12], 2 / 255.0F);
  input = build(builder, 2, std::vector<std::uint8_t>(12, 9));
  EXPECT_FLOAT_EQ(input[12], 2 / 255.0F) << "the same sample once more";
  published = MonoTime{} + seconds(1);
  input = build(builder, 2, std::vector<std::uint8_t>(12, 3));
  EXPECT_FLOAT_EQ(input[12], 3 / 255.0F) << "of a camera that started anew and counts from there";
}

TEST(ObservationBuilder, TheGaitBeginsWithEveryReset) {
  auto robot = small_robot();
  robot.policy->observation = {term(TermKind::gait_phase, 1)};
  robot.policy->observation[0].gait_period = milliseconds(80);
  ObservationBuilder builder(robot);
  const auto expect_phase = [&](std::uint64_t id, float sine, float cosine) {
    const Values input = build(builder, small_observation(id), {}, {});
    ASSERT_EQ(input.size(), 2U);
    EXPECT_NEAR(input[0], sine, 1e-6) << id;
    EXPECT_NEAR(input[1], cosine, 1e-6) << id;
  };
  expect_phase(3, 0, 1);
  expect_phase(4, 1, 0);  // 20 ms later
  expect_phase(6, 0 - 1.0F, 0);
  expect_phase(7, 0, 1);
  builder.reset();
  expect_phase(8, 0, 1);
}

}  // namespace
}  // namespace takt::policy_host

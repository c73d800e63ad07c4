// SPDX-License-Identifier: Apache-2.0
// Goal: a message of ROS 2 becomes the sample that the robot file describes, or none; and its stamp never makes it
// younger than its arrival. Method: messages as idlc's structures, by hand.
#include "sensors/ros/ros_sample.hpp"

#include <gtest/gtest.h>

#include <string>
#include <vector>

#include "sensors/ros/ros_stamp.hpp"

namespace takt::sensors {
namespace {

constexpr std::int64_t kUnix = 1'700'000'000'000'000'000;
constexpr MonoTime kArrived{5'000'000'000};
constexpr Arrival kArrival{kArrived, kUnix};

// Both stamps of a message.
SensedAt of(std::int64_t header_unix_ns, std::int64_t source_unix_ns = kUnix) {
  return SenderClock().take({header_unix_ns, source_unix_ns}, kArrival);
}

TEST(RosStamp, IsNeverYoungerThanTheArrival) {
  EXPECT_EQ(of(kUnix - 3'000'000).at, kArrived - milliseconds(3)) << "this machine's clock";
  EXPECT_EQ(of(kUnix).at, kArrived);
  const SensedAt ahead = of(kUnix + 40'000'000);
  EXPECT_EQ(ahead.at, kArrived) << "a clock that is ahead";
  EXPECT_EQ(ahead.ahead, milliseconds(40));
  EXPECT_EQ(of(kUnix - 1'000'000'000).at, kArrived - seconds(1)) << "a clock that is behind";
}

TEST(RosStamp, WithoutOneTheWritersOwnStandsIn) {
  for (const std::int64_t none : {0, -5}) {
    EXPECT_EQ(of(none, kUnix - 3'000'000'000).at, kArrived - seconds(3));
    const SensedAt ahead = of(none, kUnix + 40'000'000);
    EXPECT_EQ(ahead.at, kArrived);
    EXPECT_EQ(ahead.ahead, milliseconds(40));
    EXPECT_EQ(of(none, 0).at, kArrived) << "nor has DDS one";
  }
  EXPECT_EQ(of(kUnix - 3'000'000, kUnix - 3'000'000'000).at, kArrived - milliseconds(3)) << "the header has one";
}

// Taken 300 ms after the wait began, 280 ms late, by clocks of which one is ahead by 10 s.
TEST(RosStamp, OneThatWaitedIsAsOldAsItsSendersClockSaysSinceTheOneBefore) {
  constexpr std::int64_t kAhead = kUnix + 10'000'000'000;
  constexpr std::int64_t kTenMs = 10'000'000;
  const auto late = [](std::int64_t stamp, SenderClock& sender) {
    return kArrived + milliseconds(300) - sender.take({0, stamp}, {{kArrived + milliseconds(300), kArrived}, kUnix}).at;
  };
  SenderClock sender;
  (void)sender.take({0, kAhead}, kArrival);
  EXPECT_EQ(late(kAhead + 2 * kTenMs, sender), milliseconds(280) - microseconds(10));
  SenderClock fresh;
  EXPECT_EQ(late(kAhead, fresh), milliseconds(300)) << "the first";
  SenderClock set_back;
  (void)set_back.take({0, kAhead}, kArrival);
  EXPECT_EQ(late(kUnix, set_back), milliseconds(300)) << "a clock that was set back";
  SenderClock set_on;
  (void)set_on.take({0, kUnix}, kArrival);
  EXPECT_EQ(late(kAhead, set_on), milliseconds(300)) << "and one that was set on";
}

TEST(RosStamp, AnAncientOneIsAsOldAsCanBe) {
  const MonoTime ancient = of(12'000'000'000).at;
  EXPECT_TRUE(ancient.is_set());
  EXPECT_LT(ancient, kArrived - seconds(4)) << "the clock of a simulation";
}

config::Sensor camera() {
  config::Sensor sensor;
  sensor.name = "cam0";
  sensor.image = config::ImageShape{.height = 2, .width = 2, .channels = 3};
  sensor.ros = config::RosTopic{.topic = "/camera",
                                .type = config::RosType::image,
                                .encoding = config::RosEncoding::rgb8,
                                .quantity = {},
                                .joints = {}};
  return sensor;
}

class AnImage : public testing::Test {
 protected:
  AnImage() {
    for (std::size_t i = 0; i < pixels_.size(); ++i) pixels_[i] = static_cast<std::uint8_t>(i);
    message_.height = message_.width = 2;
    message_.encoding = encoding_.data();
    message_.step = 8;  // two bytes of padding
    message_.data._buffer = pixels_.data();
    message_.data._length = static_cast<std::uint32_t>(pixels_.size());
  }
  RosResult take() { return take_image(message_, camera(), taken_); }
  std::string encoding_ = "rgb8";
  std::vector<std::uint8_t> pixels_ = std::vector<std::uint8_t>(16);
  sensor_msgs_msg_dds__Image_ message_{};
  std::vector<std::byte> taken_ = std::vector<std::byte>(12);
};

TEST_F(AnImage, LosesItsPadding) {
  ASSERT_TRUE(take());
  const std::vector<std::uint8_t> wanted{0, 1, 2, 3, 4, 5, 8, 9, 10, 11, 12, 13};
  for (std::size_t i = 0; i < wanted.size(); ++i) EXPECT_EQ(std::to_integer<int>(taken_[i]), wanted[i]);
  message_.data._length = 14;  // the last row needs no padding
  EXPECT_TRUE(take());
}

TEST_F(AnImage, OfAnotherKindIsRefused) {
  message_.data._length = 13;
  EXPECT_EQ(take().error(), "an image of 13 bytes in rows of 8, for 2 x 2 x 3");
  message_.data._length = 16;
  message_.step = 5;
  EXPECT_FALSE(take());
  message_.step = 8;
  message_.height = 0xFFFF'FFFF;
  EXPECT_EQ(take().error(), "images are 4294967295 x 2, the robot file says 2 x 2");
  message_.height = 2;
  encoding_ = "bgr8";
  message_.encoding = encoding_.data();
  EXPECT_EQ(take().error(), "images are bgr8, the robot file says rgb8");
  message_.encoding = nullptr;
  EXPECT_FALSE(take());
}

config::Sensor values_of(config::RosType type, std::uint32_t values) {
  config::Sensor sensor;
  sensor.name = "torso";
  sensor.values = values;
  sensor.ros = config::RosTopic{.topic = "/x", .type = type, .encoding = {}, .quantity = {}, .joints = {}};
  return sensor;
}

TEST(AnImu, PutsTheQuaternionsWFirst) {
  sensor_msgs_msg_dds__Imu_ message{};
  message.orientation = {.x = 0.1, .y = 0.2, .z = 0.3, .w = 0.9};
  message.angular_velocity = {.x = 1, .y = 2, .z = 3};
  message.linear_acceleration = {.x = 4, .y = 5, .z = 9.81};
  RosValues values;
  ASSERT_TRUE(take(message, values_of(config::RosType::imu, 10), values));
  ASSERT_EQ(values.count, 10U);
  const std::vector<float> wanted{0.9F, 0.1F, 0.2F, 0.3F, 1, 2, 3, 4, 5, 9.81F};
  for (std::size_t i = 0; i < wanted.size(); ++i) EXPECT_EQ(values.at[i], wanted[i]);
  message.orientation_covariance[0] = -1;
  RosValues none;
  EXPECT_FALSE(take(message, values_of(config::RosType::imu, 10), none)) << "it says that it has no orientation";
}

TEST(AJointState, GivesTheNamedJointsInTheFilesOrder) {
  std::string a = "a", b = "b", c = "c";
  std::vector<char*> names{c.data(), a.data(), b.data()};
  std::vector<double> positions{3, 1, 2};
  sensor_msgs_msg_dds__JointState_ message{};
  message.name._buffer = names.data();
  message.name._length = 3;
  message.position._buffer = positions.data();
  message.position._length = 3;
  config::Sensor sensor = values_of(config::RosType::joint_state, 2);
  sensor.ros->joints = {{"a"}, {"c"}};
  RosValues values;
  ASSERT_TRUE(take(message, sensor, values));
  EXPECT_EQ(values.count, 2U);
  EXPECT_EQ(values.at[0], 1);
  EXPECT_EQ(values.at[1], 3);
  sensor.ros->joints = {{"d"}};
  RosValues none;
  EXPECT_EQ(take(message, sensor, none).error(), "a JointState without joint d");
  sensor.ros->quantity = config::RosQuantity::effort;
  EXPECT_EQ(take(message, sensor, none).error(), "a JointState of 3 joints has 0 values of effort");
}

TEST(ATwist, IsPlanarForThreeValues) {
  geometry_msgs_msg_dds__Twist_ message{};
  message.linear = {.x = 1, .y = 2, .z = 3};
  message.angular = {.x = 4, .y = 5, .z = 6};
  RosValues planar, whole;
  ASSERT_TRUE(take(message, values_of(config::RosType::twist, 3), planar));
  ASSERT_TRUE(take(message, values_of(config::RosType::twist, 6), whole));
  EXPECT_EQ(std::vector(planar.at.begin(), planar.at.begin() + 3), (std::vector<float>{1, 2, 6}));
  EXPECT_EQ(std::vector(whole.at.begin(), whole.at.begin() + 6), (std::vector<float>{1, 2, 3, 4, 5, 6}));
}

}  // namespace
}  // namespace takt::sensors

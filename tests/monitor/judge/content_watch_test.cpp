// SPDX-License-Identifier: Apache-2.0
// Goal: wrong content is found by what came before, and rest, commands of persons and fast motion are not taken for it.
// Method: samples, images, commands and ticks made by hand.
#include "monitor/judge/content_watch.hpp"

#include <gtest/gtest.h>

#include <algorithm>
#include <cmath>
#include <numbers>

namespace takt::monitor {
namespace {

// Samples every 20 ms, commands with every second tick, of six joints.
class Watched {
 public:
  WrongContent found;

  void sample(std::vector<float> values, std::size_t sensor = 0) { watch_.sample(sensor, ++sequence_, next(), values); }
  void image(const std::string& content) { watch_.image(0, ++sequence_, next(), content); }
  void path(int from, int to, double step = 0.01) {
    for (int at = from; at < to; ++at) sample(at_path(at, step));
  }
  static std::vector<float> at_path(int at, double step = 0.01) {
    return {static_cast<float>(0.5 + step * at), static_cast<float>(0.3 + 0.5 * step * at)};
  }
  void ask(const std::vector<float>& targets) {
    CommandHeader header{};
    header.joint_count = static_cast<std::uint16_t>(targets.size());
    header.step_count = 1;
    header.fields = static_cast<std::uint8_t>(CommandField::q);
    watch_.command(header, targets);
    tick(Arrival::accepted);
  }
  void tick(Arrival arrival = Arrival::none) {
    record.header.seats[Seat::policy].arrival = arrival;
    found.take(watch_.tick(record));
  }
  void stand_at(const std::vector<float>& q) {
    record.header.joint_count = static_cast<std::uint32_t>(q.size());
    for (std::size_t joint = 0; joint < q.size(); ++joint) record.joints[joint].feedback.q = q[joint];
  }

  TickRecord record{};

 private:
  MonoTime next() {
    tick();
    return now_ = now_ + milliseconds(20);
  }
  ContentWatch watch_{{.sensors = {{.name = "target"}, {.name = "stick", .is_watched = false}}, .imu = {}}};
  std::uint64_t sequence_ = 0;
  MonoTime now_{1'000'000'000};
};

const std::vector<float> kPose{0.1F, -0.8F, 1.2F, 0.4F, -0.3F, 0.9F};
std::vector<float> moved(std::vector<float> pose, double by) {
  for (std::size_t joint = 0; joint < pose.size(); ++joint)
    pose[joint] += static_cast<float>(by * std::sin(static_cast<double>(joint)));
  return pose;
}
std::vector<float> shifted(const std::vector<float>& pose) {
  std::vector<float> made = pose;
  std::ranges::rotate(made, made.begin() + 1);
  return made;
}

TEST(ContentWatch, ValuesThatStandAndThenJumpWereFrozen) {
  Watched robot;
  robot.path(0, 50);
  for (int i = 0; i < 25; ++i) robot.sample(Watched::at_path(49));
  EXPECT_FALSE(robot.found.is_trouble) << "they may rest";
  robot.path(75, 80);
  robot.tick();
  EXPECT_EQ(robot.found.frozen_samples, 25U);
  EXPECT_EQ(robot.found.sensor, 0U);
}

TEST(ContentWatch, RestAndGoalsAndCommandsOfPersonsAreNotFrozen) {
  Watched resting;
  resting.path(0, 50);
  for (int i = 0; i < 25; ++i) resting.sample(Watched::at_path(49));
  resting.path(50, 80);
  resting.tick();
  EXPECT_FALSE(resting.found.is_trouble) << "it went on from where it was";
  Watched goals;
  for (int goal = 0; goal < 50; ++goal)
    for (int i = 0; i < 30; ++i) goals.sample({static_cast<float>(goal % 7), 1.0F});
  goals.tick();
  EXPECT_FALSE(goals.found.is_trouble);
  Watched person;
  for (int at = 0; at < 50; ++at) person.sample(Watched::at_path(at), 1);
  for (int i = 0; i < 25; ++i) person.sample(Watched::at_path(49), 1);
  person.sample({9, 9}, 1);
  person.tick();
  EXPECT_FALSE(person.found.is_trouble);
}

TEST(ContentWatch, AnImageThatStaysWhileTheRobotMovesWasFrozen) {
  Watched robot;
  robot.stand_at(kPose);
  for (int frame = 0; frame < 50; ++frame) robot.image("frame " + std::to_string(frame));
  for (int i = 0; i < 20; ++i) robot.image("frame 49");
  robot.tick();
  EXPECT_FALSE(robot.found.is_trouble) << "a still scene before a robot at rest";
  robot.stand_at(moved(kPose, 0.2));
  for (int i = 0; i < 20; ++i) robot.image("frame 49");
  robot.tick();
  EXPECT_GE(robot.found.frozen_samples, 5U);
}

TEST(ContentWatch, ValuesThatSayTheOppositeAreMirrored) {
  Watched robot;
  robot.path(0, 50);
  for (int at = 50; at < 60; ++at) {
    std::vector<float> values = Watched::at_path(at);
    if (at % 2 == 0)
      for (float& value : values) value = -value;
    robot.sample(values);
  }
  robot.tick();
  EXPECT_EQ(robot.found.mirrored_samples, 10U);
  EXPECT_TRUE(robot.found.is_trouble);
  EXPECT_EQ(robot.found.frozen_samples, 0U);
}

TEST(ContentWatch, AHeadingAtItsHalfTurnAndAQuaternionHaveAnEqualOpposite) {
  Watched heading;
  for (int at = 0; at < 100; ++at) {
    const double turn = std::numbers::pi + 0.002 * at - 0.1;
    heading.sample({static_cast<float>(std::remainder(turn + (at > 50 ? 0.05 * (at % 2) : 0), 2 * std::numbers::pi))});
  }
  heading.tick();
  EXPECT_FALSE(heading.found.is_trouble);
  Watched turning;
  for (int at = 0; at < 100; ++at) {
    const float sign = at > 40 && at % 2 == 0 ? -1.0F : 1.0F;
    turning.sample(
        {sign * static_cast<float>(std::cos(0.01 * at)), sign * static_cast<float>(std::sin(0.01 * at)), 0, 0});
  }
  turning.tick();
  EXPECT_FALSE(turning.found.is_trouble);
}

TEST(ContentWatch, JointsThatTakeOneAnothersTargetsAreReordered) {
  Watched robot;
  robot.stand_at(kPose);
  robot.tick();
  robot.record.header.mode = Mode::tracking;
  for (int k = 0; k < 50; ++k) robot.ask(moved(kPose, 0.01 * k));
  EXPECT_FALSE(robot.found.is_trouble);
  for (int k = 0; k < 10; ++k) {
    robot.found = {};
    robot.ask(shifted(moved(kPose, 0.5 + 0.01 * k)));
    EXPECT_EQ(robot.found.reordered_joints, 6U) << k;
  }
  robot.ask(moved(kPose, 0.6));
  robot.found = {};
  for (int k = 0; k < 10; ++k) robot.ask(moved(kPose, 0.6 + 0.01 * k));
  EXPECT_FALSE(robot.found.is_trouble) << "the order is right again";
}

TEST(ContentWatch, APolicyThatBeginsWithAnotherOrderIsToldByTheMeasuredPositions) {
  Watched robot;
  robot.stand_at(kPose);
  robot.tick();
  robot.record.header.mode = Mode::tracking;
  robot.ask(shifted(moved(kPose, 0.01)));
  EXPECT_EQ(robot.found.reordered_joints, 6U);
  Watched right;
  right.stand_at(kPose);
  right.tick();
  right.record.header.mode = Mode::tracking;
  right.ask(moved(kPose, 0.2));
  EXPECT_FALSE(right.found.is_trouble);
}

TEST(ContentWatch, AFastMotionAndJointsThatStandAlikeAreNot) {
  Watched walking;  // left and right legs exchange their targets, step by step
  walking.record.header.mode = Mode::tracking;
  for (int k = 0; k < 400; ++k) {
    const auto swing = static_cast<float>(0.6 * std::sin(0.3 * k));
    walking.ask({swing, -swing, 0.5F * swing, -0.5F * swing, 0.1F, 0.1F});
  }
  EXPECT_FALSE(walking.found.is_trouble);
  Watched alike;
  alike.record.header.mode = Mode::tracking;
  for (int k = 0; k < 40; ++k) alike.ask({0.5F, 0.5F, 0.5F, 0.5F, 0.5F, 0.51F});
  alike.ask({0.51F, 0.5F, 0.5F, 0.5F, 0.5F, 0.5F});
  EXPECT_FALSE(alike.found.is_trouble);
  Watched jumping;  // one joint, to where others stand
  jumping.record.header.mode = Mode::tracking;
  for (int k = 0; k < 40; ++k) jumping.ask({0, 0.1F, 0.2F, 0.3F, 0.4F, 0.5F});
  jumping.ask({0.5F, 0.1F, 0.2F, 0.3F, 0.4F, 0.5F});
  EXPECT_FALSE(jumping.found.is_trouble);
}

}  // namespace
}  // namespace takt::monitor

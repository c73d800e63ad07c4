// SPDX-License-Identifier: Apache-2.0
// Goal: a sensor's samples arrive when its process is there, and their absence, age and size are noticed. Method: a
// real rendezvous server with a real mailbox, started, stopped and started again; time is passed in.
#include "policy_host/sensor_link.hpp"

#include <gtest/gtest.h>

#include <cmath>
#include <cstring>
#include <span>
#include <vector>

#include "executive/contract/image_sample.hpp"
#include "tests/policy_host/fake_server.hpp"
#include "tests/policy_host/small_robot.hpp"
#include "tests/support/temporary_directory.hpp"

namespace takt::policy_host {
namespace {

Hello reader_hello() {
  Hello hello;
  hello.role = Role::sensor_reader;
  hello.layout = contract_layout();
  return hello;
}

TEST(SensorLink, AttachesReadsAndAttachesAgain) {
  const test::TemporaryDirectory directory;
  SensorLink link(directory.path("sensor-eye.sock"), reader_hello());
  SensorSample sample;
  MonoTime now = MonoTime{} + seconds(1);
  link.update(now, sample);
  EXPECT_NE(link.problem(), "");
  EXPECT_EQ(sample.sequence, 0U);

  {
    FakeSensor eye(directory.path("sensor-eye.sock"));
    link.update(now + milliseconds(1), sample);
    EXPECT_NE(link.problem(), "") << "attempts are spaced";
    link.update(now = now + seconds(1), sample);
    EXPECT_EQ(link.problem(), "");
    eye.publish(small_sample(1, 5, 6));
    eye.publish(small_sample(2, 7, 8));
    link.update(now, sample);
    EXPECT_EQ(sample.sequence, 2U) << "the newest";
    EXPECT_EQ(sample.values[1], 8.0F);
  }
  link.update(now, sample);
  EXPECT_NE(link.problem(), "");
  EXPECT_EQ(sample.sequence, 2U) << "the last one seen stays; its age tells";

  FakeSensor eye(directory.path("sensor-eye.sock"));
  link.update(now + seconds(1), sample);
  eye.publish(small_sample(1, 1, 1));
  link.update(now + seconds(1), sample);
  EXPECT_EQ(sample.sequence, 1U);
}

// Goal: an image is all of one sample or none. Method: a foreign camera that publishes whole images, a short one, and
// one whose header says something else.
TEST(SensorLink, AnImageThatIsNotWholeIsNone) {
  const config::Sensor camera{.name = "eye", .timeout = milliseconds(200), .image = config::ImageShape{2, 3, 1}};
  const test::TemporaryDirectory directory;
  FakeSensor eye(directory.path("sensor-eye.sock"), mailbox_of(camera));
  SensorLink link(directory.path("sensor-eye.sock"), reader_hello(), mailbox_of(camera));
  std::vector<std::byte> image(image_bytes(camera));
  const auto publish = [&](std::uint64_t sequence, std::uint32_t said, std::size_t pixels) {
    const ImageHeader header{sequence, MonoTime{1}, MonoTime{2}, said, 0};
    std::vector<std::byte> payload(sizeof header + pixels, std::byte{static_cast<unsigned char>(sequence)});
    std::memcpy(payload.data(), &header, sizeof header);
    eye.publish(payload);
  };
  SensorSample sample;
  const MonoTime now = MonoTime{} + seconds(1);
  link.update(now, sample, image);
  publish(1, 6, 6);
  link.update(now, sample, image);
  EXPECT_EQ(sample.sequence, 1U) << link.problem();
  EXPECT_EQ(sample.sensed_at, MonoTime{1});
  EXPECT_EQ(image.back(), std::byte{1});
  publish(2, 6, 4);
  link.update(now, sample, image);
  EXPECT_EQ(sample.sequence, 0U) << "the last two pixels would be the image's before";
  publish(3, 6, 6);
  link.update(now, sample, image);
  EXPECT_EQ(sample.sequence, 3U);
  publish(4, 5, 6);
  link.update(now, sample, image);
  EXPECT_EQ(sample.sequence, 0U);
}

// Each way in which a sensor fails or lies has its verdict, and its sentence.
TEST(Samples, EachFaultHasItsVerdict) {
  struct Fault {
    SampleVerdict verdict;
    void (*strike)(SensorSample& sample, MonoTime now);
    const char* sentence;
  };
  const Fault faults[] = {
      {SampleVerdict::usable, [](SensorSample&, MonoTime) {}, ""},
      {SampleVerdict::none_yet, [](SensorSample& sample, MonoTime) { sample = {}; }, "sensor eye: no sample yet"},
      {SampleVerdict::wrong_width, [](SensorSample& sample, MonoTime) { sample.value_count = 3; },
       "sensor eye: its sample has another number of values than the 2 that small.yaml lists"},
      {SampleVerdict::too_old,
       [](SensorSample& sample, MonoTime now) { sample.sensed_at = now - nanoseconds(200'000'001); },
       "sensor eye: its newest sample is older than 200 ms"},
      {SampleVerdict::from_future, [](SensorSample& sample, MonoTime now) { sample.sensed_at = now + nanoseconds(1); },
       "sensor eye: its newest sample is stamped after now; stamps are ns of CLOCK_MONOTONIC"},
      {SampleVerdict::not_finite, [](SensorSample& sample, MonoTime) { sample.values[1] = std::nanf(""); },
       "sensor eye: its newest sample has values that are no numbers"},
      {SampleVerdict::usable, [](SensorSample& sample, MonoTime) { sample.values[2] = std::nanf(""); }, ""},
      {SampleVerdict::usable, [](SensorSample& sample, MonoTime now) { sample.sensed_at = now - milliseconds(200); },
       ""},
  };
  const auto robot = small_robot();
  const auto in_use = sensors_in_use(robot);
  ASSERT_EQ(in_use.size(), 1U);
  const MonoTime now = MonoTime{} + milliseconds(230);
  for (const Fault& fault : faults) {
    SensorSample sample = small_sample(1, 0, 0), used;
    fault.strike(sample, now);
    EXPECT_EQ(name(judge(robot.sensors[0], sample, now)), name(fault.verdict));
    EXPECT_EQ(take_usable(robot, in_use, std::span(&sample, 1), now, std::span(&used, 1)), fault.sentence);
  }
}

// A person who says nothing, too much or nonsense says what the robot file has for that, as of now.
TEST(Samples, ACommandThatIsAbsentHasItsDefault) {
  auto robot = small_robot();
  robot.sensors[0].command = config::CommandLimits{{-1, -1}, {1, 1}, {0, 0.5}};
  const auto in_use = sensors_in_use(robot);
  const MonoTime now = MonoTime{} + milliseconds(40);
  const auto used_for = [&](const SensorSample& sample, MonoTime at) {
    SensorSample used;
    EXPECT_EQ(take_usable(robot, in_use, std::span(&sample, 1), at, std::span(&used, 1)), "");
    return used;
  };
  const SensorSample wish = small_sample(1, -1, 0.75F);
  EXPECT_EQ(used_for(wish, now).values[1], 0.75F);
  EXPECT_EQ(used_for(wish, now).sensed_at, wish.sensed_at) << "its age counts";
  for (const SensorSample& sample : {SensorSample{}, small_sample(1, -1.01F, 0), small_sample(1, std::nanf(""), 0)}) {
    EXPECT_EQ(used_for(sample, now).values[0], 0.0F);
    EXPECT_EQ(used_for(sample, now).values[1], 0.5F);
    EXPECT_EQ(used_for(sample, now).sensed_at, now);
    EXPECT_EQ(used_for(sample, now).sequence, kAbsentSequence);
  }
  EXPECT_EQ(used_for(wish, MonoTime{} + seconds(1)).values[0], 0.0F) << "the dead man's time-out";
}

TEST(Samples, IgnoresSensorsThatNoTermUses) {
  auto robot = small_robot();
  robot.policy->observation = {term(config::TermKind::joint_position, 1)};
  EXPECT_TRUE(sensors_in_use(robot).empty());
}

}  // namespace
}  // namespace takt::policy_host

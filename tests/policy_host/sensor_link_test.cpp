// Goal: a sensor's samples arrive when its process is there, and their absence, age and size are noticed. Method: a
// real rendezvous server with a real mailbox, started, stopped and started again; time is passed in.
#include "policy_host/sensor_link.hpp"

#include <gtest/gtest.h>

#include "tests/policy_host/fake_server.hpp"
#include "tests/policy_host/small_robot.hpp"

namespace takt::policy_host {
namespace {

Hello reader_hello() {
  Hello hello;
  hello.role = Role::sensor_reader;
  hello.layout = contract_layout();
  return hello;
}

TEST(SensorLink, AttachesReadsAndAttachesAgain) {
  const TemporaryDirectory directory;
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

TEST(Unusable, NamesTheFirstReason) {
  const auto robot = small_robot();
  const auto in_use = sensors_in_use(robot);
  ASSERT_EQ(in_use.size(), 1U);
  const auto judge = [&](const SensorSample& sample, MonoTime now) {
    return unusable(robot, in_use, std::span(&sample, 1), now);
  };
  const auto sample = small_sample(1, 0, 0);  // sensed at 30 ms
  EXPECT_EQ(judge(sample, MonoTime{} + milliseconds(230)), "");
  EXPECT_EQ(judge(sample, MonoTime{} + nanoseconds(230'000'001)), "sensor eye: its newest sample is older than 200 ms");
  EXPECT_EQ(judge(SensorSample{}, MonoTime{}), "sensor eye: no sample yet");
  auto wide = sample;
  wide.value_count = 3;
  EXPECT_EQ(judge(wide, MonoTime{} + milliseconds(40)), "sensor eye: its sample has 3 values, small.yaml lists 2");
}

TEST(Unusable, IgnoresSensorsThatNoTermUses) {
  auto robot = small_robot();
  robot.policy->observation = {term(config::TermKind::joint_position, 1)};
  EXPECT_TRUE(sensors_in_use(robot).empty());
}

}  // namespace
}  // namespace takt::policy_host

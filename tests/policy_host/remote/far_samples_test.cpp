// SPDX-License-Identifier: Apache-2.0
// Goal: a policy on another machine sees the samples that its robot's bridge sent, whatever others send, and those of a
// new bridge that come before its first observation; an observation is shown with the samples that it names, or not at
// all. Method: messages by hand, from senders by hand; the sensor's
// socket is read as a policy host reads it.
#include "policy_host/remote/far_samples.hpp"

#include <gtest/gtest.h>

#include <array>
#include <chrono>
#include <optional>
#include <vector>

#include "config/load.hpp"
#include "config/paths.hpp"
#include "executive/contract/monotonic_clock.hpp"
#include "policy_host/executive_link.hpp"
#include "policy_host/remote/topics.hpp"
#include "policy_host/sensor_link.hpp"
#include "tests/support/temporary_directory.hpp"

namespace takt::policy_host::remote {
namespace {

constexpr PeerId kRobot{{1}}, kStranger{{2}}, kOther{{3}}, kNewBridge{{4}};
constexpr std::uint64_t kEpoch = 5;

class FarSamplesTest : public testing::Test {
 protected:
  void SetUp() override {
    auto opened = FarSamples::open(robot_, directory_.path(), {});
    ASSERT_TRUE(opened) << opened.error();
    samples_.emplace(std::move(*opened));
  }
  // The robot file's target: three values, all of them `value`.
  void send(const PeerId& sender, std::uint64_t number, float value, std::uint64_t epoch = kEpoch) {
    std::array<float, 3> values{value, value, value};
    takt_remote_Sample message{};
    message.epoch = epoch;
    message.number = number;
    refer(message.values, values.data(), values.size());
    samples_->take(message, sender);
  }
  bool shows(const PeerId& sender, std::uint64_t number, std::uint64_t epoch = kEpoch, std::int64_t age_ns = 1000) {
    std::array<takt_remote_SampleReference, 1> names{{{0, number, age_ns}}};
    takt_remote_Observation message{};
    message.epoch = epoch;
    refer(message.samples, names.data(), names.size());
    shown_at_ = monotonic_now();
    return samples_->pass_on(message, sender, shown_at_);
  }
  // What a policy host reads now.
  float seen() {
    SensorSample sample;
    for (int look = 0; look < 500 && link_.sessions() == 0; ++look) link_.update(monotonic_now(), sample);
    link_.update(monotonic_now(), sample);
    if (sample.sequence != 0) newest_ = sample.values[0];
    return newest_;
  }

  config::RobotConfig robot_ = config::load("config/arm6.yaml").value();
  test::TemporaryDirectory directory_;
  std::optional<FarSamples> samples_;
  SensorLink link_{config::sensor_socket(directory_.path(), "target"), hello_of(robot_, 0, Role::sensor_reader, "test"),
                   mailbox_of(robot_.sensors[0])};
  float newest_ = 0;
  MonoTime shown_at_;
};

TEST_F(FarSamplesTest, KeepsTheRobotsWhateverOthersSend) {
  send(kRobot, 1, 0.25F);
  ASSERT_TRUE(shows(kRobot, 1));
  EXPECT_EQ(seen(), 0.25F);
  send(kRobot, 2, 0.5F);
  for (const PeerId& stranger : {kStranger, kOther, kStranger}) {
    send(stranger, 2, 9.0F);
    send(stranger, UINT64_MAX, 9.0F);
  }
  EXPECT_TRUE(shows(kRobot, 2)) << "a sample of a slow sensor is sent once";
  EXPECT_EQ(seen(), 0.5F);
  EXPECT_FALSE(shows(kRobot, 3));
}

TEST_F(FarSamplesTest, KeepsWhatANewBridgeSentBeforeItsFirstObservation) {
  send(kRobot, 7, 0.25F);
  ASSERT_TRUE(shows(kRobot, 7));
  send(kNewBridge, 1, 0.75F, kEpoch + 1);
  EXPECT_TRUE(shows(kRobot, 7));
  EXPECT_TRUE(shows(kNewBridge, 1, kEpoch + 1));
  EXPECT_EQ(seen(), 0.75F);
  send(kRobot, 8, 0.25F);
  EXPECT_FALSE(shows(kNewBridge, 8, kEpoch + 1)) << "another sender's";
}

TEST_F(FarSamplesTest, WhatCameIsPassedOnWithTheAgeThatIsStated) {
  EXPECT_FALSE(shows(kRobot, 1)) << "not there yet";
  send(kRobot, 1, 0.25F);
  EXPECT_FALSE(shows(kRobot, 2)) << "another one";
  EXPECT_FALSE(shows(kRobot, 1, kEpoch + 1)) << "of another session";
  EXPECT_FALSE(shows(kRobot, 1, kEpoch, -1)) << "from the future";
  EXPECT_FALSE(samples_->oldest_sensed_at().is_set());
  EXPECT_TRUE(shows(kRobot, 1, kEpoch, 1'000'000));
  EXPECT_EQ(samples_->oldest_sensed_at(), shown_at_ - milliseconds(1));
}

TEST_F(FarSamplesTest, NoSampleIsNotTakenForOne) {
  EXPECT_FALSE(shows(kRobot, 0, 0)) << "as if session 0 had sent a sample 0";
  send(kRobot, 0, 0.25F, 0);
  EXPECT_FALSE(shows(kRobot, 0, 0)) << "numbers begin with 1";
}

}  // namespace
}  // namespace takt::policy_host::remote

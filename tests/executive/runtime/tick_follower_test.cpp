// SPDX-License-Identifier: Apache-2.0
// Goal: the service thread sees every transition and every request that was read, and calls the robot at rest only
// after it has been slow for long enough without interruption. Method: ticks published by hand into a real ring.
#include "executive/runtime/tick_follower.hpp"

#include <gtest/gtest.h>

#include "executive/runtime/published_segments.hpp"

namespace takt::runtime {
namespace {

class TickFollowerTest : public testing::Test {
 protected:
  void publish(Mode mode, float speed, OperatorRequest request = OperatorRequest::none) {
    TickRecord record{};
    record.header.joint_count = 2;
    record.header.tick = ++tick_;
    record.header.now = MonoTime{} + milliseconds(static_cast<std::int64_t>(1000 + tick_));
    record.header.previous_mode = mode_;
    record.header.mode = mode_ = mode;
    record.header.operator_request = request;
    q_ -= speed * 0.001F;
    record.joints[1].q_estimate = q_;
    record.header.drives_enabled = mode == Mode::standby ? 0 : 1;
    record.joints[0].drive_enabled = record.header.drives_enabled;
    record.joints[1].drive_enabled = given_up_ ? 0 : record.header.drives_enabled;
    record.joints[1].reply_faults = moved_ ? bit(ReplyFault::moved_unheard) : ReplyFaultMask{};
    published_.tick(record);
  }
  PublishedSegments published_ = PublishedSegments::create(2).value();
  static pipeline::TickConfig two_joints(bool is_second_passive) {
    pipeline::TickConfig config;
    config.joint_count = 2;
    config.rest_velocity = 0.02F;
    config.joints[1].passive = is_second_passive;
    return config;
  }
  std::vector<Mode> entered_;
  const pipeline::TickConfig config_ = two_joints(false);
  TickFollower follower_{published_.tick_reader(), config_,
                         [this](const TickRecord& record) { entered_.push_back(record.header.mode); }};
  std::uint64_t tick_ = 0;
  float q_ = 0;  // rad, joint 1
  Mode mode_ = Mode::standby;
  bool given_up_ = false;  // joint 1
  bool moved_ = false;     // joint 1, unheard
};

TEST_F(TickFollowerTest, BeforeTheFirstTickThereIsNothing) {
  follower_.catch_up();
  EXPECT_EQ(follower_.latest().header.tick, 0U);
  EXPECT_FALSE(follower_.rests());
}

TEST_F(TickFollowerTest, EveryTransitionIsSeenOnce) {
  for (const Mode mode : {Mode::standby, Mode::arming, Mode::arming, Mode::tracking, Mode::degraded, Mode::tracking}) {
    publish(mode, 0);
  }
  follower_.catch_up();
  follower_.catch_up();
  EXPECT_EQ(entered_, (std::vector{Mode::arming, Mode::tracking, Mode::degraded, Mode::tracking}));
  EXPECT_EQ(follower_.latest().header.tick, 6U);
}

TEST_F(TickFollowerTest, RestNeedsAHundredMillisecondsWithoutInterruption) {
  for (int i = 0; i < 100; ++i) publish(Mode::damped_stop, 0.019F);
  follower_.catch_up();
  EXPECT_FALSE(follower_.rests()) << "99 ms";
  publish(Mode::damped_stop, 0.019F);
  follower_.catch_up();
  EXPECT_TRUE(follower_.rests());
  publish(Mode::damped_stop, 1.1F);
  publish(Mode::damped_stop, 0.0F);
  follower_.catch_up();
  EXPECT_FALSE(follower_.rests()) << "a joint that was pushed meanwhile does not rest";
}

// Goal: a joint that reads elsewhere after a silence is told of, in any mode, once for each time.
TEST_F(TickFollowerTest, AJointThatMovedUnheardIsToldOfOnce) {
  std::vector<std::pair<std::uint64_t, std::size_t>> told;
  follower_.on_moved_unheard(
      [&told](const TickRecord& record, std::size_t joint) { told.emplace_back(record.header.tick, joint); });
  for (const bool moved : {false, true, true, false, true}) {
    moved_ = moved;
    publish(Mode::tracking, 0);
  }
  follower_.catch_up();
  EXPECT_EQ(told, (std::vector<std::pair<std::uint64_t, std::size_t>>{{2, 1}, {5, 1}}));
}

// Goal: a pole without a drive may swing on; its cart's process ends all the same.
TEST_F(TickFollowerTest, APassiveJointIsNotAskedWhetherItRests) {
  const pipeline::TickConfig config = two_joints(true);
  TickFollower follower(published_.tick_reader(), config, [](const TickRecord&) {});
  for (int i = 0; i < 101; ++i) publish(Mode::damped_stop, 3);
  follower.catch_up();
  follower_.catch_up();
  EXPECT_TRUE(follower.rests());
  EXPECT_FALSE(follower_.rests());
}

// Goal: a process that shall end does not wait for what a lost joint last said of its speed.
TEST_F(TickFollowerTest, AJointWithoutPowerIsNotAskedWhetherItRests) {
  given_up_ = true;
  for (int i = 0; i < 101; ++i) publish(Mode::fault_latched, 3);
  follower_.catch_up();
  EXPECT_TRUE(follower_.rests());
  publish(Mode::standby, 3);
  follower_.catch_up();
  EXPECT_FALSE(follower_.rests()) << "in standby nothing is given up, and every joint is asked";
}

TEST_F(TickFollowerTest, ASpeedThatIsNoNumberIsNoRest) {
  for (int i = 0; i < 200; ++i) publish(Mode::damped_stop, std::numeric_limits<float>::quiet_NaN());
  follower_.catch_up();
  EXPECT_FALSE(follower_.rests());
}

TEST_F(TickFollowerTest, ARequestIsNoticedByTheTickThatReadItOnly) {
  publish(Mode::standby, 0);
  publish(Mode::standby, 0, OperatorRequest::arm);
  publish(Mode::arming, 0);
  follower_.catch_up();
  EXPECT_TRUE(follower_.noticed(OperatorRequest::arm, 1));
  EXPECT_FALSE(follower_.noticed(OperatorRequest::arm, 2)) << "an earlier request is no answer to a later one";
  EXPECT_FALSE(follower_.noticed(OperatorRequest::stop, 0));
}

}  // namespace
}  // namespace takt::runtime

// SPDX-License-Identifier: Apache-2.0
// Goal: a joint that slides is treated as its motor would be: no threshold of the tick is a radian by accident. Method:
// one robot twice, as hinges and as slides whose gear is a power of two, so that every number of the second is one of
// the first times a power of two. Both live through the same things; what the ticks decide is the same, bit by bit.
#include <gtest/gtest.h>

#include <cmath>
#include <functional>
#include <memory>
#include <vector>

#include "executive/pipeline/joint_watch.hpp"
#include "tests/executive/pipeline/rig.hpp"

namespace takt::pipeline {
namespace {

constexpr float kWay = 1.0F / 128;  // m per rad

void make_slide(JointConfig& joint) {
  JointLimits& limits = joint.limits;
  for (float* const length : {&limits.q_min, &limits.q_max, &limits.velocity, &limits.acceleration,
                              &limits.q_hard_margin, &limits.velocity_hard, &limits.target_margin, &joint.fallback_pose,
                              &joint.fallback_speed, &joint.home, &joint.following_error})
    *length *= kWay;
  for (float* const force : {&limits.torque, &limits.torque_rate}) *force /= kWay;
  for (float* const stiffness :
       {&limits.kp_max, &limits.kd_max, &joint.kp, &joint.kd, &joint.damping, &joint.inertia, &joint.inertia_max})
    *stiffness /= kWay * kWay;
  limits.per_rad = kWay;
}

void make_slides(TickConfig& config) {
  for (std::uint32_t j = 0; j < config.joint_count; ++j) {
    make_slide(config.joints[j]);
    for (std::uint32_t k = 0; k < config.joint_count; ++k) {
      config.feedback_gains[j][k].position /= kWay * kWay;
      config.feedback_gains[j][k].velocity /= kWay * kWay;
    }
  }
}

struct Twins {
  explicit Twins(TickConfig config) : hinges(config) {
    make_slides(config);
    slides = std::make_unique<testing::Rig>(config);
  }
  // `happens` is told what a radian is.
  void go(float target, OperatorRequest request = OperatorRequest::none,
          const std::function<void(testing::Rig&, float per_rad)>& happens = {}) {
    if (happens) happens(hinges, 1);
    if (happens) happens(*slides, kWay);
    hinges.tick_with_policy(target, request);
    slides->tick_with_policy(target * kWay, request);
    compare();
  }
  void go_without_policy() {
    hinges.tick();
    slides->tick();
    compare();
  }
  void compare() const {
    const TickRecord &a = hinges.out->record, &b = slides->out->record;
    ASSERT_EQ(a.header.mode, b.header.mode) << "tick " << a.header.tick;
    ASSERT_EQ(a.header.causes_active, b.header.causes_active) << "tick " << a.header.tick;
    for (std::size_t j = 0; j < hinges.config.joint_count; ++j) {
      const JointRecord &hinge = a.joints[j], &slide = b.joints[j];
      ASSERT_EQ(hinge.q_reference * kWay, slide.q_reference) << "tick " << a.header.tick << " joint " << j;
      ASSERT_EQ(hinge.q_estimate * kWay, slide.q_estimate) << "tick " << a.header.tick << " joint " << j;
      ASSERT_EQ(hinge.tau_command / kWay, slide.tau_command) << "tick " << a.header.tick << " joint " << j;
      ASSERT_EQ(hinge.interventions, slide.interventions) << "tick " << a.header.tick << " joint " << j;
      ASSERT_EQ(hinge.reply_faults, slide.reply_faults) << "tick " << a.header.tick << " joint " << j;
      ASSERT_EQ(hinge.behind, slide.behind) << "tick " << a.header.tick << " joint " << j;
    }
  }
  void run(int ticks, const std::function<float(float)>& target,
           const std::function<void(testing::Rig&, float)>& happens = {}) {
    for (int i = 0; i < ticks; ++i)
      ASSERT_NO_FATAL_FAILURE(go(target(static_cast<float>(i) * 1e-3F), OperatorRequest::none, happens));
  }
  void arm() {
    run(40, [](float) { return 0.0F; });
    go(0, OperatorRequest::arm);
    run(60, [](float) { return 0.0F; });
    ASSERT_EQ(hinges.mode(), Mode::tracking);
  }
  testing::Rig hinges;
  std::unique_ptr<testing::Rig> slides;
};

float wave(float t) {
  return 0.8F * std::sin(6 * t);
}

TEST(SlideScale, PathsAndStopsAreTheSame) {
  Twins twins(testing::robot(3));
  twins.arm();
  twins.run(2000, wave);
  twins.run(200, [](float) { return 1.0F; });
  twins.run(200, [](float) { return 5.0F; });  // out of range
  twins.go(0, OperatorRequest::stop);
  twins.run(1500, wave);
  ASSERT_EQ(twins.hinges.mode(), Mode::damped_stop);
  twins.go(0, OperatorRequest::reset);
  twins.run(10, wave);
  EXPECT_EQ(twins.hinges.mode(), Mode::standby) << "both rest";
}

// What a drive tells is written over in ticks of its own, for both alike.
TEST(SlideScale, LiesAreFoundAlike) {
  using Lie = std::function<void(testing::Rig::Drive&, float per_rad)>;
  const Lie lies[] = {[](auto& drive, float per_rad) { drive.q += 0.3F * per_rad; },
                      [](auto& drive, float per_rad) { drive.q += 0.03F * per_rad; },
                      [](auto& drive, float per_rad) { drive.dq += 0.5F * per_rad; },
                      [](auto& drive, float) { drive.gripped = true; }};
  for (const Lie& lie : lies) {
    Twins twins(testing::robot(3));
    twins.arm();
    twins.run(300, wave);
    twins.run(400, wave, [&lie](testing::Rig& rig, float per_rad) { lie(rig.drives[1], per_rad); });
    twins.run(400, wave);
  }
}

TEST(SlideScale, StateFeedbackIsTheSame) {
  TickConfig config = testing::robot(2);
  config.degraded = DegradedBehaviour::fallback;
  config.fallback = FallbackKind::state_feedback;
  config.freshness.stop_after = seconds(60);
  for (std::uint32_t j = 0; j < 2; ++j)
    for (std::uint32_t k = 0; k < 2; ++k) config.feedback_gains[j][k] = {j == k ? 2.0F : -0.3F, j == k ? 0.5F : 0.1F};
  Twins twins(config);
  twins.arm();
  twins.run(300, wave);
  for (int i = 0; i < 400; ++i) ASSERT_NO_FATAL_FAILURE(twins.go_without_policy());
  EXPECT_EQ(twins.hinges.mode(), Mode::degraded);
}

// A drive that is silent for long, and reads elsewhere afterwards.
TEST(SlideScale, WhatMovedUnheardIsAskedAboutAlike) {
  for (const float far : {0.02F, 0.2F}) {
    Twins twins(testing::robot(2));
    twins.arm();
    const auto silent = [](bool is) { return [is](testing::Rig& rig, float) { rig.drives[1].silent = is; }; };
    twins.run(300, wave, silent(true));
    twins.go(0, OperatorRequest::none, [&](testing::Rig& rig, float per_rad) { rig.drives[1].q += far * per_rad; });
    twins.run(300, wave, silent(false));
  }
}

struct Stood {
  int found_after = 0;  // ticks under torque; 0: never found
  std::vector<float> margins;
};

// A joint that stands still at `q` of a hinge, whatever torque it is given.
Stood stood(bool slides, float q) {
  TickConfig config = testing::robot(2);
  JointConfig& joint = config.joints[1];
  joint.loop = LoopAt::host_torque;
  if (slides) make_slide(joint);
  JointWatch watch;
  MonoTime now{1'000'000'000};
  Stood all;
  for (int i = 0; i < 800; ++i, now = now + config.period) {
    JointFeedback feedback;
    feedback.received_at = now;
    feedback.drive_state = DriveState::enabled;
    feedback.q = q * (slides ? kWay : 1.0F);
    take_feedback(watch, feedback, now, joint, config);
    JointSetpoint told;
    told.tau = i < 100 ? 0.0F : 0.15F * joint.limits.torque;
    note_told(watch, told, 0, feedback.q, joint);
    const bool found = (feedback_faults(watch, feedback, now, config) & bit(ReplyFault::frozen)) != 0;
    if (found && all.found_after == 0) all.found_after = i - 100;
    all.margins.push_back(margin_of(watch, joint, config).frozen);
  }
  return all;
}

// Goal: an encoder that stands still under torque is found as of a slide's motor, and one pressed against its stop is
// not. Method: away from the stop, a little off it and nearly at it.
TEST(SlideScale, AStandstillUnderTorqueIsFoundAlike) {
  const float stop = testing::robot(2).joints[1].limits.q_max;
  for (const auto& [q, is_found] :
       {std::pair{0.0F, true}, std::pair{stop - 0.03F, true}, std::pair{stop - 0.01F, false}}) {
    const Stood hinge = stood(false, q), slide = stood(true, q);
    EXPECT_EQ(hinge.found_after > 0, is_found) << q;
    EXPECT_EQ(hinge.found_after, slide.found_after) << q;
    EXPECT_EQ(hinge.margins, slide.margins) << q;
  }
}

}  // namespace
}  // namespace takt::pipeline

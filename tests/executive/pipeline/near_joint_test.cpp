// SPDX-License-Identifier: Apache-2.0
// Goal: a reference knows where its joint is. Whatever plays without stiffness, and whatever ends it, no joint is
// thrown: afterwards none gets faster by the executive's doing, and none goes far. Method: the rig's true motion, with
// policies that play without stiffness, by velocity or by torque, and end in every way; a hand that holds a joint
// meanwhile; then hundreds of thousands of hostile ticks.
#include <gtest/gtest.h>

#include <algorithm>
#include <array>
#include <cmath>
#include <cstdio>
#include <cstdlib>
#include <functional>
#include <random>
#include <string>

#include "executive/pipeline/tick_state.hpp"
#include "tests/executive/pipeline/rig.hpp"

namespace takt::pipeline {
namespace {

using testing::Rig;

struct Asked {
  float q = 0, dq = 0, kp = 0, kd = 0, tau = 0;
};

// One answer to the newest observation: the same for every step, joint by joint.
CommandChunk answer(Rig& rig, std::span<const Asked> asked) {
  CommandChunk chunk = testing::chunk_for(rig.config, rig.newest_observation, rig.published_at[rig.newest_observation],
                                          rig.now, ++rig.sequence, 0.0F);
  // A path of straight lines carries no velocities.
  const bool straight = rig.config.interpolation == Interpolation::linear;
  chunk.header.fields =
      straight ? kAllCommandFields & ~static_cast<unsigned>(CommandField::dq) : unsigned{kAllCommandFields};
  for (std::size_t step = 0; step < chunk.header.step_count; ++step) {
    for (std::size_t j = 0; j < rig.config.joint_count; ++j) {
      const Asked& one = asked[std::min(j, asked.size() - 1)];
      const auto put = [&](CommandField field, float value) {
        if (straight && field == CommandField::dq) return;
        chunk.values[value_index(chunk.header, field, step, j)] = value;
      };
      put(CommandField::q, one.q);
      put(CommandField::dq, one.dq);
      put(CommandField::kp, one.kp);
      put(CommandField::kd, one.kd);
      put(CommandField::tau_ff, one.tau);
    }
  }
  return chunk;
}

void tick_with(Rig& rig, std::span<const Asked> asked, OperatorRequest request = OperatorRequest::none) {
  if (rig.newest_observation == 0 || !rig.out->observation_due) {
    rig.tick(nullptr, request);
    return;
  }
  const CommandChunk chunk = answer(rig, asked);
  rig.tick(&chunk, request);
}

void arm_with(Rig& rig, std::span<const Asked> asked) {
  for (int i = 0; i < 40; ++i) tick_with(rig, asked);
  tick_with(rig, asked, OperatorRequest::arm);
  for (int i = 0; i < 100 && rig.mode() != Mode::tracking; ++i) tick_with(rig, asked);
  ASSERT_EQ(rig.mode(), Mode::tracking);
}

// What a policy without stiffness asks for, and how it ends.
struct End {
  std::string name;
  std::function<void(TickConfig&)> configure;
  OperatorRequest request = OperatorRequest::none;
};

std::vector<End> every_end() {
  const auto stops_by = [](StopManner manner) {
    return [manner](TickConfig& config) {
      config.stops[static_cast<std::size_t>(Cause::operator_stop)] = {manner, {}};
    };
  };
  return {
      {"dies, hold", [](TickConfig& config) { config.degraded = DegradedBehaviour::hold; }},
      {"dies, slow", [](TickConfig& config) { config.degraded = DegradedBehaviour::slow; }},
      {"dies, pose",
       [](TickConfig& config) {
         config.degraded = DegradedBehaviour::fallback;
         config.fallback = FallbackKind::pose;
         for (JointConfig& joint : config.joints) joint.fallback_pose = 0.0F;
       }},
      {"stop by hold", stops_by(StopManner::hold), OperatorRequest::stop},
      {"stop by rest", stops_by(StopManner::rest), OperatorRequest::stop},
  };
}

struct Thrown {
  float fastest = 0, farthest = 0, hardest = 0;  // rad/s, rad, Nm after the end, of the joint that is worst
};

Thrown after_end(Rig& rig, const End& end, std::span<const Asked> asked) {
  std::array<float, kMaxJoints> where{};
  for (std::size_t j = 0; j < rig.config.joint_count; ++j) where[j] = rig.drives[j].q;
  if (end.request != OperatorRequest::none) tick_with(rig, asked, end.request);
  Thrown worst;
  for (int i = 0; i < 2000; ++i) {
    if (i == 700) rig.drives[0].gripped = false;  // long after the policy's last command
    rig.tick();
    for (std::size_t j = 0; j < rig.config.joint_count; ++j) {
      worst.fastest = std::max(worst.fastest, std::abs(rig.drives[j].dq));
      worst.farthest = std::max(worst.farthest, std::abs(rig.drives[j].q - where[j]));
      worst.hardest = std::max(worst.hardest, std::abs(rig.drives[j].tau));
    }
  }
  return worst;
}

// A target 1.2 rad away, and no stiffness to go there: the joint rests, and rests on.
TEST(NearJoint, NoEndOfAPolicyWithoutStiffnessThrowsAJointThatRests) {
  for (const LoopAt loop : {LoopAt::drive, LoopAt::host_torque}) {
    for (const Interpolation steps : {Interpolation::linear, Interpolation::hold, Interpolation::cubic}) {
      for (const float kp : {0.0F, 0.8F}) {
        for (const End& end : every_end()) {
          TickConfig config = testing::robot(3);
          config.interpolation = steps;
          for (JointConfig& joint : config.joints) joint.loop = loop;
          end.configure(config);
          Rig rig(config);
          const std::array<Asked, 2> asked{Asked{1.2F, 0, kp, 2.0F, 0}, Asked{0.0F, 0, 100, 4, 0}};
          if (kp > 0.0F) rig.drives[0].gripped = true;  // so little stiffness would move it slowly
          arm_with(rig, asked);
          for (int i = 0; i < 2000; ++i) tick_with(rig, asked);
          ASSERT_EQ(rig.mode(), Mode::tracking);
          const Thrown thrown = after_end(rig, end, asked);
          const std::string what = end.name + ", kp " + std::to_string(kp) + ", steps " +
                                   std::to_string(static_cast<int>(steps)) + ", loop " +
                                   std::to_string(static_cast<int>(loop));
          EXPECT_LE(thrown.fastest, 0.35F) << what;
          EXPECT_LE(thrown.farthest, 0.1F) << what;
        }
      }
    }
  }
}

// A joint that a policy moves by velocity, or by torque, is braked from its own motion and never sent back.
TEST(NearJoint, AJointMovedByVelocityOrTorqueIsNotSentBack) {
  for (const End& end : every_end()) {
    if (end.name == "dies, pose") continue;  // it leads it back, slowly
    for (const bool by_torque : {false, true}) {
      TickConfig config = testing::robot(1);
      config.interpolation = Interpolation::hold;
      end.configure(config);
      Rig rig(config);
      rig.drives[0].q = -1.0F;
      const auto moving = [&] {
        return std::array<Asked, 1>{by_torque ? Asked{rig.drives[0].q, 0, 0, 0, 0.4F}
                                              : Asked{rig.drives[0].q, 1.36F, 0, 4, 0}};
      };
      arm_with(rig, moving());
      for (int i = 0; i < (by_torque ? 250 : 700); ++i) tick_with(rig, moving());
      const float speed = rig.drives[0].dq;
      ASSERT_GT(speed, 0.3F) << end.name << ", by torque " << by_torque << ", at " << rig.drives[0].q << ", "
                             << name(rig.mode()) << ", told " << rig.drives[0].told.dq << " kd "
                             << rig.drives[0].told.kd << " tau " << rig.drives[0].told.tau;
      float fastest = 0, backwards = 0;
      if (end.request != OperatorRequest::none) tick_with(rig, moving(), end.request);
      for (int i = 0; i < 1500; ++i) {
        rig.tick();
        fastest = std::max(fastest, rig.drives[0].dq);
        backwards = std::max(backwards, -rig.drives[0].dq);
      }
      EXPECT_LE(backwards, 0.1F) << end.name << " torque " << by_torque;
      // The policy's last command is played to its max_age of 100 ms.
      EXPECT_LE(fastest, speed + (by_torque ? 0.4F : 0.1F)) << end.name << " torque " << by_torque;
    }
  }
}

// A hand holds a joint while its policy is dead, and lets go.
TEST(NearJoint, AHandThatLetsGoOfAHeldJointIsNotThrownOff) {
  Rig rig(testing::robot(1));
  const std::array<Asked, 1> far{Asked{1.2F, 0, 100, 4, 0}};
  arm_with(rig, far);
  rig.drives[0].gripped = true;
  for (int i = 0; i < 1000; ++i) tick_with(rig, far);
  EXPECT_LE(std::abs(rig.out->record.joints[0].q_reference - rig.drives[0].q), 30.0F / 100.0F + 0.02F)
      << "no further than the whole torque pulls";
  rig.run(400);
  ASSERT_NE(rig.mode(), Mode::tracking);
  rig.drives[0].gripped = false;
  float fastest = 0;
  for (int i = 0; i < 1000; ++i) {
    rig.tick();
    fastest = std::max(fastest, std::abs(rig.drives[0].dq));
  }
  EXPECT_LE(fastest, 1.1F * rig.config.joints[0].limits.velocity);
}

// What a held target is for: the step itself, at once, where gains move the drive.
TEST(NearJoint, AHeldStepGoesOutWithinTwoPeriods) {
  for (const LoopAt loop : {LoopAt::drive, LoopAt::host_torque}) {
    TickConfig config = testing::robot(1);
    config.interpolation = Interpolation::hold;
    config.resume_over = milliseconds(50);
    config.joints[0].loop = loop;
    Rig rig(config);
    const std::array<Asked, 1> before{Asked{0.0F, 0, 100, 4, 0}}, after{Asked{0.2F, 0, 100, 4, 0}};
    arm_with(rig, before);
    for (int i = 0; i < 200; ++i) tick_with(rig, before);
    while (!rig.out->observation_due) tick_with(rig, before);
    tick_with(rig, after);
    tick_with(rig, after);
    EXPECT_GE(rig.out->record.joints[0].q_reference, 0.9F * 0.2F);
    EXPECT_EQ(rig.out->record.joints[0].dq_command, 0.0F);
  }
}

// While the limits are still rising after arming, a held step is led to, not jumped at.
TEST(NearJoint, AHeldStepIsLedToWhileTheLimitsRise) {
  TickConfig config = testing::robot(1);
  config.interpolation = Interpolation::hold;
  config.resume_over = seconds(2);
  config.degraded_speed_scale = 0.1F;
  Rig rig(config);
  const std::array<Asked, 1> far{Asked{1.0F, 0, 100, 4, 0}};
  arm_with(rig, far);
  float fastest = 0;
  for (int i = 0; i < 300; ++i) {
    tick_with(rig, far);
    fastest = std::max(fastest, std::abs(rig.drives[0].dq));
  }
  EXPECT_LE(fastest, 0.3F * config.joints[0].limits.velocity);
}

// Gains on and off, targets anywhere, hands, deaths, stops: nothing is thrown after any end, and no speed of ours is
// ever above the limits.
// TAKT_HOSTILE_TICKS=N: so many instead of 300,000.
TEST(NearJoint, HundredsOfThousandsOfHostileTicksThrowNothing) {
  const char* const wanted_ticks = std::getenv("TAKT_HOSTILE_TICKS");
  const int wanted = wanted_ticks != nullptr ? std::stoi(wanted_ticks) : 300'000;
  int ends = 0, ticks = 0, thrown = 0;
  for (std::uint32_t seed = 1; ticks < wanted; ++seed) {
    std::mt19937 random(seed);
    const auto uniform = [&](float low, float high) {
      return std::uniform_real_distribution<float>(low, high)(random);
    };
    const auto one_in = [&](int n) { return std::uniform_int_distribution<int>(1, n)(random) == 1; };
    const std::vector<End> all = every_end();
    const End& end = all[random() % all.size()];
    TickConfig config = testing::robot(3);
    config.interpolation = static_cast<Interpolation>(random() % 3);
    config.resume_over = milliseconds(static_cast<std::int64_t>(random() % 300));
    config.clamped_share = 1.0;
    end.configure(config);
    Rig rig(config);
    std::array<Asked, 3> asked{};
    for (Asked& one : asked) one = {0, 0, 80, 3, 0};
    arm_with(rig, asked);
    const int length = 300 + static_cast<int>(random() % 1200);
    for (int i = 0; i < length; ++i, ++ticks) {
      for (std::size_t j = 0; j < 3; ++j) {
        if (one_in(60)) asked[j].q = uniform(-1.3F, 1.3F);
        if (one_in(100)) asked[j].kp = one_in(2) ? 0.0F : (one_in(2) ? 0.8F : uniform(40, 150));
        if (one_in(100)) asked[j].kd = asked[j].kp > 40 ? uniform(2, 5) : uniform(0.5F, 3);
        if (one_in(300)) rig.drives[j].gripped = !rig.drives[j].gripped;
      }
      tick_with(rig, asked);
    }
    if (rig.mode() != Mode::tracking && rig.mode() != Mode::degraded) continue;
    ++ends;
    std::array<float, 3> speed{};
    for (std::size_t j = 0; j < 3; ++j) {
      rig.drives[j].gripped = false;
      speed[j] = std::abs(rig.drives[j].dq);
    }
    if (end.request != OperatorRequest::none) tick_with(rig, asked, end.request);
    const bool plays_on = end.request == OperatorRequest::none;
    for (int i = 0; i < 1200; ++i, ++ticks) {
      rig.tick();
      for (std::size_t j = 0; j < 3; ++j) {
        const float now = std::abs(rig.drives[j].dq);
        // To max_age the policy still moves it; and torque goes no faster than its slew limit.
        if (i < (plays_on ? 110 : 12)) speed[j] = std::max(speed[j], now);
        const float limit = 1.1F * config.joints[j].limits.velocity;
        if (now <= std::max(speed[j] + 0.2F, limit)) continue;
        ++thrown;
        ADD_FAILURE() << "seed " << seed << ", " << end.name << ", joint " << j << ", tick " << i << ": " << now
                      << " rad/s, before " << speed[j];
        return;
      }
    }
  }
  std::printf("%d ticks, %d ends, %d thrown\n", ticks, ends, thrown);
  EXPECT_GT(ends, 50);
}

}  // namespace
}  // namespace takt::pipeline

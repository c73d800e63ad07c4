// SPDX-License-Identifier: Apache-2.0
// Goal: whatever a policy asks for, the robot can always be stopped: a step is committed only where a stop from there
// stays inside position, velocity and torque limits, and where gravity leaves little torque, the robot brakes in time.
// Method: the bound on how gravity changes against the model itself, stops that were called possible driven to their
// end along the model, and a robot with scarce torque under a million hostile chunks in virtual time, with damped stops
// in between; the same chunks without the look breach.
#include "executive/pipeline/brake.hpp"

#include <gtest/gtest.h>

#include <algorithm>
#include <array>
#include <cmath>
#include <memory>
#include <random>

#include "executive/pipeline/tick_state.hpp"
#include "tests/executive/pipeline/rig.hpp"

namespace takt::pipeline {
namespace {

using testing::Rig;

class Dice {
 public:
  explicit Dice(std::uint32_t seed) : random_(seed) {}
  float between(float low, float high) { return std::uniform_real_distribution<float>(low, high)(random_); }
  bool one_in(int n) { return std::uniform_int_distribution<int>(1, n)(random_) == 1; }

 private:
  std::mt19937 random_;
};

// Torque for about half of the acceleration in the worst pose; what turns is half as heavy again as the lower bound
// says.
TickConfig scarce_robot(std::uint32_t joints, Dice& dice) {
  TickConfig config = testing::robot(joints);
  config.gravity_compensation = true;
  for (std::uint32_t j = 0; j < joints; ++j) {
    config.links[j].mass = dice.between(0.2F, 0.6F);
    config.joints[j].inertia_max = 1.5F * config.joints[j].inertia;
  }
  const GravityModel gravity(config);
  for (std::uint32_t j = 0; j < joints; ++j) {
    JointConfig& joint = config.joints[j];
    const float moves = dice.between(0.4F, 0.7F) * joint.inertia_max * joint.limits.acceleration;
    joint.limits.torque = (gravity.most(j) + moves) / kBrakeTorque;
    joint.limits.torque_rate = 300.0F * joint.limits.torque;
  }
  return config;
}

TEST(Brake, GravityAsksAndChangesNoMoreThanItsBounds) {
  Dice dice(1);
  for (int robot = 0; robot < 50; ++robot) {
    TickConfig config = scarce_robot(6, dice);
    if (robot % 2 == 0) config.links[3].parent = 1;  // a branch
    if (robot % 3 == 0)
      for (LinkModel* const link : {&config.links[1], &config.links[4]}) {
        link->slides = true;
        link->farthest = 4;  // m
      }
    const GravityModel model(config);
    for (int i = 0; i < 200; ++i) {
      std::array<float, kMaxJoints> from{}, to{}, moves{}, before{}, after{}, swing{};
      const float far = dice.between(0.0F, 1.0F);
      for (std::size_t j = 0; j < 6; ++j) {
        from[j] = dice.between(-3, 3);
        to[j] = from[j] + dice.between(-far, far);
        moves[j] = std::abs(to[j] - from[j]);
      }
      model.torques(from, before);
      model.torques(to, after);
      model.swing(moves, swing);
      for (std::size_t j = 0; j < 6; ++j) {
        ASSERT_LE(std::abs(before[j]), model.most(j) + 1e-4F);
        ASSERT_LE(std::abs(after[j] - before[j]), swing[j] + 1e-4F) << "robot " << robot << " joint " << j;
      }
    }
  }
}

TEST(Brake, OnlyWhereTorqueIsScarceAndOursIsItLookedAt) {
  Dice dice(2);
  TickConfig config = testing::robot(4);
  EXPECT_EQ(scarce_joints(config, GravityModel(config)), 0U) << "30 Nm for 1.5";
  config = scarce_robot(4, dice);
  EXPECT_EQ(scarce_joints(config, GravityModel(config)), every_joint(4));
  config.joints[0].passive = true;
  config.joints[1].loop = LoopAt::host_velocity;
  config.joints[2].loop = LoopAt::drive_position;
  EXPECT_EQ(scarce_joints(config, GravityModel(config)), bit_of_joint(3));
  config.gravity_compensation = false;  // no load is known
  config.joints[3].limits.torque = 1.2F * config.joints[3].inertia * config.joints[3].limits.acceleration;
  EXPECT_EQ(scarce_joints(config, GravityModel(config)), bit_of_joint(3)) << "half as heavy again is too much";
  config.joints[3].inertia_max = 0;  // the lower bound alone
  EXPECT_EQ(scarce_joints(config, GravityModel(config)), 0U);
}

// Drives the stop to its end: no joint past its limits, and no torque beyond what may be used, at any step, in the pose
// that all joints have there.
void drive_to_the_end(std::span<Stopping> joints, const GravityModel& model, const TickConfig& config) {
  const double dt = config.period.seconds();
  std::array<float, kMaxJoints> q{}, gravity{};
  for (int step = 0; step < 3000; ++step) {
    bool moves = false;
    std::array<double, kMaxJoints> asked{};
    for (std::size_t j = 0; j < joints.size(); ++j) {
      const ReferenceState before = joints[j].from;
      joints[j].from = step_braking(before, config.joints[j].limits, dt, joints[j].deceleration).next;
      asked[j] = (joints[j].from.dq - before.dq) / dt;
      q[j] = static_cast<float>(joints[j].from.q);
      moves |= joints[j].from.dq != 0.0;
    }
    model.torques(q, gravity);
    for (std::size_t j = 0; j < joints.size(); ++j) {
      const JointConfig& joint = config.joints[j];
      ASSERT_LE(joints[j].from.q, static_cast<double>(joint.limits.q_max) + 1e-6);
      ASSERT_GE(joints[j].from.q, static_cast<double>(joint.limits.q_min) - 1e-6);
      const double torque = static_cast<double>(joint.inertia_max) * asked[j] + static_cast<double>(gravity[j]);
      ASSERT_LE(std::abs(torque), static_cast<double>(kBrakeTorque * joint.limits.torque) * 1.001);
    }
    if (!moves) return;
  }
  FAIL() << "it does not come to rest";
}

TEST(Brake, AStopThatWasCalledPossibleIs) {
  Dice dice(3);
  int possible = 0, refused = 0;
  for (int i = 0; i < 20'000; ++i) {
    const TickConfig config = scarce_robot(4, dice);
    const GravityModel model(config);
    TickRecord record{};
    std::array<float, kMaxJoints> q{}, gravity{};
    std::array<Stopping, 4> joints;
    const float fast = dice.between(0.0F, 1.0F);
    for (std::size_t j = 0; j < 4; ++j) {
      const JointLimits& limits = config.joints[j].limits;
      q[j] = record.joints[j].q_estimate = dice.between(limits.q_min, limits.q_max);
      const float dq = record.joints[j].dq_estimate = fast * dice.between(-limits.velocity, limits.velocity);
      const float off = dice.between(-0.02F, 0.02F);
      joints[j] = {{std::clamp(static_cast<double>(q[j] + off), static_cast<double>(limits.q_min),
                               static_cast<double>(limits.q_max)),
                    static_cast<double>(dq), 0.0},
                   0.0,
                   true};
    }
    model.torques(q, gravity);
    for (std::size_t j = 0; j < 4; ++j) record.joints[j].tau_gravity = gravity[j];
    if (!can_stop(joints, record, every_joint(4), model, config)) {
      ++refused;
      continue;
    }
    ++possible;
    ASSERT_NO_FATAL_FAILURE(drive_to_the_end(joints, model, config)) << "case " << i;
  }
  EXPECT_GT(possible, 2000);
  EXPECT_GT(refused, 2000);
}

// Chunks that no policy should send: anywhere, out of range, held until the joint is fast, with gains and torques of
// their own.
class HostilePolicy {
 public:
  HostilePolicy(const TickConfig& config, std::uint32_t seed) : config_(config), dice_(seed) {
    wish_.fill(0.0F);
    CommandHeader& header = chunk_->header;
    header.step_period = milliseconds(10);
    header.step_count = 2;
    header.joint_count = static_cast<std::uint16_t>(config.joint_count);
    header.fields = kAllCommandFields & ~static_cast<unsigned>(CommandField::dq);
  }
  // Answers the newest observation.
  const CommandChunk* answer(Rig& rig) {
    CommandHeader& header = chunk_->header;
    header.observation_id = rig.newest_observation;
    header.sequence = ++rig.sequence;
    header.dequeued_at = header.infer_started_at = rig.published_at[rig.newest_observation];
    header.infer_ended_at = header.published_at = rig.now;
    for (std::size_t j = 0; j < config_.joint_count; ++j) {
      const JointLimits& limits = config_.joints[j].limits;
      if (dice_.one_in(150)) wish_[j] = dice_.one_in(2) ? limits.q_max + 0.1F : limits.q_min - 0.1F;
      if (dice_.one_in(300)) wish_[j] = dice_.between(2 * limits.q_min, 2 * limits.q_max);
      if (dice_.one_in(100)) torque_[j] = dice_.one_in(3) ? 0.0F : dice_.between(-limits.torque, limits.torque);
      if (dice_.one_in(200)) stiffness_[j] = dice_.between(40.0F, limits.kp_max);
      for (std::size_t step = 0; step < 2; ++step) {
        put(CommandField::q, step, j, wish_[j] + (dice_.one_in(20) ? dice_.between(-1, 1) : 0.0F));
        put(CommandField::kp, step, j, stiffness_[j]);
        put(CommandField::kd, step, j, dice_.between(1.0F, limits.kd_max));
        put(CommandField::tau_ff, step, j, torque_[j]);
      }
    }
    return chunk_.get();
  }

  // Without it no torque is spent on following the reference.
  [[nodiscard]] bool gives_stiffness(std::size_t joint) const { return stiffness_[joint] > 0.0F; }

 private:
  void put(CommandField field, std::size_t step, std::size_t joint, float value) {
    chunk_->values[value_index(chunk_->header, field, step, joint)] = value;
  }
  const TickConfig& config_;
  Dice dice_;
  std::array<float, kMaxJoints> wish_{}, torque_{}, stiffness_{};
  std::unique_ptr<CommandChunk> chunk_ = std::make_unique<CommandChunk>();
};

struct Breaches {
  int position = 0, velocity = 0, torque = 0;
  int braked = 0;  // joint-ticks with brake_reserve
};

void look(const Rig& rig, const HostilePolicy& policy, Breaches& breaches) {
  for (std::size_t j = 0; j < rig.config.joint_count; ++j) {
    const JointConfig& joint = rig.config.joints[j];
    const JointLimits& limits = joint.limits;
    const JointRecord& record = rig.out->record.joints[j];
    const auto& drive = rig.drives[j];
    breaches.braked += (record.interventions & bit(Intervention::brake_reserve)) != 0 ? 1 : 0;
    const float side = record.q_reference > limits.q_max ? 1.0F : -1.0F;
    const bool beyond = record.q_reference > limits.q_max + 1e-4F || record.q_reference < limits.q_min - 1e-4F;
    const bool reference_out =
        beyond && side * record.dq_reference > 0.0F;  // a joint found beyond its limit comes back in its own time
    const bool out = drive.q > limits.q_max + limits.q_hard_margin || drive.q < limits.q_min - limits.q_hard_margin;
    const bool follows = rig.header().player == Player::policy;
    breaches.position += out || (follows && reference_out) ? 1 : 0;
    breaches.velocity +=
        std::abs(drive.dq) > limits.velocity_hard || std::abs(record.dq_reference) > limits.velocity ? 1 : 0;
    const double asked = static_cast<double>(joint.inertia_max) * rig.state->joints[j].reference.ddq;
    // Where the joint runs away from it, the reference is carried along by the joint: no torque of ours moves it.
    const JointState& state = rig.state->joints[j];
    const double off = std::abs(state.reference_before.q - static_cast<double>(record.q_estimate));
    const bool is_carried = off * static_cast<double>(state.kp_before) >= 0.95 * static_cast<double>(limits.torque);
    const bool pulls = follows && policy.gives_stiffness(j) && !is_carried;
    const double torque = pulls ? asked + static_cast<double>(record.tau_gravity) : 0.0;
    breaches.torque += std::abs(torque) > static_cast<double>(limits.torque) ? 1 : 0;
    breaches.torque += std::abs(record.tau_total) > limits.torque * 1.001F ? 1 : 0;
  }
}

// `chunks` of them, one per tick, and a damped stop to rest, reset and arming after every 5000.
Breaches suffer(int chunks, std::uint32_t seed, bool looks) {
  Dice dice(seed);
  TickConfig config = scarce_robot(3, dice);
  config.observation_every_ticks = 1;
  config.clamped_share = 1.0;  // out of range as it likes
  Rig rig(config);
  if (!looks) rig.state->scarce = 0;
  HostilePolicy policy(config, seed);
  Breaches breaches;
  rig.tick();
  for (int i = 0; i < chunks; ++i) {
    const bool stops = i % 5000 == 4999;
    const bool arms = rig.mode() == Mode::standby && i % 5000 > 5;
    rig.sensed_at.clear();
    rig.tick(policy.answer(rig), stops ? OperatorRequest::stop : arms ? OperatorRequest::arm : OperatorRequest::none);
    look(rig, policy, breaches);
    if (!stops) continue;
    const auto rests = [&] { return rig.state->mode.resting != 0; };
    for (int tick = 0; tick < 3000 && !rests(); ++tick) {
      rig.tick();
      look(rig, policy, breaches);
    }
    EXPECT_TRUE(rests()) << "seed " << seed << ": the damped stop does not end";
    rig.published_at.clear();
    rig.tick(nullptr, OperatorRequest::reset);
    rig.run(2);
  }
  EXPECT_NE(rig.mode(), Mode::fault_latched) << "seed " << seed;
  return breaches;
}

TEST(Brake, AMillionHostileChunksBreachNothing) {
  int braked = 0;
  for (std::uint32_t seed = 1; seed <= 20; ++seed) {
    const Breaches breaches = suffer(50'000, seed, true);
    EXPECT_EQ(breaches.position, 0) << "seed " << seed;
    EXPECT_EQ(breaches.velocity, 0) << "seed " << seed;
    EXPECT_EQ(breaches.torque, 0) << "seed " << seed;
    braked += breaches.braked;
  }
  EXPECT_GT(braked, 10'000) << "the chunks were not hostile enough";
}

TEST(Brake, WithoutTheLookTheSameChunksAskForTorqueThatIsNotThere) {
  const Breaches breaches = suffer(50'000, 1, false);
  EXPECT_GT(breaches.torque, 100);
  EXPECT_EQ(breaches.braked, 0);
}

TEST(Brake, WhoeverRefusesTheBrakeIsMarkedAndItsTorqueDropped) {
  Dice dice(4);
  TickConfig config = scarce_robot(3, dice);
  config.observation_every_ticks = 1;
  Rig rig(config);
  HostilePolicy policy(config, 4);
  rig.tick();
  bool dropped = false;
  for (int i = 0; i < 20'000; ++i) {
    rig.sensed_at.clear();
    rig.tick(policy.answer(rig), i == 20 ? OperatorRequest::arm : OperatorRequest::none);
    for (std::size_t j = 0; j < 3; ++j) {
      const bool marked = (rig.out->record.joints[j].interventions & bit(Intervention::brake_reserve)) != 0;
      ASSERT_TRUE(!marked || (rig.state->scarce & bit_of_joint(j)) != 0);
      dropped |= marked;
    }
  }
  EXPECT_TRUE(dropped);
}

}  // namespace
}  // namespace takt::pipeline

// SPDX-License-Identifier: Apache-2.0
// Everything the tick needs to know about the robot, resolved, validated and in SI units. Filled once at load from
// the robot's configuration (executive/setup/tick_config_of.hpp); never changes while a run lasts. Plain value, no
// pointers.
#pragma once

#include <algorithm>
#include <array>
#include <cstdint>

#include "executive/contract/command_chunk.hpp"
#include "executive/contract/joints.hpp"
#include "executive/contract/mode.hpp"
#include "executive/contract/mono_time.hpp"
#include "executive/contract/observation.hpp"

namespace takt::pipeline {

// Of a joint that slides every number is in m and N where these say rad and Nm.
struct JointLimits {
  float q_min = 0, q_max = 0;  // rad, q_min < q_max
  float velocity = 0;          // rad/s > 0
  float acceleration = 0;      // rad/s^2 > 0, also the braking deceleration
  float torque = 0;            // Nm > 0
  float torque_rate = 0;       // Nm/s > 0
  float kp_max = 0, kd_max = 0;
  float q_hard_margin = 0;  // rad: measured position further outside q_min..q_max: damped stop
  float velocity_hard = 0;  // rad/s: measured speed above it: damped stop; >= velocity
  float target_margin = 0;  // rad: a target further outside q_min..q_max than this counts as out of range
  float per_rad = 1;        // what a radian in a limit for all joints is of this one: a slide's way per radian of motor
};

// Who closes a joint's control loop, and so what its setpoint carries.
enum class LoopAt : std::uint8_t {
  drive,           // the drive: q, dq, kp, kd and the feed-forward tau
  drive_position,  // the drive, with gains of its own: q; none where kp is 0
  host_torque,     // here: a finished torque in tau; kp and kd are 0
  host_velocity,   // here: a finished velocity in dq; kp, kd and tau are 0. The drive decides the torque
};

// The other two are told where to be, or how fast, and know the rest by themselves.
constexpr bool makes_torque_by_position(LoopAt loop) {
  return loop == LoopAt::drive || loop == LoopAt::host_torque;
}

// Of a drive whose gains are shares 0..1 of its own, and whose damping's share never exceeds the stiffness's. What they
// cannot say goes into the feed-forward torque.
struct DriveGains {
  float kp = 0;  // Nm/rad, joint side: share 1; 0: the drive takes any gains
  float kd = 0;  // Nm s/rad, > 0 where kp is
};

// Degrees Celsius; 0: not looked at.
struct TemperatureLimits {
  float warning = 0, stop = 0;                // of the hottest part the drive reports
  float casing_warning = 0, casing_stop = 0;  // of what it tells apart from the winding
  [[nodiscard]] constexpr bool any() const { return warning > 0 || stop > 0; }
  [[nodiscard]] constexpr bool of_casing() const { return casing_warning > 0 || casing_stop > 0; }
};

struct JointConfig {
  JointLimits limits;
  TemperatureLimits temperature{};
  float kp = 0, kd = 0;          // default impedance
  float damping = 0;             // Nm s/rad in damped stop and fault
  float inertia = 0;             // kg m^2, effective, lower bound; used by the torque barriers
  float inertia_max = 0;         // kg m^2, upper bound, used by the brake (brake.hpp); below `inertia`: that
  float home = 0;                // rad
  float fallback_pose = 0;       // rad, where the fallback policy goes
  float fallback_speed = 0;      // rad/s
  float observer_bandwidth = 0;  // rad/s of the velocity observer
  float following_error = 0;     // rad between the joint and its reference; 0: by torque and stiffness (following.hpp)
  std::uint8_t bus = 0;
  LoopAt loop = LoopAt::drive;
  bool passive = false;        // measured, never driven: its setpoint has no gains and no torque, whatever is asked
  bool tells_velocity = true;  // the drive's own; else its driver makes one of the positions
  DriveGains drive_gains{};
  Turns turns{};
};

// One link of the kinematic tree for gravity compensation. Joint j moves link j.
struct LinkModel {
  std::int32_t parent = -1;           // link index < own index, or -1 for the base
  std::array<float, 3> origin_xyz{};  // m, joint frame in the parent's link frame at q = 0
  std::array<float, 9> origin_rotation{1, 0, 0, 0, 1, 0, 0, 0, 1};  // row-major
  std::array<float, 3> axis{0, 0, 1};                               // unit vector in the joint frame
  bool slides = false;                                              // along the axis by q, m
  float farthest = 0;                                               // m, of |q|; slides only
  float mass = 0;                                                   // kg
  std::array<float, 3> com{};                                       // m, in the link frame
};

struct FreshnessContract {
  Duration max_age;
  float aging_fraction = 0.8F;     // of max_age
  double epsilon = 0.01;           // Pr(age > max_age) <= epsilon
  std::uint32_t window_ticks = 0;  // 1..kMaxWindowTicks
  Duration recover_after;          // uninterrupted fresh time that restores tracking
  Duration flap_memory;            // each relapse within it doubles the next recovery time, up to 16x
  Duration stop_after;             // no usable command for this long: damped stop
  Duration degrade_after;          // no usable command for this long is late, too; 0: epsilon of the window alone is
  std::uint32_t bad_command_limit = 0;  // more messages within the window refused for what they say: stop
};
inline constexpr std::uint32_t kMaxWindowTicks = 8192;

// How far a joint's feedback may be from what can be true (joint_watch.hpp).
struct FeedbackLimits {
  float jump = 0.05F;                        // rad beyond what velocity_hard allows; 0: not looked for
  float contradiction = 0.03F;               // rad between positions and velocities; 0: not looked for
  Duration frozen_after = milliseconds(20);  // no sooner is a position that stands still frozen; 0: not looked for
};

// What a joint does to the robot that is further from its reference than following_error.
enum class FollowingReaction : std::uint8_t { warn, degrade, stop };
struct FollowingLimits {
  Duration timeout = milliseconds(500);  // without interruption; 0: not looked for
  FollowingReaction then = FollowingReaction::warn;
};

// Shares of the ticks in about the last window, in 1/65536, above which a bus fault holds; kWholeShare: never.
inline constexpr std::uint32_t kWholeShare = 65536;
constexpr std::uint32_t share_of_ticks(double share) {
  return static_cast<std::uint32_t>(share * kWholeShare);
}
inline constexpr std::uint32_t kMaxBusFaultTicks = 32'767;
struct BusFaultLimits {
  std::uint32_t window_ticks = 1000;                     // 1..kMaxBusFaultTicks
  std::uint32_t replies_lost = share_of_ticks(0.5);      // of the replies one joint owes
  std::uint32_t replies_repeated = share_of_ticks(0.1);  // replies of one joint beyond those it owes
  std::uint32_t replies_delayed = share_of_ticks(0.5);   // of the replies one joint owes
  std::uint32_t transmit_drops = share_of_ticks(0.05);   // the rest: ticks in which it happened on one bus
  std::uint32_t receive_drops = share_of_ticks(0.02);
  std::uint32_t foreign_frames = share_of_ticks(0.02);
  std::uint32_t babble = share_of_ticks(0.1);
  std::uint32_t error_passive = share_of_ticks(0.5);
};

// What a chunk's steps mean.
enum class Interpolation : std::uint8_t {
  hold,    // each step's values for its whole period; velocity setpoint: the step's dq, 0 where the chunk carries none
  linear,  // straight lines between the steps' positions, no dq; velocity setpoint: the reference's
  cubic,   // curves through the steps' positions and dq; velocity setpoint: the reference's
};

// The base's IMU (contract/imu.hpp).
struct ImuConfig {
  bool present = false;
  Duration timeout;         // no usable sample sensed within it: imu_lost
  Duration frozen_after;    // the same ten values for longer, under fresh stamps: imu_lost; 0: not looked for
  float contradiction = 0;  // rad between rotation and angular velocity within about 0.5 s: imu_lost; 0: not looked for
  float tilt = 0;           // rad, from upright
  float angular_velocity = 0;  // rad/s, of the base
};

// How a new chunk takes over from the path that is being played (join.hpp).
enum class JoinKind : std::uint8_t { replace, cross_fade, prefix };
struct JoinRule {
  JoinKind kind = JoinKind::replace;
  Duration over{};           // cross_fade: how long it takes, > 0
  Duration longest_delay{};  // prefix: no more than this is promised to be played
};

// How a damped stop brings the robot to rest.
enum class StopManner : std::uint8_t {
  rest,     // damped until at rest, then held; TickConfig::holds_at_once: as `hold`
  damping,  // damped, and never held
  hold,     // braked along the limits and held at once
  policy,   // moved by the fallback policy while its command is usable, else as `rest`
};
struct StopRule {
  StopManner manner = StopManner::rest;
  Duration longest;  // hold, policy: then as `rest`; 0: without end
};

enum class DegradedBehaviour : std::uint8_t { hold, slow, fallback };
enum class FallbackKind : std::uint8_t { pose, state_feedback, policy };

// Whose commands are taken.
struct ExpectedPolicy {
  std::uint64_t hash = 0;  // 0: any
  // It uses outside sensors: a command that does not say when they sensed is refused (missing_stamp).
  bool needs_outside_stamp = false;
};

// What one joint contributes to another's torque in state feedback.
struct FeedbackGain {
  float position = 0;  // Nm/rad, on q - fallback_pose
  float velocity = 0;  // Nm s/rad, on dq
};

// Half of what the tick ring holds (ipc/executive_segments.hpp): until then a recorder that hesitates loses no tick and
// no command. CAN frames it may lose before: 65,536 of them wait, which is 2.7 s at 24 per tick; the run says how many.
inline constexpr std::uint32_t kLongestUnrecorded = 4096;

// Protections that a measurement of what each costs switches off (evidence/rollout/method.hpp). No robot file says any
// of them, and executive/setup leaves them as they are here.
struct Without {
  bool pursuit = false, jerk = false;  // of reference_limits.hpp
  bool brake_reserve = false;          // brake.hpp
  bool barriers = false;               // stabiliser.hpp
  bool envelope = false;               // envelope_exceeded
  bool observer = false;               // velocity_observer.hpp: difference quotients instead
};

struct TickConfig {
  Without without{};
  Duration period;  // of the control loop
  std::uint32_t joint_count = 0;
  std::uint32_t bus_count = 0;
  std::uint32_t observation_every_ticks = 0;
  ExpectedPolicy policy;
  Duration probation;  // of tracking: for so long a candidate that was put in charge goes back by itself
  std::uint32_t largest_command = sizeof(CommandChunk);  // bytes of the largest legal message
  Interpolation interpolation = Interpolation::linear;
  JoinRule join;
  double clamped_share = 0.25;  // of the freshness window: more ticks with a target out of range are bad commands
  FreshnessContract freshness;
  DegradedBehaviour degraded = DegradedBehaviour::hold;
  FallbackKind fallback = FallbackKind::pose;
  ExpectedPolicy fallback_policy;
  Duration fallback_longest;                  // how long it may move the robot at one go; 0: without end
  Duration degraded_longest;                  // how long the robot may be degraded at one go; 0: without end
  bool temperature_degrades = false;          // temperature_high leads to degraded; else it is told and nothing more
  std::array<StopRule, kCauseCount> stops{};  // by the cause of a damped stop
  float degraded_speed_scale = 0.3F;          // 0 < .. <= 1
  Duration resume_over;       // >= 0: after tracking begins, speed limits rise from the scale to the full ones
  Duration feedback_timeout;  // a joint silent for longer: feedback_lost
  Duration enable_timeout;    // arming must succeed within it
  FeedbackLimits feedback;
  FollowingLimits following;
  BusFaultLimits bus_faults;
  double late_share = 0.25;            // of the freshness window: more periods late or skipped are an overrun; 1: never
  std::uint32_t unrecorded_limit = 0;  // ticks the recorder may be behind; 0: none is required
  bool has_torque_output = false;      // an output permits torque; it has to do as it is told
  bool joint_fault_takes_torque = false;  // that output drops as soon as a fault takes a joint's power
  ImuConfig imu;
  float rest_velocity = 0.02F;                 // rad/s: below it the damped stop holds position
  std::array<float, 3> gravity{0, 0, -9.81F};  // m/s^2 in the base frame
  bool gravity_compensation = false;
  // No model says what a joint carries, and damping would let it fall: where a stop damps, each joint brakes and holds.
  bool holds_at_once = false;
  std::array<JointConfig, kMaxJoints> joints{};
  std::array<LinkModel, kMaxJoints> links{};
  // Fallback state_feedback: feedback_gains[j][k] of joint k on the torque of joint j.
  std::array<std::array<FeedbackGain, kMaxJoints>, kMaxJoints> feedback_gains{};
};

// A second policy is judged in every tick, and moves the robot while degraded.
constexpr bool has_fallback_policy(const TickConfig& config) {
  return config.degraded == DegradedBehaviour::fallback && config.fallback == FallbackKind::policy;
}

// A policy's held targets go out as they are to a drive that is moved by gains: a path towards one is lag, and the
// distance to it is the torque that the policy means.
constexpr bool plays_held_targets(const TickConfig& config, const JointConfig& joint) {
  const bool by_gains = joint.loop == LoopAt::drive || joint.loop == LoopAt::host_torque;
  return config.interpolation == Interpolation::hold && by_gains;
}

constexpr float rest_velocity_of(const TickConfig& config, std::size_t joint) {
  return config.rest_velocity * config.joints[joint].limits.per_rad;
}

// Those that never have power from us.
constexpr JointMask passive_joints(const TickConfig& config) {
  JointMask mask = 0;
  for (std::size_t j = 0; j < config.joint_count; ++j)
    if (config.joints[j].passive) mask |= bit_of_joint(j);
  return mask;
}

// Observations in memory; the most that fit when max_age asks for more, which the configuration's checks rule out.
constexpr std::uint32_t remembered_observations(const TickConfig& config) {
  const Duration every = config.period * std::max<std::int64_t>(config.observation_every_ticks, 1);
  return static_cast<std::uint32_t>(std::clamp<std::int64_t>(observations_to_remember(config.freshness.max_age, every),
                                                             1, kMaxRememberedObservations));
}

}  // namespace takt::pipeline

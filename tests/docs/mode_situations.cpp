// SPDX-License-Identifier: Apache-2.0
#include "tests/docs/mode_situations.hpp"

#include <fmt/format.h>

#include <algorithm>
#include <cmath>
#include <functional>
#include <limits>

#include "executive/pipeline/mode_machine.hpp"
#include "tests/docs/mode_robot.hpp"

namespace takt::docs {
namespace {

using namespace pipeline;
using pipeline::testing::Rig;

constexpr float kDamping = 2.5F;  // other than gains.kd, so that one can be told from the other
constexpr int kLookAhead = 4000;  // ticks: longer than any joint here takes to come to rest

// Two arms of three joints on one base, each joint with a load to carry.
TickConfig two_arms() {
  TickConfig config = pipeline::testing::robot(6);
  config.gravity_compensation = true;
  config.bus_count = 2;
  for (std::size_t j = 3; j < 6; ++j) config.joints[j].bus = 1;
  config.links[3].parent = -1;
  for (std::size_t j = 0; j < 6; ++j) {
    config.joints[j].damping = kDamping;
    config.links[j].axis = {0, 1, 0};
  }
  config.freshness.stop_after = seconds(60);
  config.freshness.recover_after = seconds(60);
  return config;
}

TickConfig without_model() {
  TickConfig config = two_arms();
  config.gravity_compensation = false;
  config.holds_at_once = true;
  return config;
}

// One that can fall over: without a tree of links every joint hangs on every other.
TickConfig without_model_but_imu() {
  TickConfig config = two_arms();
  config.gravity_compensation = false;
  config.imu.present = true;
  config.imu.timeout = seconds(60);
  config.imu.tilt = config.imu.angular_velocity = 3;
  return config;
}

TickConfig degraded_by(DegradedBehaviour behaviour, FallbackKind fallback = FallbackKind::pose) {
  TickConfig config = two_arms();
  config.degraded = behaviour;
  config.fallback = fallback;
  config.fallback_policy.hash = 2;
  for (std::size_t j = 0; j < 6; ++j) config.feedback_gains[j][j] = {20.0F, 3.0F};
  return config;
}

TickConfig stopped_by(StopManner manner) {
  TickConfig config = degraded_by(DegradedBehaviour::fallback, FallbackKind::policy);
  config.stops[static_cast<std::size_t>(Cause::operator_stop)] = {manner, {}};
  return config;
}

bool is_near(float one, float other, float within = 1e-3F) {
  return std::abs(one - other) <= within;
}

bool asks_for_nothing(const JointSetpoint& setpoint) {
  return setpoint.kp == 0 && setpoint.kd == 0 && setpoint.tau == 0 && setpoint.dq == 0;
}

// Stiffness and damping; "": they are none of these pairs.
std::string gains_of(const JointSetpoint& setpoint, const JointConfig& joint) {
  const auto are = [&](float kp, float kd) { return is_near(setpoint.kp, kp) && is_near(setpoint.kd, kd); };
  if (are(0, 0)) return "0";
  if (are(0, joint.damping)) return "damping";
  if (are(joint.kp, joint.kd)) return "joint's";
  return are(kCommandStiffness, kCommandDamping) ? "command's" : "";
}

std::string torque_of(const JointSetpoint& setpoint, const JointRecord& joint, const TickConfig& config,
                      std::size_t j) {
  const FeedbackGain& gain = config.feedback_gains[j][j];
  const float feedback =
      -gain.position * (joint.q_estimate - config.joints[j].fallback_pose) - gain.velocity * joint.dq_estimate;
  if (setpoint.tau == 0) return "0";
  if (is_near(setpoint.tau, joint.tau_gravity)) return "gravity";
  if (is_near(setpoint.tau, joint.tau_gravity + kCommandTorque)) return "gravity + command's";
  if (is_near(setpoint.tau, feedback, 0.01F)) return "−`fallbacks.NAME.gains` · [q − pose; dq]";
  return "";
}

// One joint's reference from now on, while nothing else changes.
struct Motion {
  bool follows = true, moves_along = true, is_still = true, brakes = true;
  float began = 0, ended = 0, fastest = 0;
};

Motion watch(Robot& robot, std::size_t j) {
  Motion motion;
  motion.began = robot.out->record.joints[j].q_reference;
  float before = robot.out->record.joints[j].dq_reference;
  for (int tick = 0; tick < kLookAhead; ++tick) {
    const Mode mode = robot.mode();
    robot.go(1);
    if (robot.mode() != mode) break;
    const JointRecord& joint = robot.out->record.joints[j];
    const JointLimits& limits = robot.config.joints[j].limits;
    const float inside =
        std::clamp(joint.q_estimate, limits.q_min - limits.q_hard_margin, limits.q_max + limits.q_hard_margin);
    const bool at_joint = is_near(joint.q_reference, inside, 1e-5F);
    const float step = limits.acceleration * 0.001F * 1.001F;
    motion.follows &= tick >= 5 || (at_joint && joint.dq_reference == 0);
    motion.moves_along &= tick >= 5 || (at_joint && is_near(joint.dq_reference, joint.dq_estimate));
    motion.is_still &= joint.q_reference == motion.began && joint.dq_reference == 0;
    motion.brakes &= std::abs(joint.dq_reference) <= std::abs(before) && std::abs(before - joint.dq_reference) <= step;
    motion.fastest = std::max(motion.fastest, std::abs(joint.dq_reference));
    motion.ended = joint.q_reference;
    before = joint.dq_reference;
  }
  motion.brakes &= before == 0;
  return motion;
}

std::string reference_of(Robot& robot, std::size_t j, Player player, float stiffness) {
  const JointConfig& joint = robot.config.joints[j];
  const float apart = std::abs(robot.out->record.joints[j].q_reference - robot.out->record.joints[j].q_estimate);
  const bool is_degraded = robot.mode() == Mode::degraded;
  const Motion motion = watch(robot, j);
  if (motion.follows && stiffness == 0) return "the measured position";
  if (motion.moves_along && stiffness == 0) return "moves with the measured motion";
  if (player == Player::fallback) return "the fallback policy's path";
  const float slow = robot.config.degraded_speed_scale * joint.limits.velocity;
  if (player == Player::policy && is_degraded && is_near(motion.fastest, slow))
    return "the policy's path, at most `degraded.speed_scale` of `limits.velocity`";
  if (player == Player::policy) return "the policy's path";
  if (motion.is_still) return apart > 0.05F ? "stays at the last target" : "stays where it came to rest";
  if (motion.brakes) return "brakes";
  if (is_near(motion.ended, joint.fallback_pose, 0.01F) && is_near(motion.fastest, joint.fallback_speed))
    return "moves to `fallbacks.NAME.pose` at `fallbacks.NAME.speed`";
  return "";
}

// What joint `j` is given in the newest tick; `late`: in place of a setpoint that would leave too late.
Given given(Robot& robot, std::size_t j, bool late = false) {
  const TickOutput& out = *robot.out;
  const JointSetpoint setpoint = late ? out.damping[j] : out.setpoints[j];
  const JointConfig& joint = robot.config.joints[j];
  Given words;
  words.gains = gains_of(setpoint, joint);
  words.torque = torque_of(setpoint, out.record.joints[j], robot.config, j);
  const bool is_limp = asks_for_nothing(setpoint);
  if (is_limp || late) words.reference = is_limp ? "none" : "the measured position";
  if (is_limp && !out.drive_enabled[j]) words.reference = "none, drive off";
  if (words.reference.empty()) words.reference = reference_of(robot, j, out.record.header.player, setpoint.kp);
  return words;
}

bool is_complete(const Given& words) {
  return !words.reference.empty() && !words.gains.empty() && !words.torque.empty();
}

struct Setup {
  std::string_view mode, when;
  Mode reached;
  std::size_t joint;
  std::function<TickConfig()> config;
  std::function<void(Robot&)> reach;
  bool late = false;
};

void lose_a_drive(Robot& robot) {
  robot.track();
  robot.drives[4].fault = true;
  robot.go(20);
}

TickConfig with_a_long_gap(Interpolation interpolation) {
  TickConfig config = two_arms();
  config.interpolation = interpolation;
  config.freshness.epsilon = 0.5;
  config.freshness.window_ticks = 8000;
  return config;
}

void reach_the_gap(Robot& robot) {
  robot.track();
  robot.speaks = false;
  robot.go_until_unusable();
  robot.go(60);
}

// Of the same mode in the order of time.
std::vector<Setup> setups() {
  using enum Mode;
  return {
      {"standby", "always", standby, 0, two_arms, [](Robot& robot) { robot.go(100); }},
      {"arming", "until all drives are enabled and a command is usable", arming, 0, two_arms,
       [](Robot& robot) {
         robot.drives[5].never_enables = true;
         robot.go(40);
         robot.go(60, OperatorRequest::arm);
         robot.drives[0].dq = 0.2F;
         robot.go(2);
       }},
      {"tracking", "a usable command", tracking, 0, two_arms, [](Robot& robot) { robot.track(); }},
      {"tracking", "no usable command, before the violation", tracking, 0,
       [] { return with_a_long_gap(Interpolation::linear); }, reach_the_gap},
      {"tracking", "the same, `interpolation: hold`, a drive that takes gains", tracking, 0,
       [] { return with_a_long_gap(Interpolation::hold); },
       [](Robot& robot) {
         robot.track();
         robot.go(2000);
         while (!robot.out->observation_due) robot.go(1);
         robot.wants = 1.1F;  // a new step, which the joint is still far from
         robot.go(1);
         robot.speaks = false;
         robot.config.freshness.max_age = milliseconds(2);
         robot.go(8);
       }},
      {"degraded", "`behaviour: hold`, no usable command", degraded, 0,
       [] { return degraded_by(DegradedBehaviour::hold); }, [](Robot& robot) { robot.degrade(); }},
      {"degraded", "with one", degraded, 0, [] { return degraded_by(DegradedBehaviour::hold); },
       [](Robot& robot) {
         robot.degrade();
         robot.speaks = true;
         robot.go(30);
       }},
      {"degraded", "`behaviour: slow`, a usable command", degraded, 0,
       [] { return degraded_by(DegradedBehaviour::slow); },
       [](Robot& robot) {
         robot.degrade();
         robot.go(400);
         robot.speaks = true;
         robot.wants = -0.9F;
         robot.go(200);
       }},
      {"degraded", "`behaviour: slow`, no usable command", degraded, 0,
       [] { return degraded_by(DegradedBehaviour::slow); }, [](Robot& robot) { robot.degrade(); }},
      {"degraded", "fallback `pose`", degraded, 0, [] { return degraded_by(DegradedBehaviour::fallback); },
       [](Robot& robot) {
         robot.degrade();
         robot.go(800);
       }},
      {"degraded", "fallback `state_feedback`", degraded, 0,
       [] { return degraded_by(DegradedBehaviour::fallback, FallbackKind::state_feedback); },
       [](Robot& robot) {
         robot.degrade();
         robot.go(20);
       }},
      {"degraded", "fallback `policy`, its command usable", degraded, 0,
       [] { return degraded_by(DegradedBehaviour::fallback, FallbackKind::policy); },
       [](Robot& robot) {
         robot.degrade();
         robot.go(20);
       }},
      {"degraded", "the same, only the policy's command usable", degraded, 0,
       [] { return degraded_by(DegradedBehaviour::fallback, FallbackKind::policy); },
       [](Robot& robot) {
         robot.degrade();
         robot.fallback_speaks = false;
         robot.speaks = true;
         robot.go(200);
       }},
      {"degraded", "the same, neither usable", degraded, 0,
       [] { return degraded_by(DegradedBehaviour::fallback, FallbackKind::policy); },
       [](Robot& robot) {
         robot.track();
         robot.fallback_speaks = false;
         robot.go(40);
         robot.speaks = false;
         robot.go_until(Mode::degraded);
         robot.go(50);
       }},
      {"damped_stop", "`how: rest`, until the robot rests", damped_stop, 0, [] { return stopped_by(StopManner::rest); },
       [](Robot& robot) { robot.stop(); }},
      {"damped_stop", "`how: rest`, from then on", damped_stop, 0, [] { return stopped_by(StopManner::rest); },
       [](Robot& robot) {
         robot.stop();
         robot.go(3000);
       }},
      {"damped_stop", "`how: rest`, neither `model` nor `imu`", damped_stop, 0, without_model,
       [](Robot& robot) { robot.stop(); }},
      {"damped_stop", "`how: damping`", damped_stop, 0, [] { return stopped_by(StopManner::damping); },
       [](Robot& robot) {
         robot.stop();
         robot.go(3000);
         robot.drives[0].dq = 0.3F;
         robot.go(2);
       }},
      {"damped_stop", "`how: hold`", damped_stop, 0, [] { return stopped_by(StopManner::hold); },
       [](Robot& robot) { robot.stop(); }},
      {"damped_stop", "`how: policy`, its command usable", damped_stop, 0,
       [] { return stopped_by(StopManner::policy); }, [](Robot& robot) { robot.stop(); }},
      {"damped_stop, fault_latched", "a joint beyond its `position_margin`", damped_stop, 0,
       [] {
         TickConfig config = two_arms();
         config.feedback = {0, 0, {}};
         return config;
       },
       [](Robot& robot) {
         robot.track();
         robot.drives[0].q = robot.config.joints[0].limits.q_max + 0.3F;
         robot.drives[0].dq = 0;
         robot.go(3000);
         robot.drives[0].dq = -0.1F;
         robot.go(2);
       }},
      {"fault_latched", "a joint that the fault is about", fault_latched, 4, two_arms, lose_a_drive},
      {"fault_latched", "what hangs on it", fault_latched, 5, two_arms, lose_a_drive},
      {"fault_latched", "the rest of its limb", fault_latched, 3, two_arms, lose_a_drive},
      {"fault_latched", "the other limbs, until they rest", fault_latched, 0, two_arms, lose_a_drive},
      {"fault_latched", "the other limbs, from then on", fault_latched, 0, two_arms,
       [](Robot& robot) {
         lose_a_drive(robot);
         robot.go(3000);
       }},
      {"fault_latched", "every other joint, neither `model` nor `imu`", fault_latched, 0, without_model, lose_a_drive},
      {"fault_latched", "every other joint, `imu` and no `model`, also at rest", fault_latched, 0,
       without_model_but_imu,
       [](Robot& robot) {
         robot.input.imu.sequence = 1;
         robot.input.imu.sensed_at = robot.now;
         robot.input.imu.rotation[0] = 1;
         robot.input.imu.acceleration[2] = 9.81F;
         lose_a_drive(robot);
         robot.go(3000);
         robot.drives[0].dq = 0.3F;
         robot.go(2);
       }},
      {"fault_latched", "after `internal_error`, every joint", fault_latched, 0, two_arms,
       [](Robot& robot) {
         robot.track();
         const JointConfig sound = robot.config.joints[1];
         robot.config.joints[1].kp = robot.config.joints[1].damping = std::numeric_limits<float>::quiet_NaN();
         robot.speaks = false;  // the default gains apply
         robot.go_until(Mode::fault_latched);
         robot.config.joints[1] = sound;
         robot.drives[0].dq = 0.3F;
         robot.go(20);
       }},
      {"fault_latched", "a joint not heard since a suspend", fault_latched, 0, two_arms,
       [](Robot& robot) {
         robot.track();
         robot.input.slept_ms = 500;
         for (Rig::Drive& drive : robot.drives) drive.silent = true;
         robot.go(1);
         robot.input.slept_ms = 0;
       }},
      {"any but standby", "a setpoint that would leave late (in csp: the last one)", tracking, 0, two_arms,
       [](Robot& robot) {
         robot.track();
         robot.late = 1;
         robot.go(40);
       },
       true},
      {"any", "a joint with `passive: true`", tracking, 5,
       [] {
         TickConfig config = two_arms();
         config.joints[5].passive = true;
         config.links[5].mass = 0;
         config.clamped_share = 1;
         return config;
       },
       [](Robot& robot) { robot.track(); }},
  };
}

}  // namespace

std::expected<std::vector<Situation>, std::string> measure_situations() {
  std::vector<Situation> found;
  for (const Setup& setup : setups()) {
    Robot robot(setup.config());
    setup.reach(robot);
    if (robot.mode() != setup.reached)
      return std::unexpected(failed(setup.mode, setup.when, fmt::format("reached {}", name(robot.mode()))));
    const JointSetpoint at = robot.out->setpoints[setup.joint];
    const JointRecord joint = robot.out->record.joints[setup.joint];
    Situation situation{setup.mode, setup.when, given(robot, setup.joint, setup.late)};
    if (!is_complete(situation.given))
      return std::unexpected(
          failed(setup.mode, setup.when,
                 fmt::format("kp {} kd {} tau {} (gravity {}, interventions {:#x}), reference '{}'", at.kp, at.kd,
                             at.tau, joint.tau_gravity, joint.interventions, situation.given.reference)));
    found.push_back(std::move(situation));
  }
  return found;
}

}  // namespace takt::docs

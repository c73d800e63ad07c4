// SPDX-License-Identifier: Apache-2.0
#include "executive/setup/tick_config_of.hpp"

#include <algorithm>
#include <cmath>

#include "config/cautions.hpp"
#include "config/drive_loop.hpp"
#include "config/observation_shape.hpp"
#include "config/stop_causes.hpp"
#include "config/turns.hpp"
#include "executive/pipeline/mode_machine.hpp"

namespace takt::setup {
namespace {

static_assert(config::kMaxWindowTicks == pipeline::kMaxWindowTicks);

float narrow(double value) {
  return static_cast<float>(value);
}

std::array<float, 3> narrow(const config::Vector3& v) {
  return {narrow(v[0]), narrow(v[1]), narrow(v[2])};
}

// Fixed-axis roll, pitch, yaw: R = Rz(yaw) Ry(pitch) Rx(roll), row-major.
std::array<float, 9> rotation_of(const config::Vector3& rpy) {
  const double cr = std::cos(rpy[0]), sr = std::sin(rpy[0]);
  const double cp = std::cos(rpy[1]), sp = std::sin(rpy[1]);
  const double cy = std::cos(rpy[2]), sy = std::sin(rpy[2]);
  return {narrow(cy * cp),
          narrow(cy * sp * sr - sy * cr),
          narrow(cy * sp * cr + sy * sr),
          narrow(sy * cp),
          narrow(sy * sp * sr + cy * cr),
          narrow(sy * sp * cr - cy * sr),
          narrow(-sp),
          narrow(cp * sr),
          narrow(cp * cr)};
}

pipeline::LoopAt loop_of(const config::Drive& drive) {
  switch (config::loop_closed_by(drive)) {
    case config::LoopClosedBy::drive:
      return drive.protocol == config::DriveProtocol::cia402 ? pipeline::LoopAt::drive_position
                                                             : pipeline::LoopAt::drive;
    case config::LoopClosedBy::host_torque:
      return pipeline::LoopAt::host_torque;
    case config::LoopClosedBy::host_velocity:
      return pipeline::LoopAt::host_velocity;
  }
  return pipeline::LoopAt::host_torque;
}

pipeline::JointConfig joint_of(const config::Joint& from) {
  pipeline::JointConfig to;
  to.limits = {.q_min = narrow(from.limits.q_min),
               .q_max = narrow(from.limits.q_max),
               .velocity = narrow(from.limits.velocity),
               .acceleration = narrow(from.limits.acceleration),
               .torque = narrow(from.limits.torque),
               .torque_rate = narrow(from.limits.torque_rate),
               .kp_max = narrow(from.limits.kp),
               .kd_max = narrow(from.limits.kd),
               .q_hard_margin = narrow(from.limits.position_margin),
               .velocity_hard = narrow(from.limits.velocity_hard),
               .target_margin = narrow(from.limits.target_margin),
               .per_rad = narrow(config::per_rad(from))};
  if (const auto& limits = from.limits.temperature)
    to.temperature = {narrow(limits->warning), narrow(limits->stop), narrow(limits->casing_warning),
                      narrow(limits->casing_stop)};
  to.kp = narrow(from.kp);
  to.kd = narrow(from.kd);
  to.damping = narrow(from.damping);
  to.inertia = narrow(from.inertia);
  to.inertia_max = narrow(from.inertia_max);
  to.following_error = narrow(from.limits.following_error);
  to.home = narrow(from.home);
  to.fallback_pose = to.home;
  to.observer_bandwidth = narrow(from.observer_bandwidth);
  to.bus = static_cast<std::uint8_t>(from.bus);
  to.passive = from.passive;
  set_loop(from.drive, to);
  return to;
}

pipeline::LinkModel link_of(const config::Link& from, const config::Joint& joint) {
  const double length = std::hypot(from.axis[0], from.axis[1], from.axis[2]);
  const config::Vector3 unit_axis{from.axis[0] / length, from.axis[1] / length, from.axis[2] / length};
  return {.parent = from.parent,
          .origin_xyz = narrow(from.origin_xyz),
          .origin_rotation = rotation_of(from.origin_rpy),
          .axis = narrow(unit_axis),
          .slides = joint.kind == config::JointKind::slide,
          .farthest = narrow(std::max(std::abs(joint.limits.q_min), std::abs(joint.limits.q_max))),
          .mass = narrow(from.mass),
          .com = narrow(from.com)};
}

pipeline::FreshnessContract contract_of(const config::Freshness& from, Duration degrade_after, Duration period) {
  return {.max_age = from.max_age,
          .aging_fraction = narrow(from.aging_fraction),
          .epsilon = from.epsilon,
          .window_ticks = static_cast<std::uint32_t>(from.window.ns / period.ns),
          .recover_after = from.recover_after,
          .flap_memory = from.flap_memory,
          .stop_after = from.stop_after,
          .degrade_after = degrade_after,
          .bad_command_limit = from.bad_command_limit};
}

pipeline::BusFaultLimits bus_faults_of(const config::BusFaults& from, Duration period) {
  using pipeline::share_of_ticks;
  return {.window_ticks = static_cast<std::uint32_t>(
              std::min<std::int64_t>(from.window.ns / period.ns, pipeline::kMaxBusFaultTicks)),
          .replies_lost = share_of_ticks(from.replies_lost),
          .replies_repeated = share_of_ticks(from.replies_repeated),
          .replies_delayed = share_of_ticks(from.replies_delayed),
          .transmit_drops = share_of_ticks(from.transmit_drops),
          .receive_drops = share_of_ticks(from.receive_drops),
          .foreign_frames = share_of_ticks(from.foreign_frames),
          .babble = share_of_ticks(from.babble),
          .error_passive = share_of_ticks(from.error_passive)};
}

pipeline::DegradedBehaviour behaviour_of(config::Degraded behaviour) {
  switch (behaviour) {
    case config::Degraded::hold:
      return pipeline::DegradedBehaviour::hold;
    case config::Degraded::slow:
      return pipeline::DegradedBehaviour::slow;
    case config::Degraded::fallback:
      return pipeline::DegradedBehaviour::fallback;
  }
  return pipeline::DegradedBehaviour::hold;
}

pipeline::FollowingReaction following_of(config::Following following) {
  switch (following) {
    case config::Following::warn:
      return pipeline::FollowingReaction::warn;
    case config::Following::degrade:
      return pipeline::FollowingReaction::degrade;
    case config::Following::stop:
      return pipeline::FollowingReaction::stop;
  }
  return pipeline::FollowingReaction::stop;
}

pipeline::Interpolation interpolation_of(config::Interpolation interpolation) {
  switch (interpolation) {
    case config::Interpolation::hold:
      return pipeline::Interpolation::hold;
    case config::Interpolation::linear:
      return pipeline::Interpolation::linear;
    case config::Interpolation::cubic:
      return pipeline::Interpolation::cubic;
  }
  return pipeline::Interpolation::linear;
}

pipeline::JoinKind kind_of(config::JoinKind kind) {
  switch (kind) {
    case config::JoinKind::cross_fade:
      return pipeline::JoinKind::cross_fade;
    case config::JoinKind::replace:
    case config::JoinKind::blend:  // what comes was mixed by its host (policy_host/chunk_mixer.hpp)
    case config::JoinKind::ensemble:
    case config::JoinKind::align:
    case config::JoinKind::quintic:
      return pipeline::JoinKind::replace;
    case config::JoinKind::prefix:
      return pipeline::JoinKind::prefix;
  }
  return pipeline::JoinKind::replace;
}

pipeline::JoinRule join_of(const config::Join& from) {
  return {.kind = kind_of(from.kind), .over = from.over, .longest_delay = from.longest};
}

pipeline::FallbackKind kind_of(config::FallbackKind kind) {
  switch (kind) {
    case config::FallbackKind::pose:
      return pipeline::FallbackKind::pose;
    case config::FallbackKind::state_feedback:
      return pipeline::FallbackKind::state_feedback;
    case config::FallbackKind::policy:
      return pipeline::FallbackKind::policy;
  }
  return pipeline::FallbackKind::pose;
}

pipeline::ImuConfig imu_of(const config::RobotConfig& robot) {
  const auto sensor = std::ranges::find(robot.sensors, robot.imu->sensor, &config::Sensor::name);
  return {.present = true,
          .timeout = sensor->timeout,
          .frozen_after = robot.imu->frozen_after,
          .contradiction = narrow(robot.imu->contradiction),
          .tilt = narrow(robot.imu->tilt),
          .angular_velocity = narrow(robot.imu->angular_velocity)};
}

pipeline::StopManner manner_of(config::StopHow how) {
  switch (how) {
    case config::StopHow::rest:
      return pipeline::StopManner::rest;
    case config::StopHow::damping:
      return pipeline::StopManner::damping;
    case config::StopHow::hold:
      return pipeline::StopManner::hold;
    case config::StopHow::policy:
      return pipeline::StopManner::policy;
  }
  return pipeline::StopManner::rest;
}

// The causes a robot file may name are those of the table.
static_assert(std::ranges::all_of(pipeline::kReactions, [](const pipeline::Reaction& row) {
  return pipeline::may_damp(row) == (std::ranges::find(config::kStopCauses, row.cause) != config::kStopCauses.end());
}));

static_assert(std::ranges::all_of(config::kPolicyStopCauses, [](Cause cause) {
  return pipeline::may_damp(pipeline::reaction(cause)) &&
         pipeline::reaction(cause).severity <= pipeline::reaction(Cause::operator_stop).severity;
}));

void set_stops(const config::RobotConfig& robot, pipeline::TickConfig& tick) {
  for (const config::StopConfig& stop : robot.stops)
    tick.stops[static_cast<std::size_t>(config::stop_cause_named(stop.name))] = {manner_of(stop.how), stop.longest};
}

void set_fallback(const config::RobotConfig& robot, std::uint64_t fallback_hash, pipeline::TickConfig& tick) {
  const auto chosen = std::ranges::find(robot.fallbacks, robot.degraded.fallback, &config::Fallback::name);
  if (chosen == robot.fallbacks.end()) return;
  tick.fallback = kind_of(chosen->kind);
  if (const config::Fallback* policy = config::fallback_policy_of(robot)) {
    tick.fallback_policy = {fallback_hash, config::reads_sensors(*seen_by_fallback(robot, *policy).policy)};
    tick.fallback_longest = policy->longest;
  }
  if (chosen->kind == config::FallbackKind::policy) return;
  for (std::size_t j = 0; j < robot.joints.size(); ++j) {
    tick.joints[j].fallback_pose = narrow(chosen->pose[j]);
    tick.joints[j].fallback_speed =
        narrow(robot.joints[j].kind == config::JointKind::slide ? chosen->slide_speed : chosen->speed);
  }
  for (const config::FeedbackRow& row : chosen->gains) {
    for (std::size_t k = 0; k < robot.joints.size(); ++k)
      tick.feedback_gains[row.joint][k] = {narrow(row.position[k]), narrow(row.velocity[k])};
  }
}

}  // namespace

void set_loop(const config::Drive& drive, pipeline::JointConfig& joint) {
  joint.loop = loop_of(drive);
  joint.tells_velocity = drive.protocol != config::DriveProtocol::cia402;
  if (drive.protocol != config::DriveProtocol::moteus) return;
  const double square = drive.gear_ratio * drive.gear_ratio;
  joint.drive_gains = {.kp = narrow(drive.servo_kp * square), .kd = narrow(drive.servo_kd * square)};
}

pipeline::TickConfig tick_config_of(const config::RobotConfig& robot, std::uint64_t policy_hash,
                                    std::uint64_t fallback_hash) {
  pipeline::TickConfig tick;
  tick.period = robot.control.period;
  tick.joint_count = static_cast<std::uint32_t>(robot.joints.size());
  tick.bus_count = static_cast<std::uint32_t>(robot.buses.size());
  if (robot.policy) {
    tick.observation_every_ticks = static_cast<std::uint32_t>(robot.policy->period.ns / robot.control.period.ns);
    tick.interpolation = interpolation_of(robot.policy->action.interpolation);
    tick.join = join_of(robot.policy->action.join);
    tick.probation = robot.policy->probation;
    tick.policy.needs_outside_stamp = config::reads_sensors(*robot.policy);
  }
  tick.policy.hash = policy_hash;
  tick.largest_command = static_cast<std::uint32_t>(config::largest_command_of(robot));
  tick.clamped_share = robot.freshness.clamped_share;
  tick.freshness = contract_of(robot.freshness, robot.degraded.after, robot.control.period);
  tick.degraded = behaviour_of(robot.degraded.behaviour);
  tick.degraded_speed_scale = narrow(robot.degraded.speed_scale);
  tick.resume_over = robot.degraded.resume_over;
  tick.degraded_longest = robot.degraded.longest;
  tick.temperature_degrades = robot.degraded.by_temperature;
  tick.feedback_timeout = robot.feedback.timeout;
  tick.enable_timeout = robot.feedback.enable_timeout;
  tick.feedback = {narrow(robot.feedback.jump), narrow(robot.feedback.contradiction), robot.feedback.frozen_after};
  tick.following = {robot.feedback.following_timeout, following_of(robot.feedback.following)};
  tick.bus_faults = bus_faults_of(robot.bus_faults, robot.control.period);
  tick.late_share = robot.control.late_share;
  tick.unrecorded_limit = robot.record.recorder == config::Recorder::required ? pipeline::kLongestUnrecorded : 0;
  tick.rest_velocity = narrow(robot.feedback.rest_velocity);
  tick.has_torque_output = robot.safe_torque_off.has_value();
  tick.joint_fault_takes_torque =
      robot.safe_torque_off && robot.safe_torque_off->on_joint_fault == config::OnJointFault::drop;
  for (std::size_t j = 0; j < robot.joints.size(); ++j) tick.joints[j] = joint_of(robot.joints[j]);
  const std::vector<Turns> turns = config::turns_of(robot);
  for (std::size_t j = 0; j < robot.joints.size(); ++j) tick.joints[j].turns = turns[j];
  set_fallback(robot, fallback_hash, tick);
  set_stops(robot, tick);
  if (robot.imu) tick.imu = imu_of(robot);
  if (robot.model) {
    tick.gravity = narrow(robot.model->gravity);
    tick.gravity_compensation = true;
    for (std::size_t j = 0; j < robot.model->links.size(); ++j)
      tick.links[j] = link_of(robot.model->links[j], robot.joints[j]);
  }
  tick.holds_at_once = config::holds_at_once(robot);
  return tick;
}

}  // namespace takt::setup

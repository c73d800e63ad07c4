// SPDX-License-Identifier: Apache-2.0
#include "drivers/guard/joint_facts.hpp"

#include <algorithm>
#include <cmath>
#include <numbers>

#include "config/turns.hpp"

namespace takt::drivers::guard {
namespace {

using config::DriveProtocol;

constexpr float kSteps12 = 4095, kSteps16 = 65535;
// One step lost by truncation, and a little for the float32 arithmetic before it.
constexpr float kOneStep = 1.1F;
// A saturated mit command loses one more step of stiffness, so that it cannot be taken for a special frame.
constexpr float kTwoSteps = 2.1F;
constexpr float kFloatRounding = 1e-6F;  // of a float32 after a handful of operations on either side of the wire

float narrow(double value) {
  return static_cast<float>(value);
}

Law law_of(const config::Drive& drive) {
  switch (drive.protocol) {
    case DriveProtocol::mit:
    case DriveProtocol::robstride:
    case DriveProtocol::moteus:
      return Law::fields;
    case DriveProtocol::odrive:
      return Law::torque;
    case DriveProtocol::cia402:
      switch (drive.mode) {
        case config::Cia402Mode::cst:
          return Law::torque;
        case config::Cia402Mode::csv:
          return Law::velocity;
        case config::Cia402Mode::csp:
          return Law::position;
      }
  }
  return Law::torque;
}

// Joint side of what the wire rounds away on the motor side.
Motion across_gear(const Motion& motor, float ratio) {
  const float gear = std::abs(ratio);
  return {motor.q / gear, motor.dq / gear, motor.kp * gear * gear, motor.kd * gear * gear, motor.tau * gear};
}

Motion packed_steps(const JointFacts& facts, float gain_steps, float value_steps) {
  const Motion& range = facts.range;
  return across_gear(
      {kOneStep * 2 * range.q / kSteps16, kOneStep * 2 * range.dq / value_steps, kTwoSteps * range.kp / gain_steps,
       kOneStep * range.kd / gain_steps, kOneStep * 2 * range.tau / value_steps},
      facts.ratio);
}

Motion wire_rounding(const JointFacts& facts) {
  const float count = narrow(facts.rad_per_count);
  switch (facts.protocol) {
    case DriveProtocol::mit:  // position has 16 bits, everything else 12
      return packed_steps(facts, kSteps12, kSteps12);
    case DriveProtocol::robstride:
      return packed_steps(facts, kSteps16, kSteps16);
    case DriveProtocol::odrive:
    case DriveProtocol::moteus:
      return {};  // float32
    case DriveProtocol::cia402:
      // Rounded to the nearest count and per mille; the drive's largest torque is rounded down.
      return across_gear({count, narrow(facts.rad_s_per_count), 0, 0, kOneStep * facts.torque_per_mille}, facts.ratio);
  }
  return {};
}

void set_limits(const config::Joint& joint, Duration period, JointFacts& facts) {
  const config::Limits& limits = joint.limits;
  facts.q_low = narrow(limits.q_min - limits.position_margin);
  facts.q_high = narrow(limits.q_max + limits.position_margin);
  facts.velocity = narrow(limits.velocity);
  facts.position_step = narrow(limits.velocity * period.seconds());
  facts.velocity_hard = narrow(limits.velocity_hard);
  facts.damping = narrow(joint.damping);
  if (joint.passive) return;  // no gains, no torque
  facts.torque = narrow(limits.torque);
  facts.torque_step = narrow(limits.torque_rate * period.seconds());
  facts.kp = narrow(limits.kp);
  facts.kd = narrow(limits.kd);
}

// A drive with a position loop of its own watches it where the robot file stops the robot for a joint that is behind.
void set_following(const config::RobotConfig& robot, const config::Joint& joint, JointFacts& facts) {
  const config::FeedbackConfig& feedback = robot.feedback;
  if (facts.law != Law::position || feedback.following != config::Following::stop || feedback.following_timeout.ns <= 0)
    return;
  const double given = joint.limits.following_error;
  const double of_joint = given > 0 ? given : joint.kp > 0 ? 0.9 * joint.limits.torque / joint.kp : 0;
  facts.following_window = of_joint * std::abs(facts.ratio);
  facts.following_timeout_ms =
      static_cast<std::uint32_t>(std::min(2 * feedback.following_timeout.ns / 1'000'000, std::int64_t{65'535}));
}

// The largest power of ten, down to whole microseconds, of which the period is 1 to 255.
void set_interpolation(Duration period, JointFacts& facts) {
  std::int64_t unit = 1'000'000'000;
  for (int exponent = 0; exponent >= -6; --exponent, unit /= 10) {
    const std::int64_t value = period.ns / unit;
    if (value < 1 || value > 255 || value * unit != period.ns) continue;
    facts.interpolation_value = static_cast<std::uint8_t>(value);
    facts.interpolation_exponent = static_cast<std::uint8_t>(exponent);
    return;
  }
}

// One count of object 60FF, rad/s.
double speed_step(const config::Drive& drive, double rad_per_count) {
  constexpr double kRpm = 2 * std::numbers::pi / 60;
  switch (drive.velocity_unit) {
    case config::Cia402VelocityUnit::counts_per_s:
      return rad_per_count;
    case config::Cia402VelocityUnit::rpm:
      return kRpm;
    case config::Cia402VelocityUnit::tenth_rpm:
      return kRpm / 10;
    case config::Cia402VelocityUnit::hundredth_rpm:
      return kRpm / 100;
    case config::Cia402VelocityUnit::thousandth_rpm:
      return kRpm / 1000;
  }
  return 0;
}

void set_drive(const config::Drive& drive, JointFacts& facts) {
  facts.protocol = drive.protocol;
  facts.mode = drive.mode;
  facts.law = law_of(drive);
  facts.damiao = drive.variant == "damiao";
  facts.fd = drive.fd_bitrate != 0;
  facts.id = drive.id;
  facts.host = drive.host_id;
  facts.ratio = narrow(drive.direction * drive.gear_ratio);
  facts.offset = narrow(drive.offset);
  facts.range = {narrow(drive.position_range), narrow(drive.velocity_range), narrow(drive.kp_range),
                 narrow(drive.kd_range), narrow(drive.torque_range)};
  facts.servo_kp = narrow(drive.servo_kp);
  facts.servo_kd = narrow(drive.servo_kd);
  facts.torque_range = narrow(drive.torque_range);
  facts.torque_per_mille = narrow(drive.rated_torque / 1000);
  if (drive.counts_per_turn != 0) facts.rad_per_count = 2 * std::numbers::pi / drive.counts_per_turn;
  facts.rad_s_per_count = speed_step(drive, facts.rad_per_count);
}

}  // namespace

JointFacts facts_of(const config::RobotConfig& robot, std::size_t index) {
  const config::Joint& joint = robot.joints[index];
  JointFacts facts;
  facts.bus = joint.bus;
  set_drive(joint.drive, facts);
  set_limits(joint, config::turn_of(robot, joint), facts);
  set_interpolation(robot.control.period, facts);
  set_following(robot, joint, facts);
  // docs/drives.md: a moteus stops by itself after the rest of the command's life, but no sooner than this.
  facts.shortest_watchdog = std::clamp(robot.feedback.timeout, milliseconds(20), milliseconds(100));
  facts.rounding = wire_rounding(facts);
  const float farthest = std::max(std::abs(facts.q_low), std::abs(facts.q_high)) + std::abs(facts.offset);
  facts.rounding.q += kFloatRounding * farthest;
  facts.rounding.dq += kFloatRounding * facts.velocity;
  facts.rounding.kp += kFloatRounding * facts.kp;
  facts.rounding.kd += kFloatRounding * facts.kd;
  facts.rounding.tau += 1e-3F * facts.torque;
  return facts;
}

}  // namespace takt::drivers::guard

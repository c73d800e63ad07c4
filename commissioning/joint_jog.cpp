// SPDX-License-Identifier: Apache-2.0
#include "commissioning/joint_jog.hpp"

#include <algorithm>
#include <array>
#include <cmath>
#include <cstdio>
#include <utility>

#include "commissioning/led_joint.hpp"
#include "config/drive_loop.hpp"
#include "drivers/protocol/protocol_table.hpp"

namespace takt::commissioning {
namespace {

// In which the drive packs its velocity, joint side; 0: it says it in full.
double velocity_step(const config::Drive& drive) {
  const double span = 2 * drive.velocity_range / drive.gear_ratio;
  switch (drive.protocol) {
    case config::DriveProtocol::mit:
      return span / 4095;
    case config::DriveProtocol::robstride:
      return span / 65535;
    case config::DriveProtocol::odrive:
    case config::DriveProtocol::moteus:
    case config::DriveProtocol::cia402:
      return 0;
  }
  return 0;
}

std::string three_decimals(double value) {
  std::array<char, 32> text{};
  std::snprintf(text.data(), text.size(), "%.3f", value);
  return text.data();
}

bool drives(JointJog::Phase phase) {
  return phase == JointJog::Phase::moving || phase == JointJog::Phase::settling;
}

}  // namespace

JointJog::JointJog(const config::Joint& joint, const JogWish& wish, drivers::JointDriver& driver, GravityTerm gravity)
    : joint_(joint),
      wish_(wish),
      driver_(driver),
      gravity_(std::move(gravity)),
      fit_(velocity_step(joint.drive), joint.kind) {
  if (joint.drive.protocol == config::DriveProtocol::cia402) scale_.emplace(joint.drive);
}

void JointJog::enter(Phase phase, MonoTime now) {
  phase_ = phase;
  entered_ = now;
}

void JointJog::fail(const std::string& why, MonoTime now) {
  failure_ = why;
  enter(Phase::releasing, now);
}

void JointJog::stop() {
  stopping_ = true;
}

void JointJog::take(const drivers::CanFrame& frame) {
  if (scale_) scale_->take(frame);
}

// Of the motor, by the drive's own word: its driver makes a velocity of the very positions.
void JointJog::take_velocity() {
  const JointFeedback& feedback = driver_.feedback();
  if (!scale_) return fit_.take(feedback.received_at, feedback.q, feedback.dq);
  if (const auto motor = scale_->take_velocity())
    fit_.take(feedback.received_at, feedback.q, *motor * joint_.drive.direction / joint_.drive.gear_ratio);
}

VelocityScale JointJog::velocity_scale() const {
  VelocityScale found = fit_.judge();
  if (!scale_ || found.verdict == VelocityScale::Verdict::not_judged) return found;
  if (found.verdict == VelocityScale::Verdict::wrong)
    found.sentence = "the drive's position (6064) changes by " + three_decimals(found.scale) +
                     " of what its velocity (606C) says: counts_per_turn is not the drive's, or the unit of 606C is "
                     "another than 60A9 says";
  if (scale_->knows_velocity_unit()) return found;
  return {.sentence = "its velocity (606C) is not judged: the drive does not tell its unit (60A9)"};
}

std::optional<OwnScale> JointJog::own_scale() const {
  return scale_ ? std::optional(scale_->judge()) : std::nullopt;
}

std::string JointJog::believed() const {
  const auto own = own_scale();
  const bool counts = own && own->verdict == OwnScale::Verdict::not_judged;
  const bool has_gear = joint_.kind == config::JointKind::slide || joint_.drive.gear_ratio != 1;
  const bool gear = has_gear && !(own && own->with_gear);
  return std::string(gear ? "gear_ratio" : "") + (gear && counts ? " and " : "") + (counts ? "counts_per_turn" : "");
}

double JointJog::moved() const {
  return last_seen_ - start_;
}

std::string JointJog::reported() const {
  const std::uint32_t own = driver_.feedback().error_code, code = own != 0 ? own : driver_.remark();
  return code == 0 ? "" : ": " + drivers::error_name(joint_.drive, code);
}

std::size_t JointJog::tick(MonoTime now, std::span<drivers::CanFrame> out) {
  if (!entered_.is_set()) entered_ = ticked_ = now;
  const JointFeedback& feedback = driver_.feedback();
  if (feedback.received_at.is_set()) last_seen_ = feedback.q;
  if (phase_ == Phase::enabling || drives(phase_)) take_velocity();
  advance(now);
  ticked_ = now;
  if (phase_ == Phase::ended) return 0;
  const bool enable = phase_ == Phase::enabling || drives(phase_);
  std::size_t frames = driver_.encode(enable, setpoint(), now, now + kLedSilence, out);
  const bool asks = scale_ && (phase_ == Phase::asking || enable) && frames < out.size();
  if (const auto question = asks ? scale_->ask(enable, now) : std::nullopt) out[frames++] = *question;
  return frames;
}

void JointJog::advance(MonoTime now) {
  const JointFeedback& feedback = driver_.feedback();
  if (stopping_ && phase_ < Phase::releasing) enter(Phase::releasing, now);
  watch_drive(now);
  watch_ramp(now);
  switch (phase_) {
    case Phase::finding:
      find(now);
      break;
    case Phase::asking:
      if (!scale_ || scale_->asked()) enter(Phase::enabling, now);
      break;
    case Phase::enabling:
      reference_ = feedback.q;
      if (feedback.drive_state == DriveState::enabled)
        enter(Phase::moving, now);
      else if (now - entered_ > kEnableWithin)
        fail("its drive does not enable" + reported(), now);
      break;
    case Phase::moving: {
      const double most = wish_.speed * (now - ticked_).seconds();
      reference_ += std::clamp(target_ - reference_, -most, most);
      if (reference_ == target_) enter(Phase::settling, now);
      break;
    }
    case Phase::settling:
      if (now - entered_ > kSettle) settle(now);
      break;
    case Phase::releasing:
      if (now - entered_ > kRelease) enter(Phase::ended, now);
      break;
    case Phase::ended:
      break;
  }
}

void JointJog::find(MonoTime now) {
  const JointFeedback& feedback = driver_.feedback();
  const bool ready = feedback.received_at.is_set() && feedback.drive_state == DriveState::disabled;
  if (ready && (!gravity_ || gravity_())) return aim(now);
  if (now - entered_ <= kFindWithin) return;
  const bool is_silent =
      !feedback.received_at.is_set() && drivers::kind_of(feedback.error_code) == drivers::SetupFault::settings_unread;
  if (!feedback.received_at.is_set() && feedback.error_code == 0)
    fail("no answer from its drive: is it powered, and are id and bus right?", now);
  else if (!ready)
    fail("its drive does not get ready" + reported() + (is_silent ? ": is it powered, and are id and bus right?" : ""),
         now);
  else
    fail("gravity is not known: not every joint of the model tells where it is", now);
}

void JointJog::aim(MonoTime now) {
  start_ = driver_.feedback().q;
  target_ = start_ + wish_.by;
  const double low = std::min(joint_.limits.q_min, start_), high = std::max(joint_.limits.q_max, start_);
  if (target_ >= low && target_ <= high) return enter(Phase::asking, now);
  fail("from " + text_of(start_) + " it would go to " + text_of(target_) + ", outside limits.position " +
           text_of(joint_.limits.q_min) + " to " + text_of(joint_.limits.q_max) + ": ask for less",
       now);
}

// Half of the way, or kOffRamp short of it, is no success.
void JointJog::settle(MonoTime now) {
  const double missed = std::abs(moved() - wish_.by);
  if (missed <= std::min(off_ramp(), std::abs(wish_.by) / 2)) return enter(Phase::releasing, now);
  fail("moved " + text_of(moved()) + " instead of " + text_of(wish_.by) + ": blocked, or --torque too low", now);
}

void JointJog::watch_ramp(MonoTime now) {
  if (!drives(phase_)) return;
  const double strayed = driver_.feedback().q - reference_;
  if (std::abs(strayed) <= off_ramp()) return;
  fail("strayed " + text_of(strayed) +
           " from where it was led, and was released: blocked, pulled by gravity harder than "
           "--torque and the model carry, turning the wrong way, or led too fast",
       now);
}

void JointJog::watch_drive(MonoTime now) {
  if (!drives(phase_)) return;
  if (const std::string trouble = drive_trouble(joint_.drive, driver_.feedback(), now); !trouble.empty())
    fail(trouble, now);
}

// Never more than the joint may bear.
float JointJog::carried() const {
  const std::optional<double> torque = gravity_ ? gravity_() : std::nullopt;
  return torque ? within_limit(*torque) : 0.0F;
}

float JointJog::within_limit(double torque) const {
  return static_cast<float>(std::clamp(torque, -joint_.limits.torque, joint_.limits.torque));
}

drivers::DriveSetpoint JointJog::setpoint() const {
  if (!drives(phase_)) return {};
  const double kp = joint_.kp, kd = joint_.kd, q = driver_.feedback().q;
  const bool young = ticked_ - driver_.feedback().received_at <= kLedYoung;
  const double stretch = kp > 0 ? wish_.torque / kp : 0;
  const double gap = std::clamp(reference_ - q, -stretch, stretch);
  const double pull = std::clamp(kp * gap - kd * double{driver_.feedback().dq}, -wish_.torque, wish_.torque);
  const double speed = kd > 0 ? std::clamp(kp / kd * gap, -wish_.speed, wish_.speed) : 0;
  switch (config::loop_closed_by(joint_.drive)) {
    case config::LoopClosedBy::drive:
      return {.q = static_cast<float>(q + gap),
              .kp = static_cast<float>(kp),
              .kd = static_cast<float>(kd),
              .tau = carried()};
    case config::LoopClosedBy::host_torque:
      return {.q = static_cast<float>(q + gap), .tau = young ? within_limit(pull + double{carried()}) : 0};
    case config::LoopClosedBy::host_velocity:
      return {.q = static_cast<float>(q + gap), .dq = young ? static_cast<float>(speed) : 0};
  }
  return {};
}

}  // namespace takt::commissioning

// SPDX-License-Identifier: Apache-2.0
#include "commissioning/stop_search.hpp"

#include <algorithm>
#include <cmath>
#include <limits>

#include "commissioning/led_joint.hpp"
#include "config/drive_loop.hpp"
#include "drivers/protocol/protocol_table.hpp"

namespace takt::commissioning {

StopSearch::StopSearch(const config::Joint& joint, const StopWish& wish, drivers::JointDriver& driver)
    : joint_(joint), wish_(wish), driver_(driver), unit_(drivers::shown_unit(joint.kind).size) {
  driver_.assume_home(0, std::numeric_limits<float>::infinity());
}

void StopSearch::enter(Phase phase, MonoTime now) {
  phase_ = phase;
  entered_ = now;
}

void StopSearch::fail(const std::string& why, MonoTime now) {
  failure_ = why;
  enter(Phase::releasing, now);
}

void StopSearch::give_up() {
  if (phase_ < Phase::releasing) fail("ended by the person", ticked_);
}

std::size_t StopSearch::tick(MonoTime now, std::span<drivers::CanFrame> out) {
  if (!entered_.is_set()) entered_ = ticked_ = now;
  advance(now);
  ticked_ = now;
  if (phase_ == Phase::ended) return 0;
  const bool enable = phase_ == Phase::enabling || phase_ == Phase::searching;
  return driver_.encode(enable, setpoint(now), now, now + kLedSilence, out);
}

void StopSearch::advance(MonoTime now) {
  switch (phase_) {
    case Phase::finding:
      return find(now);
    case Phase::enabling:
      if (driver_.feedback().drive_state == DriveState::enabled) return begin(now);
      if (now - entered_ > kEnableWithin) fail("its drive does not enable", now);
      return;
    case Phase::searching:
      watch_drive(now);
      if (phase_ == Phase::searching) search(now);
      return;
    case Phase::releasing:
      if (now - entered_ > kRelease) enter(Phase::ended, now);
      return;
    case Phase::ended:
      return;
  }
}

void StopSearch::find(MonoTime now) {
  const JointFeedback& feedback = driver_.feedback();
  if (feedback.received_at.is_set() && feedback.drive_state == DriveState::disabled) return enter(Phase::enabling, now);
  if (now - entered_ <= kFindWithin) return;
  if (!feedback.received_at.is_set()) return fail("no answer from its drive", now);
  fail("its drive does not get ready: " + drivers::error_name(joint_.drive, feedback.error_code), now);
}

void StopSearch::begin(MonoTime now) {
  start_ = reference_ = stood_at_ = driver_.feedback().q;
  stands_since_ = now;
  enter(Phase::searching, now);
}

void StopSearch::search(MonoTime now) {
  const double q = driver_.feedback().q;
  const double way = wish_.direction * (q - start_);
  if (way < -kAstray * unit_) return fail("went " + text_of(-way) + " the other way, and was released", now);
  if (wish_.direction * (q - reference_) > kAstray * unit_)
    return fail("ran ahead of where it was led, and was released: pulled by gravity, or pushed", now);
  if (way > wish_.within) return fail("no stop within " + text_of(wish_.within), now);
  if (now - entered_ > Duration{static_cast<std::int64_t>(2e9 * wish_.within / wish_.speed)} + kSpare)
    return fail("took too long, and was released after " + text_of(way), now);
  const double led = reference_ + wish_.direction * wish_.speed * (now - ticked_).seconds();
  reference_ = std::clamp(led, q - stretch(), q + stretch());
  const bool pulled_with_all = std::abs(reference_ - q) >= 0.9 * stretch();
  if (std::abs(q - stood_at_) > kStill * unit_ || !pulled_with_all) {
    if (std::abs(q - stood_at_) > kStill * unit_) stood_at_ = q;
    stands_since_ = now;
  }
  if (now - stands_since_ < kStandsFor) return;
  if (way < kLeastWay * unit_)
    return fail("did not move: blocked, too heavy for --torque, or at the stop already (bring it away from there)",
                now);
  stood_at_ = q;
  enter(Phase::releasing, now);
}

void StopSearch::watch_drive(MonoTime now) {
  if (const std::string trouble = drive_trouble(joint_.drive, driver_.feedback(), now); !trouble.empty())
    fail(trouble, now);
}

double StopSearch::stretch() const {
  return joint_.kp > 0 ? wish_.torque / joint_.kp : 0;
}

drivers::DriveSetpoint StopSearch::setpoint(MonoTime now) const {
  if (phase_ != Phase::searching) return {};
  const double q = driver_.feedback().q, gap = std::clamp(reference_ - q, -stretch(), stretch());
  if (config::loop_closed_by(joint_.drive) == config::LoopClosedBy::drive)
    return {.q = static_cast<float>(q + gap), .kp = static_cast<float>(joint_.kp), .kd = static_cast<float>(joint_.kd)};
  const bool young = now - driver_.feedback().received_at <= kLedYoung;
  const double pull =
      std::clamp(joint_.kp * gap - joint_.kd * double{driver_.feedback().dq}, -wish_.torque, wish_.torque);
  return {.q = static_cast<float>(q + gap), .tau = young ? static_cast<float>(pull) : 0};
}

}  // namespace takt::commissioning

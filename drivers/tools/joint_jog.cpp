#include "drivers/tools/joint_jog.hpp"

#include <algorithm>
#include <cmath>

#include "config/drive_loop.hpp"
#include "drivers/protocol/protocol_table.hpp"

namespace takt::drivers {
namespace {

constexpr Duration kSilence = milliseconds(100);
constexpr Duration kYoung = milliseconds(20);  // a reading that a push may stem from

bool drives(JointJog::Phase phase) {
  return phase == JointJog::Phase::moving || phase == JointJog::Phase::settling;
}

}  // namespace

JointJog::JointJog(const config::Joint& joint, const JogWish& wish, JointDriver& driver)
    : joint_(joint), wish_(wish), driver_(driver) {}

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

double JointJog::moved() const {
  return last_seen_ - start_;
}

std::string JointJog::reported() const {
  const std::uint32_t code = driver_.feedback().error_code;
  return code == 0 ? "" : ": " + error_name(joint_.drive, code);
}

std::size_t JointJog::tick(MonoTime now, std::span<CanFrame> out) {
  if (!entered_.is_set()) entered_ = ticked_ = now;
  if (driver_.feedback().received_at.is_set()) last_seen_ = driver_.feedback().q;
  advance(now);
  ticked_ = now;
  if (phase_ == Phase::ended) return 0;
  const bool enable = phase_ == Phase::enabling || drives(phase_);
  return driver_.encode(enable, setpoint(), now, now + kSilence, out);
}

void JointJog::advance(MonoTime now) {
  const JointFeedback& feedback = driver_.feedback();
  if (stopping_ && phase_ < Phase::releasing) enter(Phase::releasing, now);
  watch_drive(now);
  switch (phase_) {
    case Phase::finding:
      if (feedback.received_at.is_set() && feedback.drive_state == DriveState::disabled) {
        start_ = feedback.q;
        const double low = std::min(joint_.limits.q_min, start_), high = std::max(joint_.limits.q_max, start_);
        target_ = std::clamp(start_ + wish_.by, low, high);
        enter(Phase::enabling, now);
      } else if (now - entered_ > kFindWithin) {
        fail(feedback.received_at.is_set() ? "its drive does not get ready" + reported()
                                           : "no answer from its drive: is it powered, and are id and bus right?",
             now);
      }
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
      if (now - entered_ > kSettle) enter(Phase::releasing, now);
      break;
    case Phase::releasing:
      if (now - entered_ > kRelease) enter(Phase::ended, now);
      break;
    case Phase::ended:
      break;
  }
}

void JointJog::watch_drive(MonoTime now) {
  if (!drives(phase_)) return;
  const JointFeedback& feedback = driver_.feedback();
  if (feedback.drive_state == DriveState::fault)
    fail("its drive reports " + error_name(joint_.drive, feedback.error_code), now);
  else if (feedback.drive_state != DriveState::enabled)
    fail("its drive left the enabled state by itself", now);
  else if (now - feedback.received_at > kSilence)
    fail("its drive fell silent", now);
}

DriveSetpoint JointJog::setpoint() const {
  if (!drives(phase_)) return {};
  const double kp = joint_.kp, kd = joint_.kd, q = driver_.feedback().q;
  const bool young = ticked_ - driver_.feedback().received_at <= kYoung;
  const double stretch = kp > 0 ? wish_.torque / kp : 0;
  const double gap = std::clamp(reference_ - q, -stretch, stretch);
  const double pull = std::clamp(kp * gap - kd * double{driver_.feedback().dq}, -wish_.torque, wish_.torque);
  const double speed = kd > 0 ? std::clamp(kp / kd * gap, -wish_.speed, wish_.speed) : 0;
  switch (config::loop_closed_by(joint_.drive)) {
    case config::LoopClosedBy::drive:
      return {.q = static_cast<float>(q + gap), .kp = static_cast<float>(kp), .kd = static_cast<float>(kd)};
    case config::LoopClosedBy::host_torque:
      return {.q = static_cast<float>(q + gap), .tau = young ? static_cast<float>(pull) : 0};
    case config::LoopClosedBy::host_velocity:
      return {.q = static_cast<float>(q + gap), .dq = young ? static_cast<float>(speed) : 0};
  }
  return {};
}

}  // namespace takt::drivers

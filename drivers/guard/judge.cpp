// SPDX-License-Identifier: Apache-2.0
#include "drivers/guard/judge.hpp"

#include <algorithm>
#include <cmath>

namespace takt::drivers::guard {
namespace {

// At the tick's estimate; `doubt`: how far the wire's rounding may have moved it.
struct Torque {
  float value = 0, doubt = 0;
};

bool is_finite(const Motion& m) noexcept {
  return std::isfinite(m.q + m.dq + m.kp + m.kd + m.tau) && std::isfinite(m.q) && std::isfinite(m.tau);
}

Torque torque_of(const JointFacts& facts, const Motion& asked, const JointRecord& record) noexcept {
  const Motion& r = facts.rounding;
  const float far = asked.q - record.q_estimate;
  const float fast = asked.dq - record.dq_estimate;
  return {asked.kp * far + asked.kd * fast + asked.tau,
          asked.kp * r.q + std::abs(far) * r.kp + asked.kd * r.dq + std::abs(fast) * r.kd + r.tau};
}

bool has_torque(Law law) noexcept {
  switch (law) {
    case Law::fields:
    case Law::torque:
      return true;
    case Law::velocity:
    case Law::position:
      return false;
  }
  return true;
}

bool is_near(float a, float b, float tolerance) noexcept {
  return std::abs(a - b) <= tolerance;  // false for NaN
}

// No stiffness, no torque, and no motion but what the drive damps by its own measurement.
bool asks_for_nothing(const JointFacts& facts, const Motion& asked, const JointRecord& record) noexcept {
  switch (facts.law) {
    case Law::fields:
    case Law::torque:
      return asked.kp == 0 && (asked.kd == 0 || std::abs(asked.dq) <= facts.rounding.dq) &&
             std::abs(asked.tau) <= facts.rounding.tau;
    case Law::velocity:
      return std::abs(asked.dq) <= facts.rounding.dq;
    case Law::position:
      return record.feedback.received_at.is_set() && is_near(asked.q, record.feedback.q, facts.rounding.q);
  }
  return false;
}

// What a drive that is to be off may be told: neither damping nor anything that switches it on.
bool leaves_it_off(const JointFacts& facts, const Motion& asked) noexcept {
  switch (facts.protocol) {
    case config::DriveProtocol::mit:
    case config::DriveProtocol::robstride:
    case config::DriveProtocol::odrive:
      return asked.kd <= facts.rounding.kd;
    case config::DriveProtocol::moteus:  // position mode, operation enabled: the frame is what switches it on
    case config::DriveProtocol::cia402:
      return false;
  }
  return false;
}

bool exceeds_gains(const JointFacts& facts, const Motion& asked) noexcept {
  return asked.kp < 0 || asked.kd < 0 || asked.kp > facts.kp + facts.rounding.kp ||
         asked.kd > facts.kd + facts.rounding.kd;
}

bool outlives_the_command(const JointFacts& facts, const Demand& demand, const Moment& moment) noexcept {
  constexpr Duration kFloatOfSeconds = microseconds(1);
  const Duration left = moment.valid_until.is_set() ? moment.valid_until - moment.decided_at : Duration{};
  return demand.valid_for > std::max(left, facts.shortest_watchdog) + kFloatOfSeconds;
}

bool exceeds_slew(const JointFacts& facts, Torque torque, const LastTold& last) noexcept {
  const Range allowed = torques_within_slew(facts, last);
  const float doubt = torque.doubt + last.doubt;
  return !(torque.value >= allowed.low - doubt && torque.value <= allowed.high + doubt);
}

// Of a drive with a position loop of its own: one period at the velocity limit, from where it was told to be. Nearer to
// where the joint is pushes nowhere. A drive that was told no position of ours starts where the joint was heard, and
// that is as far from where it is by now as the joint may have moved.
bool jumps(const JointFacts& facts, float q, const Moment& moment, const JointRecord& record,
           const LastTold& last) noexcept {
  const float at = record.feedback.q;
  const bool is_led = last.has_position && !last.is_passive;
  const Duration age = std::max(moment.decided_at - record.feedback.received_at, Duration{});
  const float moved = is_led ? 0.0F : facts.velocity_hard * static_cast<float>(age.seconds()) + facts.position_step;
  const float from = last.has_position ? last.q : at;
  const float step = facts.position_step + 2 * facts.rounding.q;
  return !(q >= std::min(from, at - moved) - step && q <= std::max(from, at + moved) + step);
}

WireVerdict judge_limits(const JointFacts& facts, const Motion& asked, Torque torque, const Moment& moment,
                         const JointRecord& record, const LastTold& last) noexcept {
  const Motion& r = facts.rounding;
  const bool moves_to = asked.kp > 0 || facts.law == Law::position;
  if (moves_to && (asked.q < facts.q_low - r.q || asked.q > facts.q_high + r.q)) return WireVerdict::position;
  if (std::abs(asked.dq) > facts.velocity + r.dq) return WireVerdict::velocity;
  if (facts.law == Law::position && jumps(facts, asked.q, moment, record, last)) return WireVerdict::velocity;
  if (!has_torque(facts.law)) return WireVerdict::allowed;
  const bool of_its_own = std::abs(asked.tau) > facts.torque + r.tau;
  const bool too_much = of_its_own || std::abs(torque.value) > facts.torque + torque.doubt;
  if (too_much) return WireVerdict::torque;
  return exceeds_slew(facts, torque, last) ? WireVerdict::slew : WireVerdict::allowed;
}

bool is_as_decided(const JointFacts& facts, const Motion& asked, const JointRecord& record) noexcept {
  const Motion& r = facts.rounding;
  switch (facts.law) {
    case Law::fields:
      return is_near(asked.kp, record.kp_command, r.kp) && is_near(asked.kd, record.kd_command, r.kd) &&
             is_near(asked.tau, record.tau_command, r.tau) && is_near(asked.q, record.q_command, r.q) &&
             is_near(asked.dq, record.dq_command, r.dq);
    case Law::torque:
      return is_near(asked.tau, record.tau_command, r.tau);
    case Law::velocity:
      return is_near(asked.dq, record.dq_command, r.dq);
    case Law::position:
      return is_near(asked.q, record.q_command, r.q);
  }
  return false;
}

WireVerdict judge_push(const JointFacts& facts, const Motion& asked, Torque torque, const Moment& moment,
                       const JointRecord& record, const LastTold& last) noexcept {
  if (moment.valid_until.is_set() && moment.now > moment.valid_until) return WireVerdict::expired;
  if (!moment.heard) return WireVerdict::feedback_lost;
  const WireVerdict verdict = judge_limits(facts, asked, torque, moment, record, last);
  if (verdict != WireVerdict::allowed) return verdict;
  return is_as_decided(facts, asked, record) ? WireVerdict::allowed : WireVerdict::differs;
}

// A drive that is told its largest torque keeps to it.
Torque within(Torque torque, float most, float ratio) noexcept {
  if (!(most > 0)) return torque;
  const float joint_side = most * std::abs(ratio);
  return {std::clamp(torque.value, -joint_side, joint_side), torque.doubt};
}

WireVerdict judge_drive(const JointFacts& facts, const Demand& demand, const Moment& moment, const JointRecord& record,
                        LastTold& last) noexcept {
  const Motion& asked = demand.motion;
  const Torque torque = within(torque_of(facts, asked, record), demand.torque_most, facts.ratio);
  const bool passive = asks_for_nothing(facts, asked, record);
  // Damping needs no estimate: whatever the record says, the drive brakes what it measures itself.
  if (!is_finite(asked) || (!passive && !std::isfinite(torque.value))) return WireVerdict::not_finite;
  if (exceeds_gains(facts, asked)) return WireVerdict::gain;
  if (!moment.enabled) {
    if (!passive || !leaves_it_off(facts, asked)) return WireVerdict::misplaced;
    last = {};
    return WireVerdict::allowed;
  }
  if (outlives_the_command(facts, demand, moment)) return WireVerdict::expired;
  const bool own_limit_holds = demand.torque_most == 0 || demand.torque_most <= facts.torque_range;  // false for NaN
  if (!own_limit_holds) return WireVerdict::torque;
  const WireVerdict verdict = passive ? WireVerdict::allowed : judge_push(facts, asked, torque, moment, record, last);
  if (verdict == WireVerdict::allowed)
    last = {.torque = std::isfinite(torque.value) ? torque.value : 0.0F,
            .doubt = std::isfinite(torque.doubt) ? torque.doubt : 0.0F,
            .is_passive = passive,
            .q = asked.q,
            .has_position = facts.law == Law::position};
  return verdict;
}

}  // namespace

Range torques_within_slew(const JointFacts& facts, const LastTold& last) noexcept {
  const float step = facts.torque_step;
  return {(last.is_passive ? std::min(last.torque, 0.0F) : last.torque) - step,
          (last.is_passive ? std::max(last.torque, 0.0F) : last.torque) + step};
}

WireVerdict judge(const JointFacts& facts, const Demand& demand, const Moment& moment, const JointRecord& record,
                  LastTold& last) noexcept {
  switch (demand.kind) {
    case Demand::Kind::unknown:
      return WireVerdict::unknown_frame;
    case Demand::Kind::aside:
      return WireVerdict::allowed;
    case Demand::Kind::disable:
      last = {};
      return WireVerdict::allowed;
    case Demand::Kind::energise:
      return moment.enabled ? WireVerdict::allowed : WireVerdict::misplaced;
    case Demand::Kind::configure:
      return moment.enabled ? WireVerdict::misplaced : WireVerdict::allowed;
    case Demand::Kind::drive:
      return judge_drive(facts, demand, moment, record, last);
  }
  return WireVerdict::unknown_frame;
}

}  // namespace takt::drivers::guard

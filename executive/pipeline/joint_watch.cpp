// SPDX-License-Identifier: Apache-2.0
#include "executive/pipeline/joint_watch.hpp"

#include <algorithm>
#include <bit>
#include <cmath>
#include <cstdint>
#include <limits>

#include "executive/pipeline/velocity_observer.hpp"

namespace takt::pipeline {
namespace {

constexpr float kScaleTolerance = 0.25F;   // of the way: drives' velocities are filtered, and rarely calibrated
constexpr float kSlopeTolerance = 0.3F;    // likewise
constexpr float kTravelThatTells = 5.0F;   // of the limit: how far the joint has to go before the slope is judged
constexpr float kSwing = 0.2F;             // of the torque limit: more than coarse drives resolve, and friction hides
constexpr float kHeldByFriction = 0.075F;  // of the torque limit
constexpr float kBeyondFriction = 0.12F;   // of the torque limit
constexpr float kLongestStep = 3.0F;       // of the spacing of replies: more is a gap
constexpr float kNearStop = 0.02F;         // rad
// rad: thirty steps of a common encoder, for a load may multiply the inertia.
constexpr float kMotionThatShows = 0.0125F;
constexpr std::uint8_t kOfOutlier = 2;

std::uint16_t milliseconds_up(Duration span) {
  const std::int64_t whole = (span.ns + milliseconds(1).ns - 1) / milliseconds(1).ns;
  return static_cast<std::uint16_t>(std::clamp<std::int64_t>(whole, 0, std::numeric_limits<std::uint16_t>::max()));
}

// -0 is not 0, and a NaN that stays is the same.
bool is_same(float one, float other) {
  return std::bit_cast<std::uint32_t>(one) == std::bit_cast<std::uint32_t>(other);
}

void find(JointWatch& watch, ReplyFault fault, MonoTime at) {
  watch.found = static_cast<ReplyFaultMask>(watch.found | bit(fault));
  watch.suspect_until = at + kSuspectFor;
}

void begin_waiting(JointWatch& watch) {
  watch.expected_q = watch.expected_dq = 0.0F;
  watch.beyond_from = watch.beyond;
  watch.path_from = watch.path;
}

void begin_stillness(JointWatch& watch, MonoTime at) {
  watch.still_since = at;
  watch.slid = 0.0F;
}

void begin_sameness(JointWatch& watch, MonoTime at) {
  watch.same_since = at;
  watch.swung_at = {};
  watch.told_low = watch.told_high = watch.told;
}

void keep(JointWatch& watch, const JointFeedback& reply) {
  watch.believed_at = reply.received_at;
  watch.q = reply.q;
  watch.dq = reply.dq;
  watch.tau = reply.tau;
  watch.in_doubt = 0;
}

void begin(JointWatch& watch, const JointFeedback& reply) {
  keep(watch, reply);
  watch.ahead = watch.travel = 0.0F;
  watch.stretch = watch.stretch_moved = watch.stretch_told = 0.0F;
  watch.moved_told = watch.told_told = watch.went = 0.0F;
  watch.score = 0;
  watch.waited_ms = 0;
  begin_stillness(watch, reply.received_at);
  begin_sameness(watch, reply.received_at);
  begin_waiting(watch);
}

bool is_beyond_reach(const JointWatch& watch, const JointFeedback& reply, const JointLimits& limits,
                     const TickConfig& config) {
  if (config.feedback.jump <= 0.0F) return false;
  // Stamps tell when a reply came, which is up to a period after its position was read, and behind a gap later still.
  const Duration waited = milliseconds(watch.waited_ms);
  const float dt = seconds_of(reply.received_at - watch.believed_at + config.period + waited);
  return !(std::abs(reply.q - watch.q) <= limits.velocity_hard * dt + config.feedback.jump * limits.per_rad);
}

bool is_frozen_for_long(MonoTime since, const JointFeedback& reply, const TickConfig& config) {
  return reply.received_at - since >= config.feedback.frozen_after;
}

void end_stretch(JointWatch& watch) {
  const float left = std::max(0.0F, 1.0F - watch.stretch / kFeedbackMemory_s);
  watch.moved_told = left * watch.moved_told + watch.stretch_moved * watch.stretch_told;
  watch.told_told = left * watch.told_told + watch.stretch_told * watch.stretch_told;
  watch.went = left * watch.went + std::min(std::abs(watch.stretch_moved), std::abs(watch.stretch_told));
  watch.stretch = watch.stretch_moved = watch.stretch_told = 0.0F;
}

// Positions against the drive's own velocities. A velocity of NaN says the worst that is possible.
void compare(JointWatch& watch, const JointFeedback& reply, const JointLimits& limits) {
  const float dt = seconds_of(reply.received_at - watch.believed_at);
  const float moved = reply.q - watch.q;
  const float mean = 0.5F * (watch.dq + reply.dq);
  const float by_velocity = (std::isfinite(mean) ? mean : -std::copysign(limits.velocity_hard, moved)) * dt;
  const float left = std::max(0.0F, 1.0F - dt / kFeedbackMemory_s);
  watch.ahead = left * watch.ahead + moved - by_velocity;
  watch.travel = left * watch.travel + std::max(std::abs(moved), std::abs(by_velocity));
  watch.slid = left * watch.slid + by_velocity;
  watch.stretch += dt;
  watch.stretch_moved += moved;
  watch.stretch_told += by_velocity;
  if (watch.stretch >= kStretch_s) end_stretch(watch);
}

// By how much the slope of positions over velocities is off, as a share of what it may be.
float slope_share(const JointWatch& watch, float limit) {
  if (!(watch.went >= kTravelThatTells * limit)) return 0.0F;
  return std::abs(watch.moved_told - watch.told_told) / (kSlopeTolerance * watch.told_told);
}

bool is_near_stop(float q, const JointLimits& limits) {
  const float near = kNearStop * limits.per_rad;
  return q < limits.q_min + near || q > limits.q_max - near;
}

float contradiction_of(const JointConfig& joint, const TickConfig& config) {
  return config.feedback.contradiction * joint.limits.per_rad;
}

bool feels_torque_here(const JointConfig& joint) {
  return joint.loop == LoopAt::host_torque || !joint.tells_velocity;
}

// What the torque that changed since the joint stands still would have made of it, had nothing held it.
void expect_motion(JointWatch& watch, const JointConfig& joint, float dt) {
  const float inertia = std::max(joint.inertia, joint.inertia_max);
  const float changed = watch.beyond - watch.beyond_from;
  const float left = std::max(0.0F, std::abs(changed) - kHeldByFriction * joint.limits.torque);
  if (inertia <= 0.0F) return;
  watch.expected_dq += std::copysign(left, changed) / inertia * dt;
  watch.expected_q += watch.expected_dq * dt;
}

bool stands_against_torque(const JointWatch& watch, const JointConfig& joint, const TickConfig& config) {
  if (joint.passive || !feels_torque_here(joint) || is_near_stop(watch.q, joint.limits)) return false;
  if (joint.loop == LoopAt::host_velocity)
    return std::abs(watch.path - watch.path_from) > contradiction_of(joint, config) &&
           config.feedback.contradiction > 0;
  return std::abs(watch.beyond - watch.beyond_from) > kBeyondFriction * joint.limits.torque &&
         std::abs(watch.expected_q) > kMotionThatShows * joint.limits.per_rad;
}

void look_for_contradiction(JointWatch& watch, const JointFeedback& reply, const JointConfig& joint,
                            const TickConfig& config) {
  const float limit = contradiction_of(joint, config);
  if (limit <= 0.0F || !joint.tells_velocity) return;
  const bool looks = config.feedback.frozen_after > Duration{};
  if (looks && !(std::abs(watch.slid) <= limit) && is_frozen_for_long(watch.still_since, reply, config))
    find(watch, ReplyFault::frozen, reply.received_at);
  if (!(std::abs(watch.ahead) <= limit + kScaleTolerance * watch.travel) || !(slope_share(watch, limit) <= 1.0F))
    find(watch, ReplyFault::contradicts, reply.received_at);
}

// A drive whose torque has swung, too, has answered; it may take `frozen_after` for that.
void look_for_repetition(JointWatch& watch, const JointFeedback& reply, const JointConfig& joint,
                         const TickConfig& config) {
  watch.told_low = std::min(watch.told_low, watch.told);
  watch.told_high = std::max(watch.told_high, watch.told);
  if (watch.told_high - watch.told_low <= kSwing * joint.limits.torque) return;
  if (!watch.swung_at.is_set()) watch.swung_at = reply.received_at;
  if (watch.torque_lives != 0 && is_frozen_for_long(watch.swung_at, reply, config))
    find(watch, ReplyFault::frozen, reply.received_at);
}

void look_for_ice(JointWatch& watch, const JointFeedback& reply, const JointConfig& joint, const TickConfig& config) {
  if (config.feedback.frozen_after <= Duration{}) return;
  if (!joint.passive) look_for_repetition(watch, reply, joint, config);
  if (is_frozen_for_long(watch.still_since, reply, config) && stands_against_torque(watch, joint, config))
    find(watch, ReplyFault::frozen, reply.received_at);
}

void follow(JointWatch& watch, const JointFeedback& reply, const JointConfig& joint, const TickConfig& config) {
  const float dt = seconds_of(reply.received_at - watch.believed_at);
  const bool is_still = is_same(reply.q, watch.q);
  const bool same_velocity = is_same(reply.dq, watch.dq);
  const bool same_torque = is_same(reply.tau, watch.tau);
  if (!same_torque) watch.torque_lives = 1;
  // What a joint did while it was not heard, its velocities at both ends do not say. Nor when the reply that ends the
  // gap was read: it may have waited as long, so that the next one is not compared with it either.
  const bool is_gap = dt > kLongestStep * seconds_of(config.period) * static_cast<float>(joint.turns.every);
  if (!is_gap && watch.waited_ms == 0) compare(watch, reply, joint.limits);
  watch.waited_ms = is_gap ? milliseconds_up(reply.received_at - watch.believed_at) : std::uint16_t{0};
  const bool is_unchanged = is_still && same_torque && same_velocity;
  keep(watch, reply);
  if (watch.score > 0) --watch.score;
  if (!is_still || is_gap) begin_stillness(watch, reply.received_at);
  // Whatever torque says: a joint whose own velocity changes has moved, or is about to.
  if (is_still && !is_gap && (same_velocity || !joint.tells_velocity))
    expect_motion(watch, joint, dt);
  else
    begin_waiting(watch);
  if (!is_unchanged || is_gap) begin_sameness(watch, reply.received_at);
  look_for_contradiction(watch, reply, joint, config);
  look_for_ice(watch, reply, joint, config);
}

// The one instant at which a drive that forgets its zero can be told from a joint that stayed where it was.
bool has_moved_unheard(const JointWatch& watch, const JointFeedback& reply, const JointLimits& limits,
                       const TickConfig& config) {
  const Duration long_silence = std::max(config.feedback_timeout, Duration{kLongSilence_ticks * config.period.ns});
  const bool was_silent = !watch.believed_at.is_set() || reply.received_at - watch.believed_at >= long_silence;
  return watch.judged_at.is_set() && was_silent && !(std::abs(reply.q - watch.q) <= kMovedUnheard * limits.per_rad);
}

bool is_from_future(const JointFeedback& feedback, MonoTime now, const TickConfig& config) {
  return feedback.received_at > now + config.period;
}

}  // namespace

Belief take_feedback(JointWatch& watch, const JointFeedback& feedback, MonoTime now, const JointConfig& joint,
                     const TickConfig& config) {
  if (!feedback.received_at.is_set() || !is_plausible(feedback) || is_from_future(feedback, now, config) ||
      feedback.received_at <= watch.judged_at)
    return Belief::none;
  if (has_moved_unheard(watch, feedback, joint.limits, config)) watch.moved_unheard = 1;
  watch.judged_at = feedback.received_at;
  if (!watch.believed_at.is_set() || feedback.received_at - watch.believed_at > config.feedback_timeout) {
    begin(watch, feedback);
    return Belief::follows;
  }
  if (!is_beyond_reach(watch, feedback, joint.limits, config)) {
    follow(watch, feedback, joint, config);
    return Belief::follows;
  }
  ++watch.outliers;
  watch.in_doubt = 1;
  watch.score = static_cast<std::uint8_t>(watch.score + kOfOutlier);
  if (watch.score < kOfOutlier * kLasting) return Belief::none;
  find(watch, ReplyFault::jumped, feedback.received_at);
  begin(watch, feedback);
  return Belief::begins;
}

void forget_replies(JointWatch& watch) {
  const JointWatch before = watch;
  watch = {};
  watch.judged_at = before.judged_at;
  watch.q = before.q;
  watch.outliers = before.outliers;
  watch.moved_unheard = before.moved_unheard;
}

void accept_place(JointWatch& watch) {
  watch.moved_unheard = 0;
}

void note_told(JointWatch& watch, const JointSetpoint& setpoint, float gravity, float path, const JointConfig& joint) {
  const float velocity = joint.tells_velocity && std::isfinite(watch.dq) ? watch.dq : 0.0F;
  watch.told = setpoint.kp * (setpoint.q - watch.q) + setpoint.kd * (setpoint.dq - velocity) + setpoint.tau;
  watch.beyond = watch.told - gravity;
  watch.path = path;
}

// Without torque of ours nothing is expected of the joint: a brake, or friction, may hold it.
void note_untold(JointWatch& watch) {
  watch.told = watch.beyond = 0.0F;
  begin_waiting(watch);
  begin_sameness(watch, watch.believed_at);
}

ReplyFaultMask feedback_faults(const JointWatch& watch, const JointFeedback& feedback, MonoTime now,
                               const TickConfig& config) {
  const bool holds = watch.suspect_until.is_set() && now <= watch.suspect_until;
  const int faults = (holds ? watch.found : 0) | (watch.in_doubt != 0 ? bit(ReplyFault::outlier) : 0) |
                     (is_from_future(feedback, now, config) ? bit(ReplyFault::from_future) : 0) |
                     (watch.moved_unheard != 0 ? bit(ReplyFault::moved_unheard) : 0);
  return static_cast<ReplyFaultMask>(faults);
}

FeedbackMargin margin_of(const JointWatch& watch, const JointConfig& joint, const TickConfig& config) {
  const float limit = contradiction_of(joint, config);
  FeedbackMargin margin;
  if (joint.tells_velocity && limit > 0.0F) {
    margin.contradiction =
        std::max(std::abs(watch.ahead) / (limit + kScaleTolerance * watch.travel), slope_share(watch, limit));
    margin.frozen = std::abs(watch.slid) / limit;
  }
  if (config.feedback.frozen_after <= Duration{} || joint.passive) return margin;
  if (watch.swung_at.is_set() && watch.torque_lives != 0)
    margin.frozen = std::max(margin.frozen,
                             seconds_of(watch.believed_at - watch.swung_at) / seconds_of(config.feedback.frozen_after));
  if (feels_torque_here(joint) && !is_near_stop(watch.q, joint.limits))
    margin.frozen = std::max(
        margin.frozen, std::min(std::abs(watch.beyond - watch.beyond_from) / (kBeyondFriction * joint.limits.torque),
                                std::abs(watch.expected_q) / (kMotionThatShows * joint.limits.per_rad)));
  return margin;
}

}  // namespace takt::pipeline

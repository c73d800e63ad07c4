// SPDX-License-Identifier: Apache-2.0
// Joint position and velocity from encoder replies: a second-order tracking observer per joint.
//
// Its state belongs to the receive stamp of the newest reply, so that the spacing of replies, not of ticks, drives it.
// Both poles lie at 1 / (1 + bandwidth * dt) (backward Euler of a double pole at -bandwidth), which stays stable for
// every dt and turns into a plain difference quotient after a long silence. A tick without a reply predicts with
// constant velocity. Units: rad, rad/s. Before the first reply: zero, and feedback counts as lost.
// Source of the form: tracking-loop (alpha-beta) filter with equal real poles.
#pragma once

#include "executive/contract/feedback.hpp"
#include "executive/contract/mono_time.hpp"

namespace takt::pipeline {

struct ObserverState {
  MonoTime sampled_at;  // receive stamp of the newest reply taken in; unset before the first
  float q = 0;          // rad, at sampled_at
  float dq = 0;         // rad/s, at sampled_at
};

struct JointMotion {
  float q = 0;   // rad
  float dq = 0;  // rad/s
};

inline float seconds_of(Duration span) {
  return static_cast<float>(span.ns) * 1.0e-9F;
}

// Whether the newest reply is at most `longest` old.
inline bool is_heard(const ObserverState& observer, MonoTime now, Duration longest) {
  return observer.sampled_at.is_set() && now - observer.sampled_at <= longest;
}

// A bandwidth beyond every reply's spacing: position as replied, velocity by difference quotient.
inline constexpr float kNoFilter = 1.0e7F;

// A reply that can be an encoder's: finite and not absurd. Anything else counts as no reply.
bool is_plausible(const JointFeedback& feedback);

// Takes in a reply that is newer than the state; otherwise leaves the state alone.
void take_reply(ObserverState& observer, const JointFeedback& feedback, float bandwidth);

// The estimate at `now`, predicted for at most `longest_prediction` past the newest reply.
JointMotion estimate_at(const ObserverState& observer, MonoTime now, Duration longest_prediction);

}  // namespace takt::pipeline

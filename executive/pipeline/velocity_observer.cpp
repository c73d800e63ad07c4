// SPDX-License-Identifier: Apache-2.0
#include "executive/pipeline/velocity_observer.hpp"

#include <algorithm>
#include <cmath>

namespace takt::pipeline {
namespace {

constexpr float kAbsurdAngle = 1.0e5F;  // rad: some 16,000 turns

}  // namespace

bool is_plausible(const JointFeedback& feedback) {
  return std::abs(feedback.q) <= kAbsurdAngle;  // false for NaN
}

void take_reply(ObserverState& observer, const JointFeedback& feedback, float bandwidth) {
  if (!feedback.received_at.is_set() || feedback.received_at <= observer.sampled_at || !is_plausible(feedback)) return;
  if (!observer.sampled_at.is_set()) {
    observer = {feedback.received_at, feedback.q, 0.0F};
    return;
  }
  const float dt = seconds_of(feedback.received_at - observer.sampled_at);
  const float pole = 1.0F / (1.0F + bandwidth * dt);
  const float predicted = observer.q + observer.dq * dt;
  const float innovation = feedback.q - predicted;
  observer.sampled_at = feedback.received_at;
  observer.q = predicted + (1.0F - pole * pole) * innovation;
  const float gain = bandwidth * pole;  // (1 - pole) / dt
  observer.dq += gain * gain * dt * innovation;
}

JointMotion estimate_at(const ObserverState& observer, MonoTime now, Duration longest_prediction) {
  if (!observer.sampled_at.is_set()) return {};
  const Duration since = std::clamp(now - observer.sampled_at, Duration{0}, longest_prediction);
  return {observer.q + observer.dq * seconds_of(since), observer.dq};
}

}  // namespace takt::pipeline

// SPDX-License-Identifier: Apache-2.0
#include "executive/pipeline/imu_watch.hpp"

#include <algorithm>
#include <cmath>
#include <span>

namespace takt::pipeline {
namespace {

constexpr float kNormTolerance = 0.01F;

bool all_finite(std::span<const float> values) {
  return std::ranges::all_of(values, [](float value) { return std::isfinite(value); });
}

float square_sum(std::span<const float> values) {
  float sum = 0;
  for (const float value : values) sum += value * value;
  return sum;
}

ImuVerdict judge(const ImuWatch& watch, const ImuSample& read, MonoTime now, Duration period) {
  if (read.sequence == 0) return ImuVerdict::absent;
  // The mailbox is read somewhat after the tick's instant, so a prompt sample may be a little ahead of it.
  if (read.sensed_at > now + period) return ImuVerdict::from_future;
  if (!read.sensed_at.is_set() || read.sensed_at < watch.in_force.sensed_at) return ImuVerdict::backwards;
  if (!all_finite(read.rotation) || !all_finite(read.angular_velocity) || !all_finite(read.acceleration))
    return ImuVerdict::not_finite;
  const float norm = std::sqrt(square_sum(read.rotation));
  return std::abs(norm - 1) <= kNormTolerance ? ImuVerdict::usable : ImuVerdict::not_unit;
}

// The rotation vector from one attitude to another, in the base's frame; small angles, the shorter way round.
std::array<float, 3> turned(const float (&from)[4], const float (&to)[4]) {
  const auto [w, x, y, z] = from;
  const float real = w * to[0] + x * to[1] + y * to[2] + z * to[3];
  const float twice = real < 0 ? -2.0F : 2.0F;
  return {twice * (w * to[1] - x * to[0] - y * to[3] + z * to[2]),
          twice * (w * to[2] + x * to[3] - y * to[0] - z * to[1]),
          twice * (w * to[3] - x * to[2] + y * to[1] - z * to[0])};
}

// Two stamps of one attitude would divide by nothing, and after a gap as long as the memory there is nothing to
// compare.
void compare(ImuWatch& watch, const ImuSample& read, float limit) {
  const ImuSample& before = watch.compared;
  const float dt = static_cast<float>((read.sensed_at - before.sensed_at).seconds());
  if (before.sequence == 0 || dt >= kContradictionMemory_s) {
    watch.ahead = {};
  } else if (dt > 0) {
    const std::array<float, 3> by_rotation = turned(before.rotation, read.rotation);
    const float left = 1.0F - dt / kContradictionMemory_s;
    for (std::size_t i = 0; i < 3; ++i) {
      const float by_rate = 0.5F * (before.angular_velocity[i] + read.angular_velocity[i]) * dt;
      watch.ahead[i] = left * watch.ahead[i] + by_rotation[i] - by_rate;
    }
  } else {
    return;
  }
  watch.compared = read;
  watch.contradicts = std::sqrt(square_sum(watch.ahead)) > limit ? 1 : 0;
}

bool says_the_same(const ImuSample& one, const ImuSample& other) {
  return std::ranges::equal(one.rotation, other.rotation) &&
         std::ranges::equal(one.angular_velocity, other.angular_velocity) &&
         std::ranges::equal(one.acceleration, other.acceleration);
}

bool is_lost(const ImuWatch& watch, MonoTime now, const ImuConfig& config) {
  const ImuSample& imu = watch.in_force;
  if (imu.sequence == 0 || now - imu.sensed_at > config.timeout || watch.contradicts != 0) return true;
  return config.frozen_after > Duration{} && imu.sensed_at - watch.changed_at > config.frozen_after;
}

bool is_beyond(const ImuSample& imu, const ImuConfig& config) {
  const float turning = std::sqrt(square_sum(imu.angular_velocity));
  return imu.sequence != 0 && (tilt_of(imu) > config.tilt || turning > config.angular_velocity);
}

}  // namespace

ImuVerdict take_imu(ImuWatch& watch, const ImuSample& read, MonoTime now, const TickConfig& config) {
  if (!config.imu.present) return ImuVerdict::absent;
  const ImuVerdict verdict = judge(watch, read, now, config.period);
  if (verdict != ImuVerdict::usable) return verdict;
  if (config.imu.contradiction > 0) compare(watch, read, config.imu.contradiction);
  if (watch.contradicts != 0) return ImuVerdict::contradicts;
  if (watch.in_force.sequence == 0 || !says_the_same(watch.in_force, read)) watch.changed_at = read.sensed_at;
  watch.in_force = read;
  return verdict;
}

CauseMask imu_conditions(const ImuWatch& watch, MonoTime now, const ImuConfig& config) {
  if (!config.present) return 0;
  return (is_lost(watch, now, config) ? bit(Cause::imu_lost) : 0) |
         (is_beyond(watch.in_force, config) ? bit(Cause::tilt) : 0);
}

}  // namespace takt::pipeline

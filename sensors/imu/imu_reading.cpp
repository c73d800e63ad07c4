// SPDX-License-Identifier: Apache-2.0
#include "sensors/imu/imu_reading.hpp"

#include <algorithm>
#include <cmath>

#include "executive/contract/imu.hpp"

namespace takt::sensors {
namespace {

constexpr Duration kTick = microseconds(100);  // of the part's own time
constexpr std::int64_t kCrystal = 5000;        // one part in so many
constexpr std::uint16_t kRestart = 0x8000;     // a counter that far ahead went back

Quaternion product(const Quaternion& a, const Quaternion& b) {
  return {a[0] * b[0] - a[1] * b[1] - a[2] * b[2] - a[3] * b[3], a[0] * b[1] + a[1] * b[0] + a[2] * b[3] - a[3] * b[2],
          a[0] * b[2] - a[1] * b[3] + a[2] * b[0] + a[3] * b[1], a[0] * b[3] + a[1] * b[2] - a[2] * b[1] + a[3] * b[0]};
}

Quaternion inverse(const Quaternion& unit) {
  return {unit[0], -unit[1], -unit[2], -unit[3]};
}

std::array<double, 3> rotated(const Quaternion& by, const std::array<double, 3>& v) {
  const Quaternion turned = product(product(by, {0, v[0], v[1], v[2]}), inverse(by));
  return {turned[1], turned[2], turned[3]};
}

}  // namespace

Quaternion rotation_of(const config::Vector3& rpy) {
  const auto about = [](std::size_t axis, double angle) {
    Quaternion q{std::cos(angle / 2), 0, 0, 0};
    q[axis + 1] = std::sin(angle / 2);
    return q;
  };
  return product(about(2, rpy[2]), product(about(1, rpy[1]), about(0, rpy[0])));
}

MonoTime ImuReading::stamp(const MtSample& sample, Heard heard) const {
  if (!before_ || !before_->ticks || !sample.ticks) return heard.since;
  const Duration elapsed = kTick * static_cast<std::uint32_t>(*sample.ticks - *before_->ticks);
  const Duration granted{elapsed.ns / kCrystal};
  const MonoTime by_its_clock = before_->sensed_at + elapsed + granted;
  return by_its_clock <= heard.at ? by_its_clock : heard.since;
}

std::optional<SensorSample> ImuReading::take(const MtSample& sample, Heard heard) {
  if (before_ && sample.counter == before_->counter) {
    ++counts_.repeated;
    return std::nullopt;
  }
  const auto ahead = static_cast<std::uint16_t>(sample.counter - (before_ ? before_->counter : 0));
  if (before_ && ahead < kRestart) counts_.lost += ahead - 1U;
  ++counts_.samples;

  SensorSample made;
  made.sensed_at = stamp(sample, heard);
  before_ = Before{sample.counter, sample.ticks, made.sensed_at};
  made.value_count = kImuValues;
  const auto narrow = [](double value) { return static_cast<float>(value); };
  const Quaternion base = product(sample.rotation, inverse(mounting_));
  float* next = std::ranges::transform(base, made.values, narrow).out;
  next = std::ranges::transform(rotated(mounting_, sample.angular_velocity), next, narrow).out;
  std::ranges::transform(rotated(mounting_, sample.acceleration), next, narrow);
  return made;
}

}  // namespace takt::sensors

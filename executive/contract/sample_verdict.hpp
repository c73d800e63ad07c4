// SPDX-License-Identifier: Apache-2.0
// What a reader concludes about the newest sample of an outside sensor before it uses it. Pure.
#pragma once

#include <algorithm>
#include <array>
#include <cmath>
#include <cstddef>
#include <cstdint>
#include <span>
#include <string_view>

#include "executive/contract/mono_time.hpp"

namespace takt {

enum class SampleVerdict : std::uint8_t {
  usable,
  none_yet,       // nothing was ever read, or what was read was damaged
  wrong_width,    // another number of values than the robot file lists
  from_future,    // sensed, or published, after now
  not_finite,     // NaN or infinity inside
  out_of_limits,  // a person's command beyond what the robot file allows
  too_old,        // older than the sensor's timeout
};
inline constexpr std::size_t kSampleVerdictCount = 7;

constexpr std::string_view name(SampleVerdict verdict) {
  constexpr std::array<std::string_view, kSampleVerdictCount> names{
      "usable", "none_yet", "wrong_width", "from_future", "not_finite", "out_of_limits", "too_old"};
  const auto index = static_cast<std::size_t>(verdict);
  return index < names.size() ? names[index] : "invalid";
}

struct SampleStamps {
  std::uint64_t sequence = 0;
  MonoTime sensed_at, published_at;
};

// The clock is one for all processes of the computer, so nothing honest is ahead of a reader's `now`.
constexpr SampleVerdict judge_stamps(const SampleStamps& stamps, MonoTime now, Duration timeout) {
  if (stamps.sequence == 0 || !stamps.sensed_at.is_set()) return SampleVerdict::none_yet;
  if (stamps.sensed_at > now || stamps.published_at > now) return SampleVerdict::from_future;
  return stamps.sensed_at < now - timeout ? SampleVerdict::too_old : SampleVerdict::usable;
}

inline bool all_finite(std::span<const float> values) {
  return std::ranges::all_of(values, [](float value) { return std::isfinite(value); });
}

}  // namespace takt

// SPDX-License-Identifier: Apache-2.0
// Instants and spans on the one clock of the system: CLOCK_MONOTONIC, signed 64-bit nanoseconds.
//
// There is no now(): time is passed in, so that the same code runs in real time, virtual time and replay.
// MonoTime{0} means "no such instant" wherever a stamp is optional. Range: +-292 years; sums are not checked.
#pragma once

#include <array>
#include <compare>
#include <concepts>
#include <cstdint>

#include "executive/contract/layout.hpp"

namespace takt {

struct Duration {
  std::int64_t ns = 0;
  friend constexpr auto operator<=>(Duration, Duration) = default;
  friend constexpr Duration operator+(Duration a, Duration b) { return {a.ns + b.ns}; }
  friend constexpr Duration operator-(Duration a, Duration b) { return {a.ns - b.ns}; }
  friend constexpr Duration operator*(Duration a, std::int64_t k) { return {a.ns * k}; }
  [[nodiscard]] constexpr double seconds() const { return static_cast<double>(ns) * 1e-9; }
  [[nodiscard]] constexpr double milliseconds() const { return static_cast<double>(ns) * 1e-6; }
};
template <std::same_as<Duration> Of>
constexpr auto fields_of(Shared<Of>) {
  return std::array{
      TAKT_FIELD(ns),
  };
}

constexpr Duration nanoseconds(std::int64_t n) {
  return {n};
}
constexpr Duration microseconds(std::int64_t n) {
  return {n * 1'000};
}
constexpr Duration milliseconds(std::int64_t n) {
  return {n * 1'000'000};
}
constexpr Duration seconds(std::int64_t n) {
  return {n * 1'000'000'000};
}

struct MonoTime {
  std::int64_t ns = 0;
  friend constexpr auto operator<=>(MonoTime, MonoTime) = default;
  friend constexpr Duration operator-(MonoTime a, MonoTime b) { return {a.ns - b.ns}; }
  friend constexpr MonoTime operator+(MonoTime t, Duration d) { return {t.ns + d.ns}; }
  friend constexpr MonoTime operator-(MonoTime t, Duration d) { return {t.ns - d.ns}; }
  [[nodiscard]] constexpr bool is_set() const { return ns != 0; }
};
template <std::same_as<MonoTime> Of>
constexpr auto fields_of(Shared<Of>) {
  return std::array{
      TAKT_FIELD(ns),
  };
}

static_assert(sizeof(Duration) == 8 && sizeof(MonoTime) == 8);

}  // namespace takt

// When a message of ROS 2 was sensed, by this machine's CLOCK_MONOTONIC. Pure.
//
// A stamp is Unix time by the clock of whoever wrote it: this machine's, which can be compared, or another's, of which
// nobody here knows how it is set. Nobody says which. So a stamp may only make a sample older than its arrival: one
// that is ahead of it counts as the arrival. What is then not in the age is what the network took, where the other
// clock is ahead by more than that; a clock that is behind makes samples too old, which is safe. A message without a
// stamp has DDS's own, of the instant of its writing.
#pragma once

#include <algorithm>
#include <cstdint>

#include "executive/contract/mono_time.hpp"

namespace takt::sensors {

// One instant by both clocks. `unix_ns` read after `at`: a pause between the two makes stamps older, never younger.
struct Arrival {
  MonoTime at;
  std::int64_t unix_ns = 0;
};

// Unix ns; 0 or less: there is none.
struct Stamps {
  std::int64_t header = 0;
  std::int64_t source = 0;  // DDS's own, by its writer
};

struct SensedAt {
  MonoTime at;
  Duration ahead;  // by which the stamp was after the arrival; 0: it was not
};

// Without any stamp the arrival counts.
constexpr SensedAt sensed_at(const Stamps& stamps, const Arrival& arrival) {
  const std::int64_t stamp = stamps.header > 0 ? stamps.header : stamps.source;
  if (stamp <= 0) return {arrival.at, {}};
  const std::int64_t before = arrival.unix_ns - stamp;
  if (before < 0) return {arrival.at, {-before}};
  // A stamp of 1970 on a machine that booted a minute ago: as old as can be said.
  return {MonoTime{std::max<std::int64_t>(arrival.at.ns - before, 1)}, {}};
}

}  // namespace takt::sensors

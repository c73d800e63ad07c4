// SPDX-License-Identifier: Apache-2.0
// When a message of ROS 2 was sensed, by this machine's CLOCK_MONOTONIC. Pure.
//
// A stamp is Unix time by the writer's clock: this machine's, which can be compared, or another's, of which
// the setting is unknown here. It does not say which. So a stamp may only make a sample older than its arrival: one
// that is ahead of it counts as the arrival. What is then not in the age is what the network took, where the other
// clock is ahead by more than that; a clock that is behind makes samples too old, which is safe. A message without a
// stamp has DDS's own, of the instant of its writing.
//
// Nor is a sample younger than the start of the wait in which it was taken, but as far as its sender's clock says how
// much later it was stamped than the one before (kDrift is granted to it): then it came that much later.
#pragma once

#include <algorithm>
#include <cstdint>
#include <optional>

#include "executive/contract/mono_time.hpp"
#include "sensors/wait_start.hpp"

namespace takt::sensors {

// One instant by both clocks. `unix_ns` read after `at`: a pause between the two makes stamps older, never younger.
struct Arrival {
  Heard heard;
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

// The samples of one topic, in the order in which they are taken. Thread rule: one thread at a time.
class SenderClock {
 public:
  SensedAt take(const Stamps& stamps, const Arrival& arrival) {
    const std::int64_t stamp = stamps.header > 0 ? stamps.header : stamps.source;
    const MonoTime came = came_at(stamp, arrival.heard);
    if (stamp <= 0) return {came, {}};
    before_ = Before{stamp, came};
    const std::int64_t before = arrival.unix_ns - stamp;
    if (before < 0) return {came, {-before}};
    // A stamp of 1970 on a machine that booted a minute ago: as old as can be said.
    const MonoTime by_clock{std::max<std::int64_t>(arrival.heard.at.ns - before, 1)};
    return {std::min(came, by_clock), {}};
  }

 private:
  static constexpr std::int64_t kDrift = 2000;  // one part in so many
  // Another writer of the topic, or a clock that was set, says what cannot be.
  [[nodiscard]] MonoTime came_at(std::int64_t stamp, const Heard& heard) const {
    if (!before_ || stamp <= before_->stamp) return heard.since;
    const std::int64_t most = heard.at.ns - before_->came.ns;
    const std::int64_t elapsed = stamp - before_->stamp;
    if (elapsed > most) return heard.since;
    const MonoTime came{std::min(before_->came.ns + elapsed + elapsed / kDrift, heard.at.ns)};
    return std::max(came, heard.since);
  }
  struct Before {
    std::int64_t stamp;
    MonoTime came;
  };
  std::optional<Before> before_;
};

}  // namespace takt::sensors

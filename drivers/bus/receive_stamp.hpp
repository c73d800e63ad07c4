// SPDX-License-Identifier: Apache-2.0
// Kernel receive stamps (SO_TIMESTAMPNS, CLOCK_REALTIME) on the system's one clock, and the other control messages that
// travel with a received frame.
//
// The distance between the two clocks is sampled per batch, after the batch was read, with two vDSO reads, no system
// call, so a stepped wall clock spoils at most the stamps of frames in flight. A spoilt stamp may make a frame older,
// never younger: one that waited for long, or seems to, is as old as its stamp says; one whose age is unknown
// (stamped in the future, or not at all) counts as kUndated. Thread rule: none of its own. Source: socket(7), can.rst.
#pragma once

#include <sys/socket.h>

#include <cstdint>
#include <optional>

#include "executive/contract/mono_time.hpp"

namespace takt::drivers {

// Older than anything that is believed.
inline constexpr MonoTime kUndated{1};

struct ClockPair {
  MonoTime monotonic;
  std::int64_t realtime_ns = 0;
};
ClockPair sample_clocks() noexcept;

// `realtime_ns`: the frame's stamp, if it has one. Never later than clocks.monotonic.
MonoTime to_monotonic(std::optional<std::int64_t> realtime_ns, const ClockPair& clocks) noexcept;

struct ControlMessages {
  std::optional<std::int64_t> realtime_ns;      // SO_TIMESTAMPNS
  std::optional<std::uint32_t> kernel_dropped;  // SO_RXQ_OVFL: frames this socket lost since it was opened
};
ControlMessages read_control_messages(const msghdr& message) noexcept;

}  // namespace takt::drivers

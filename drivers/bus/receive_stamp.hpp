// Kernel receive stamps (SO_TIMESTAMPNS, CLOCK_REALTIME) on the system's one clock, and the other control messages that
// travel with a received frame.
//
// The distance between the two clocks is sampled per batch with two vDSO reads, no system call, so a stepped wall
// clock spoils at most the stamps of frames in flight; those that come out impossible (in the future, or older than
// kOldestStamp) count as received now. Thread rule: none of its own. Source: socket(7), can.rst.
#pragma once

#include <sys/socket.h>

#include <cstdint>
#include <optional>

#include "executive/contract/mono_time.hpp"

namespace takt::drivers {

inline constexpr Duration kOldestStamp = seconds(1);

struct ClockPair {
  MonoTime monotonic;
  std::int64_t realtime_ns = 0;
};
ClockPair sample_clocks() noexcept;

MonoTime to_monotonic(std::int64_t realtime_ns, const ClockPair& clocks) noexcept;

struct ControlMessages {
  std::optional<std::int64_t> realtime_ns;      // SO_TIMESTAMPNS
  std::optional<std::uint32_t> kernel_dropped;  // SO_RXQ_OVFL: frames this socket lost since it was opened
};
ControlMessages read_control_messages(const msghdr& message) noexcept;

}  // namespace takt::drivers

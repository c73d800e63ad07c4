// SPDX-License-Identifier: Apache-2.0
#include "drivers/bus/receive_stamp.hpp"

#include <algorithm>
#include <cstring>
#include <ctime>

namespace takt::drivers {
namespace {

std::int64_t read_clock(clockid_t clock) noexcept {
  timespec now{};
  ::clock_gettime(clock, &now);
  return std::int64_t{now.tv_sec} * 1'000'000'000 + now.tv_nsec;
}

template <class Value>
std::optional<Value> payload(cmsghdr& header) noexcept {
  if (header.cmsg_len < CMSG_LEN(sizeof(Value))) return std::nullopt;
  Value value{};
  std::memcpy(&value, CMSG_DATA(&header), sizeof value);
  return value;
}

}  // namespace

ClockPair sample_clocks() noexcept {
  return {MonoTime{read_clock(CLOCK_MONOTONIC)}, read_clock(CLOCK_REALTIME)};
}

MonoTime to_monotonic(std::optional<std::int64_t> realtime_ns, const ClockPair& clocks) noexcept {
  if (!realtime_ns || *realtime_ns > clocks.realtime_ns) return kUndated;
  return std::max(clocks.monotonic - Duration{clocks.realtime_ns - *realtime_ns}, kUndated);
}

ControlMessages read_control_messages(const msghdr& message) noexcept {
  ControlMessages found;
  msghdr walk = message;  // CMSG_NXTHDR wants it writable
  for (cmsghdr* header = CMSG_FIRSTHDR(&walk); header != nullptr; header = CMSG_NXTHDR(&walk, header)) {
    if (header->cmsg_level != SOL_SOCKET) continue;
    if (header->cmsg_type == SCM_TIMESTAMPNS) {
      if (const auto stamp = payload<timespec>(*header))
        found.realtime_ns = std::int64_t{stamp->tv_sec} * 1'000'000'000 + stamp->tv_nsec;
    } else if (header->cmsg_type == SO_RXQ_OVFL) {
      found.kernel_dropped = payload<std::uint32_t>(*header);
    }
  }
  return found;
}

}  // namespace takt::drivers

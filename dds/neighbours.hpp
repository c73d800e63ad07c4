// SPDX-License-Identifier: Apache-2.0
// What neighbours on the network may cost a process that speaks DDS. Cyclone DDS binds its sockets to every address and
// writes a line about each packet that is malformed.
#pragma once

#include <chrono>
#include <cstdint>
#include <optional>
#include <set>
#include <string>

namespace takt::dds {

// Lines about what others sent: ten in ten seconds; what is more is counted. Pure. Thread rule: one thread at a time.
class LineBudget {
 public:
  using Instant = std::chrono::steady_clock::time_point;
  // The number of lines dropped before this one, which may be written; none: drop it.
  std::optional<std::uint64_t> take(Instant now);
  [[nodiscard]] std::uint64_t dropped() const { return dropped_; }  // since the last line that was written

  static constexpr int kLines = 10;
  static constexpr std::chrono::seconds kWindow{10};

 private:
  Instant window_begin_{};
  int written_ = 0;
  std::uint64_t dropped_ = 0;
};

// Cyclone DDS's own lines go to spdlog within a LineBudget, for all domains of the process.
void log_within_budget();
// Lines that log_within_budget() has dropped since the last one that it wrote.
std::uint64_t dropped_lines();

// The sockets of this process that receive datagrams over IP, by descriptor.
std::set<int> datagram_sockets();
// Makes the kernel drop what comes to `sockets` by another interface than that or the loopback. Of `lo` that is all
// others, of another one those that are there now: the interface itself may go and come back with another index, and is
// heard then. False: there is no such interface, or the kernel refuses.
bool hear_only(const std::set<int>& sockets, const std::string& interface);

}  // namespace takt::dds

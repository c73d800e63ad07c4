// SPDX-License-Identifier: Apache-2.0
// What a policy host does wrong because its command line says so, for panels with real processes and for drills:
//
//   --fault '3 s for 2 s: publish_delay 100 ms'
//
// The kinds and their doses: config/trouble/kinds.hpp. Times count from the first observation in tracking. What is
// drawn comes from a seed. Virtual time passed in; pure. Thread rule: one thread at a time.
#pragma once

#include <cstdint>
#include <deque>
#include <expected>
#include <random>
#include <span>
#include <string>
#include <vector>

#include "config/trouble/kinds.hpp"
#include "executive/contract/command_chunk.hpp"
#include "executive/contract/mono_time.hpp"
#include "executive/contract/observation.hpp"

namespace takt::policy_host {

using trouble::HostFault;

struct HostFaultWindow {
  Duration from, length;
  HostFault fault = HostFault::publish_delay;
  double dose = 0;  // publish_delay: ns; the others as counted
};

inline constexpr Duration kCallback = milliseconds(2);

// Lines of config/trouble/line.hpp. The error is one sentence: which line, what is wrong, how to write it.
std::expected<std::vector<HostFaultWindow>, std::string> parse_host_faults(std::span<const std::string> lines);

class HostFaults {
 public:
  HostFaults(std::vector<HostFaultWindow> windows, std::uint64_t seed);

  [[nodiscard]] bool any() const { return !windows_.empty(); }
  // Every observation read, in order.
  void see(const Observation& observation);
  [[nodiscard]] Duration publish_delay(MonoTime at) const;
  [[nodiscard]] bool keeps_all(MonoTime at) const { return dose(HostFault::queue_growth, at) > 0; }
  // For how long the host has other things to do from now on; asked, it counts as done.
  Duration take_callbacks(MonoTime at);
  void spoil(CommandChunk& chunk, MonoTime at);

 private:
  [[nodiscard]] const HostFaultWindow* active(HostFault fault, MonoTime at) const;  // null: none
  [[nodiscard]] double dose(HostFault fault, MonoTime at) const;                    // 0: none
  std::vector<HostFaultWindow> windows_;
  std::mt19937_64 random_;
  MonoTime tracking_since_;  // unset: not yet
  MonoTime next_burst_;      // of callbacks; unset: with the next window
};

}  // namespace takt::policy_host

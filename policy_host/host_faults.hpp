// SPDX-License-Identifier: Apache-2.0
// What a policy host does wrong because its command line says so, for panels with real processes and for drills:
//
//   --fault '3 s for 2 s: publish_delay 100 ms'   commands are published this much later
//   --fault '3 s for 2 s: queue_growth 150'       observations queue up instead of replacing one another, and once per
//                                                 second this many callbacks of 2 ms each come before them
//   --fault '3 s for 2 s: bad_actions_nan 0.5'    a command holds a NaN with this probability
//   --fault '3 s for 2 s: bad_actions_range 0.5'  a command asks one joint for 10 rad more with this probability
//   --fault '3 s for 2 s: wrong_joint_order 1'    positions go to joints this many places further on
//
// Times count from the first observation in tracking. What is drawn comes from a seed. Virtual time passed in; pure.
// Thread rule: one thread at a time.
#pragma once

#include <cstdint>
#include <deque>
#include <expected>
#include <random>
#include <span>
#include <string>
#include <vector>

#include "executive/contract/command_chunk.hpp"
#include "executive/contract/mono_time.hpp"
#include "executive/contract/observation.hpp"

namespace takt::policy_host {

enum class HostFault : std::uint8_t {
  publish_delay,
  queue_growth,
  bad_actions_nan,
  bad_actions_range,
  wrong_joint_order
};

struct HostFaultWindow {
  Duration from, length;
  HostFault fault = HostFault::publish_delay;
  double dose = 0;  // publish_delay: ns; the others as above
};

inline constexpr Duration kCallback = milliseconds(2);
inline constexpr double kMostCallbacks = 200;  // the host must notice within half a second that it is to end

// The error is one sentence: how to write it.
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

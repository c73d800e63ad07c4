// SPDX-License-Identifier: Apache-2.0
// Two network namespaces and a wire between them that can be bad: delay, jitter (which reorders), loss, frames that
// come twice, none at all. What `tc netem` does, in this process: kernels without sch_netem are common in test
// machines.
//
// A TAP device `takt0` in each namespace, 10.77.0.1 and 10.77.0.2; a thread carries frames between the two, by one
// seed. All is gone with the object. Needs root and /dev/net/tun. Thread rule: one thread.
#pragma once

#include <atomic>
#include <cstdint>
#include <mutex>
#include <optional>
#include <random>
#include <string>
#include <thread>
#include <vector>

#include "executive/contract/mono_time.hpp"
#include "tests/process/child.hpp"

namespace takt::test {

struct NetworkFaults {
  Duration delay, jitter;      // each way; a frame takes delay to delay + jitter
  double loss = 0, twice = 0;  // share of the frames
  bool is_cut = false;
  std::optional<int> cut_from = {};  // only what that side sends is lost
};

class FaultyNetwork {
 public:
  static constexpr const char* kAddresses[2] = {"10.77.0.1", "10.77.0.2"};
  // Empty: it can be had here. Else why not.
  static std::string why_not();
  FaultyNetwork();
  ~FaultyNetwork();
  FaultyNetwork(const FaultyNetwork&) = delete;
  FaultyNetwork& operator=(const FaultyNetwork&) = delete;

  void set(const NetworkFaults& faults);
  // Frames that were carried, both ways.
  [[nodiscard]] std::uint64_t carried() const { return carried_; }
  // Starts a program in one of the namespaces, 0 or 1.
  Child start(int side, const std::vector<std::string>& arguments, const std::string& log_path) const;

 private:
  struct End {
    int name_space = -1, tap = -1;
  };
  struct Frame {
    MonoTime due;
    int to;
    std::vector<std::uint8_t> bytes;
  };
  static End make_end(const char* address);
  void carry();
  void take(int from);
  void deliver(MonoTime now);
  End ends_[2];
  std::mutex mutex_;
  NetworkFaults faults_;  // guarded
  std::mt19937 random_{1};
  std::vector<Frame> under_way_;
  std::atomic<std::uint64_t> carried_ = 0;
  std::atomic<bool> stop_ = false;
  std::thread carrier_;
};

}  // namespace takt::test

// SPDX-License-Identifier: Apache-2.0
// A reader's hold on a running executive: the lease, its four rings mapped read-only, and what is known about the
// process at the other end. Letting go of it is closing the connection; the executive's loop notices neither.
#pragma once

#include <sys/types.h>

#include <chrono>
#include <expected>
#include <nlohmann/json.hpp>
#include <optional>
#include <string>
#include <string_view>
#include <vector>

#include "config/robot_config.hpp"
#include "executive/ipc/rendezvous.hpp"
#include "executive/ipc/segment.hpp"
#include "monitor/record/record_stream.hpp"
#include "monitor/record/run_manifest.hpp"

namespace takt::monitor {

class ExecutiveSession {
 public:
  // As `Role::monitor`, of which there is one, or as `Role::viewer`, of which there may be several; `program`
  // introduces the reader. The error is one sentence: no process listens, the role is taken, versions differ.
  static std::expected<ExecutiveSession, std::string> attach(Role role, std::string_view program,
                                                             const std::string& runtime_directory,
                                                             const config::RobotConfig& robot,
                                                             std::chrono::milliseconds timeout);
  [[nodiscard]] bool is_over() const { return ipc::is_over(lease_); }
  // See ipc::tell_recorded.
  void tell_recorded(std::uint64_t through_tick) const { ipc::tell_recorded(lease_, through_tick); }
  // See ipc::next_word.
  [[nodiscard]] auto next_word() const { return ipc::next_word(lease_); }
  [[nodiscard]] RingMemories rings() const;
  [[nodiscard]] pid_t pid() const { return pid_; }

 private:
  ExecutiveSession() = default;
  ipc::Lease lease_;
  std::vector<ipc::Segment> segments_;
  pid_t pid_ = 0;  // what the kernel says about the listener
};

// How a process of the monitor's kind introduces itself to the executive of `robot`.
Hello hello_of(Role role, std::string_view program, const config::RobotConfig& robot);

// What the manifest says about the session: identities, hashes, host, clock. Slow (hashes files): not while recording.
RunManifest describe(const ExecutiveSession& session, const config::RobotConfig& robot,
                     const std::string& runtime_directory, MonoTime now, std::int64_t unix_ns);

}  // namespace takt::monitor

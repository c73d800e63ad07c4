// SPDX-License-Identifier: Apache-2.0
// <runtime-dir>/executive.json: what the executive is and under which conditions it runs. Written once it runs, removed
// when it ends; the monitor copies it into the run's manifest. Schema takt.executive/1:
//   pid, version, binary_sha256 (of this program; "": unreadable), robot, config_sha256, config_hash, policy_sha256,
//   policy_hash, fallback_policy_hash
//   ("0000..." = any), realtime, allow_non_realtime, recorder (required or optional), realtime_steps [{name, ok,
//   essential, detail}], buses [{name, interface, description, and of a real controller as it was when it was opened
//   controller {state, bitrate, sample_point, sjw, data_bitrate, data_sample_point, data_sjw, queue_length,
//   transmit_errors, receive_errors, bus_errors, went_passive, went_off, restarts}}], wake, period_ns, started
//   {monotonic_ns, realtime_ns}. Hashes are hexadecimal text.
#pragma once

#include <cstdint>
#include <expected>
#include <string>
#include <vector>

#include "config/robot_config.hpp"
#include "drivers/bus/can_link.hpp"
#include "executive/runtime/realtime_setup.hpp"

namespace takt::runtime {

struct OpenedBusFacts {
  std::string description;  // drivers/bus/open_bus.hpp
  drivers::CanLink link;
};

struct ExecutiveFacts {
  const config::RobotConfig& robot;
  std::string policy_sha256{};      // of the policy that it admits (config/hash.hpp); empty: there is none
  std::uint64_t fallback_hash = 0;  // of the fallback policy; 0: there is none
  bool allow_non_realtime = false;
  std::vector<SetupStep> steps;
  std::vector<OpenedBusFacts> buses;  // in configuration order
};

class ExecutiveFile {
 public:
  // Written beside and renamed, so that a reader sees all of it or none.
  static std::expected<ExecutiveFile, std::string> write(const std::string& runtime_directory,
                                                         const ExecutiveFacts& facts);
  ExecutiveFile(ExecutiveFile&& other) noexcept;
  ExecutiveFile& operator=(ExecutiveFile&&) = delete;
  ~ExecutiveFile();  // removes it

 private:
  explicit ExecutiveFile(std::string path) : path_(std::move(path)) {}
  std::string path_;
};

}  // namespace takt::runtime

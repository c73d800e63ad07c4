// SPDX-License-Identifier: Apache-2.0
// The robot's outside sensors, served again on the policy's machine: sensor-NAME.sock beside the policy's seat, with
// stamps of this machine's clock made of the ages that the robot's observations state.
//
// A sample is passed on with the first observation that names it, so that a policy never sees one without the age that
// belongs to it. Thread rule: one thread. Errors: one sentence, from open().
#pragma once

#include <cstddef>
#include <cstdint>
#include <expected>
#include <memory>
#include <optional>
#include <string>
#include <vector>

#include "config/robot_config.hpp"
#include "executive/contract/mono_time.hpp"
#include "executive/ipc/sensor_server.hpp"
#include "policy_types.h"

namespace takt::policy_host::remote {

class FarSamples {
 public:
  // Serves every sensor that policy.observation lists. `robot` outlives this.
  static std::expected<FarSamples, std::string> open(const config::RobotConfig& robot,
                                                     const std::string& runtime_directory,
                                                     std::optional<uid_t> policy_user);
  // Keeps it until an observation names it. What does not fit the robot file is dropped.
  void take(const takt_remote_Sample& message);
  // Passes on what the observation names. False: not all of it has come, so the observation is not to be shown.
  bool pass_on(const takt_remote_Observation& message, MonoTime arrived_at);
  // Of the samples that were passed on last, one per sensor; unset: none.
  [[nodiscard]] MonoTime oldest_sensed_at() const;

 private:
  struct Source {
    const config::Sensor* sensor;
    std::uint32_t index;
    std::unique_ptr<ipc::SensorServer> server;
    std::uint64_t epoch = 0, sequence = 0;  // of the sample kept
    std::uint64_t passed_epoch = 0, passed_sequence = 0;
    std::uint64_t published = 0;
    MonoTime sensed_at;  // of the sample passed on last; unset: none
    std::vector<std::byte> kept;
  };
  Source* find(std::uint32_t index);
  static void publish(Source& source, MonoTime sensed_at);
  std::vector<Source> sources_;
};

}  // namespace takt::policy_host::remote

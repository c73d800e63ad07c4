// SPDX-License-Identifier: Apache-2.0
// The robot's outside sensors, served again on the policy's machine: sensor-NAME.sock beside the policy's seat, with
// stamps of this machine's clock made of the ages that the robot's observations state.
//
// A sample is passed on with the first observation that names it, so that a policy never sees one without the age that
// belongs to it. Thread rule: one thread. Errors: one sentence, from open().
#pragma once

#include <array>
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
#include "policy_host/remote/peer.hpp"
#include "policy_types.h"

namespace takt::policy_host::remote {

class FarSamples {
 public:
  // Serves every sensor that policy.observation lists. `robot` outlives this.
  static std::expected<FarSamples, std::string> open(const config::RobotConfig& robot,
                                                     const std::string& runtime_directory,
                                                     std::optional<uid_t> policy_user);
  // Keeps it until an observation of the same sender names it. What does not fit the robot file is dropped.
  void take(const takt_remote_Sample& message, const PeerId& sender);
  // Passes on what the observation names. False: not all of it has come, so the observation is not to be shown.
  // What `sender` sent is kept from now on, whatever others send.
  bool pass_on(const takt_remote_Observation& message, const PeerId& sender, MonoTime arrived_at);
  // Of the samples that were passed on last, one per sensor; unset: none.
  [[nodiscard]] MonoTime oldest_sensed_at() const;

 private:
  struct Kept {
    PeerId sender;
    std::uint64_t epoch = 0, sequence = 0;
    std::vector<std::byte> bytes;
  };
  struct Source {
    const config::Sensor* sensor;
    std::uint32_t index;
    std::unique_ptr<ipc::SensorServer> server;
    std::array<Kept, 2> kept;  // the robot's, and the newest of another: a new bridge's come before its observations
    std::uint64_t passed_epoch = 0, passed_sequence = 0;
    std::uint64_t published = 0;
    MonoTime sensed_at;  // of the sample passed on last; unset: none
  };
  Source* find(std::uint32_t index);
  static const Kept* kept_of(const Source& source, const PeerId& sender);
  static void publish(Source& source, const Kept& kept, MonoTime sensed_at);
  std::vector<Source> sources_;
  PeerId robot_;  // sender of the observation passed on last
};

}  // namespace takt::policy_host::remote

// SPDX-License-Identifier: Apache-2.0
// A sensor in a process of its own, behind takt/client.h: the robot file against what the sensor says it is, the
// mailbox, and samples written in place.
//
// Errors: an outcome and one sentence. Thread rule: one thread, besides the one that greets readers
// (executive/ipc/sensor_server.hpp). After open() nothing allocates or waits.
#pragma once

#include <cstddef>
#include <cstdint>
#include <expected>
#include <memory>
#include <string>

#include "client/policy_spec.hpp"
#include "client/takt/client.h"
#include "config/robot_config.hpp"
#include "executive/ipc/sensor_server.hpp"

namespace takt::client {

struct SensorSpec {
  std::string robot_file, runtime_directory, name, unit, policy_user;  // empty: not said
  bool is_image = false;
  std::uint32_t values = 0;
  config::ImageShape image;
};

class SensorSession {
 public:
  static std::expected<std::unique_ptr<SensorSession>, Refusal> open(const SensorSpec& spec);

  // These are those of takt/client.h.
  void* values();
  int publish(MonoTime sensed_at);
  [[nodiscard]] const takt_stream& stream() const { return stream_; }
  [[nodiscard]] const char* sentence() const { return sentence_; }

 private:
  SensorSession(config::Sensor sensor, std::unique_ptr<ipc::SensorServer> server);

  config::Sensor sensor_;
  takt_stream stream_;
  std::unique_ptr<ipc::SensorServer> server_;
  std::uint64_t sequence_ = 0;
  const char* sentence_ = "";
};

}  // namespace takt::client

// SPDX-License-Identifier: Apache-2.0
// One topic of ROS 2, and the sensor that it feeds. QoS as ROS 2's sensor data: best effort, volatile, the newest few.
// Cyclone DDS does not tell a best-effort reader what it lost; what can be counted is how often nothing came.
//
// Errors: one sentence. Thread rule: one thread, besides the one that greets the sensor's readers.
#pragma once

#include <chrono>
#include <cstdint>
#include <expected>
#include <memory>
#include <string>

#include "config/robot_config.hpp"
#include "dds/domain.hpp"
#include "executive/ipc/sensor_server.hpp"
#include "sensors/complaint.hpp"
#include "sensors/ros/ros_stamp.hpp"

namespace takt::sensors {

struct RosCounts {
  std::uint64_t samples = 0;  // published to the sensor's readers
  std::uint64_t refused = 0;  // messages that do not fit the robot file
  std::uint64_t pauses = 0;   // between two messages, longer than the sensor's timeout
  std::uint64_t ahead = 0;    // stamped after they arrived
  friend bool operator==(const RosCounts&, const RosCounts&) = default;
};

class RosTopicReader {
 public:
  // Precondition: sensor.ros. `sensor` and `server` outlive this.
  static std::expected<std::unique_ptr<RosTopicReader>, std::string> open(const dds::Domain& domain,
                                                                          const config::Sensor& sensor,
                                                                          ipc::SensorServer& server);
  RosTopicReader(const RosTopicReader&) = delete;
  RosTopicReader& operator=(const RosTopicReader&) = delete;
  ~RosTopicReader() = default;  // the domain ends the reader

  [[nodiscard]] dds_entity_t reader() const { return reader_; }
  // Publishes all that came. `waits`: the loop's that waits for it.
  void take_all(const WaitStart& waits);
  // Logs what changed since the last time.
  void report();

 private:
  RosTopicReader(const config::Sensor& sensor, ipc::SensorServer& server) : sensor_(sensor), server_(server) {}
  void take_one(const void* message, std::int64_t source_unix_ns, const WaitStart& waits);
  std::expected<void, std::string> publish(const void* message, MonoTime sensed);
  const config::Sensor& sensor_;
  ipc::SensorServer& server_;
  dds_entity_t reader_ = 0;
  std::uint64_t sequence_ = 0;
  SenderClock clock_;
  MonoTime heard_;
  RosCounts counts_, reported_;
  Complaint complaint_, old_;
};

}  // namespace takt::sensors

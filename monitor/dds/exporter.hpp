// SPDX-License-Identifier: Apache-2.0
// The monitor's line to ROS 2: an outbox that the recording thread fills, a thread that writes to DDS and opens the
// domain (again and again, when it cannot be had), and a thread that hands requests to the executive's operator socket
// where the robot file allows them. The recording thread waits for neither.
// Thread rule: construct, outbox() and destroy on one thread.
#pragma once

#include <mutex>
#include <string>
#include <thread>

#include "config/robot_config.hpp"
#include "monitor/dds/outbox.hpp"

namespace takt::monitor::dds {

class Participant;

class Exporter {
 public:
  // Precondition: robot.dds. `robot` outlives the exporter.
  Exporter(const config::RobotConfig& robot, std::string runtime_directory);
  // Ends both threads: within a second or two when DDS or the executive is slow to let go. Logs what was lost.
  ~Exporter();
  Exporter(const Exporter&) = delete;
  Exporter& operator=(const Exporter&) = delete;

  Outbox& outbox() { return outbox_; }

 private:
  void write_until_closed();
  void write_to(Participant& participant);
  void answer_requests(Participant& participant);
  void discard(const Outbox::Batch& batch);
  [[nodiscard]] RequestAnswer latest_answer() const;
  [[nodiscard]] std::uint64_t answers_given() const;

  const config::RobotConfig& robot_;
  std::string runtime_directory_;
  Outbox outbox_;
  mutable std::mutex answer_mutex_;
  RequestAnswer answer_;       // guarded
  std::uint64_t answers_ = 0;  // guarded; how many there were
  Status latest_;              // writing thread
  std::thread writer_;         // last: everything else is there when it starts
};

}  // namespace takt::monitor::dds

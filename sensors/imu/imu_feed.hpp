// SPDX-License-Identifier: Apache-2.0
// One hearing of an MTi, from the opening of its port or bus to the end of it: its samples go into the sensor's
// mailbox, what became of them into the log. Thread rule: one thread.
#pragma once

#include <cstdint>
#include <string>

#include "executive/contract/mono_time.hpp"
#include "executive/ipc/sensor_server.hpp"
#include "sensors/complaint.hpp"
#include "sensors/imu/imu_reading.hpp"

namespace takt::sensors {

// What outlives a hearing. `place`: where the part is, for the log.
struct ImuSeat {
  ipc::SensorServer& server;
  Quaternion mounting;
  std::string place;
  std::uint64_t sequence = 0;  // of the last sample served
  Complaint complaint{};
};

class ImuFeed {
 public:
  explicit ImuFeed(ImuSeat& seat);

  void publish(const MtSample& sample, Heard heard);
  // The part speaks, but what it says is no sample.
  void refuse(const std::string& why);
  // At most once a second, and where there is news: what was lost so far. `damaged`: what came and was no sample.
  void report(std::uint64_t damaged);
  // The part said nothing for longer than a person should wait to be told.
  [[nodiscard]] bool is_silent() const;

 private:
  ImuSeat& seat_;
  ImuReading reading_;
  MonoTime heard_at_, reported_at_;
  ImuCounts reported_;
  std::uint64_t reported_damaged_ = 0;
};

}  // namespace takt::sensors

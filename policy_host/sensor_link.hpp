// SPDX-License-Identifier: Apache-2.0
// One outside sensor: attaches to the process that serves it as often as needed, keeps its newest sample.
//
// Before the first sample, and after the sensor's process restarted until it publishes again, the sample kept is the
// last one seen (sequence 0 if none): its age tells. Thread rule: one thread; update() may block for the connect
// deadline while detached, at most twice a second.
#pragma once

#include <cstdint>
#include <optional>
#include <span>
#include <string>
#include <vector>

#include "config/robot_config.hpp"
#include "executive/contract/sample_verdict.hpp"
#include "executive/contract/sensor_sample.hpp"
#include "executive/contract/session.hpp"
#include "executive/ipc/executive_segments.hpp"
#include "executive/ipc/rendezvous.hpp"
#include "executive/ipc/segment.hpp"
#include "executive/ipc/slot_ring.hpp"

namespace takt::policy_host {

class SensorLink {
 public:
  SensorLink(std::string socket, const Hello& hello, const ipc::RingShape& shape = ipc::sensor_mailbox());
  // Attaches if due, then reads. `sample` changes only when a newer one arrived.
  void update(MonoTime now, SensorSample& sample);
  // The same of a sensor of images (image_bytes()): `image` is an ImageHeader and what it heads, copied once, to where
  // it is used. A copy that failed leaves none, and `sample` says so.
  void update(MonoTime now, SensorSample& sample, std::span<std::byte> image);
  // For who reads every sample: attaches if due; then the next that was not returned yet, oldest first.
  void stay_attached(MonoTime now);
  ipc::ReadResult next(std::span<std::byte> sample);
  // How often it attached.
  [[nodiscard]] std::uint64_t sessions() const { return sessions_; }
  // Why it is not attached; empty while it is.
  [[nodiscard]] const std::string& problem() const { return problem_; }

 private:
  ipc::ReadStatus read(MonoTime now, std::span<std::byte> newest);
  struct Attached {
    ipc::Lease lease;
    ipc::Segment segment;
    ipc::SlotReader reader;
  };
  void attach();
  std::string socket_;
  Hello hello_;
  ipc::RingShape shape_;
  std::optional<Attached> attached_;
  std::string problem_ = "not attached yet";
  MonoTime next_attempt_;
  std::uint64_t sessions_ = 0;
};

// Indices of the sensors that the observation terms use, in the robot file's order.
std::vector<std::size_t> sensors_in_use(const config::RobotConfig& robot);

// The mailbox of its samples: of floats, or of images of its shape.
ipc::RingShape mailbox_of(const config::Sensor& sensor);
// Of an image with its header; 0: it has none.
std::size_t image_bytes(const config::Sensor& sensor);

// Of a sample of floats, and of an image by its stamps. `now`: read after the sample was.
SampleVerdict judge(const config::Sensor& sensor, const SensorSample& sample, MonoTime now);
std::string sentence_of(SampleVerdict verdict, const config::RobotConfig& robot, const config::Sensor& sensor);

// Stands for a person who says nothing: another sequence than any real sample's.
inline constexpr std::uint64_t kAbsentSequence = UINT64_MAX;

// Fills `used` with what may drive the robot: the samples seen, and for a command without a usable one its when_absent,
// as of now. The first reason why there is no such thing (never seen, wrong size, a lie, too old); empty: there is.
// `seen`, `used`: one per sensor of the robot file, in its order.
std::string take_usable(const config::RobotConfig& robot, std::span<const std::size_t> in_use,
                        std::span<const SensorSample> seen, MonoTime now, std::span<SensorSample> used);

}  // namespace takt::policy_host

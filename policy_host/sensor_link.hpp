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
#include "executive/contract/sensor_sample.hpp"
#include "executive/contract/session.hpp"
#include "executive/ipc/rendezvous.hpp"
#include "executive/ipc/segment.hpp"
#include "executive/ipc/slot_ring.hpp"

namespace takt::policy_host {

class SensorLink {
 public:
  SensorLink(std::string socket, const Hello& hello);
  // Attaches if due, then reads. `sample` changes only when a newer one arrived.
  void update(MonoTime now, SensorSample& sample);
  // Why it is not attached; empty while it is.
  [[nodiscard]] const std::string& problem() const { return problem_; }

 private:
  struct Attached {
    ipc::Lease lease;
    ipc::Segment segment;
    ipc::SlotReader reader;
  };
  void attach();
  std::string socket_;
  Hello hello_;
  std::optional<Attached> attached_;
  std::string problem_ = "not attached yet";
  MonoTime next_attempt_;
};

// Indices of the sensors that the observation terms use, in the robot file's order.
std::vector<std::size_t> sensors_in_use(const config::RobotConfig& robot);

// The first reason why these samples must not drive the robot (never seen, wrong size, too old), empty when all may.
// `samples`: one per sensor of the robot file, in its order.
std::string unusable(const config::RobotConfig& robot, std::span<const std::size_t> in_use,
                     std::span<const SensorSample> samples, MonoTime now);

}  // namespace takt::policy_host

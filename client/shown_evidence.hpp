// SPDX-License-Identifier: Apache-2.0
// What a policy behind takt/client.h was shown for an answer, as bytes for the recorder
// (executive/contract/policy_input.hpp): the quantities of the joints that its terms name, the samples behind its
// streams and queues with their stamps, which images, and what was promised of the path being played.
//
// Of a quantity or sensor that several terms show there is one copy. What the policy made of it, it alone knows. Pure:
// no clock, no I/O; allocates nothing after construction. Thread rule: one thread.
#pragma once

#include <cstddef>
#include <cstdint>
#include <span>
#include <vector>

#include "client/sample_queue.hpp"
#include "client/takt/client.h"
#include "config/robot_config.hpp"
#include "executive/contract/observation.hpp"
#include "executive/contract/policy_input.hpp"
#include "executive/contract/sensor_sample.hpp"

namespace takt::client {

class ShownEvidence {
 public:
  // Precondition: config::largest_policy_input(robot) is not 0.
  ShownEvidence(const config::RobotConfig& robot, std::uint64_t policy_hash);
  // A term of TAKT_TERM_ kind `kind`; `sensor`: index into the robot's sensors, of those that show one. `queue`: of a
  // queue, outlives this.
  void add_term(std::uint32_t kind, std::size_t sensor, const SampleQueue* queue);

  // What is handed out from here on. `samples`: one per sensor of the robot file, as `view` shows them.
  void show(const Observation& shown, const takt_observation& view, std::span<const SensorSample> samples);
  // The next answer, to what was shown last. The result is valid until the next call, and no longer than
  // largest_policy_input().
  std::span<const std::byte> answer(std::uint64_t sequence);

 private:
  struct ShownSensor {
    std::size_t sensor;
    bool newest;               // a stream or an image
    const SampleQueue* queue;  // null: none
  };
  void put_samples(PolicyInputPacker& packer, std::span<const SensorSample> samples) const;
  void put_values(PolicyInputPacker& packer, const Observation& shown, std::span<const SensorSample> samples) const;
  [[nodiscard]] std::size_t sample_count() const;

  std::uint32_t joints_;
  std::vector<ShownSensor> sensors_;  // in the robot file's order
  std::vector<bool> is_image_;        // one per sensor of the robot file
  PolicyInputHeader header_;
  std::vector<std::byte> payload_;
  std::size_t used_ = 0;  // bytes of it
};

}  // namespace takt::client

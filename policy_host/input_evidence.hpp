// SPDX-License-Identifier: Apache-2.0
// What a policy's network was shown and what it said, as bytes for the recorder (executive/contract/policy_input.hpp).
//
// Of a policy host; what a policy behind takt/client.h is shown, client/shown_evidence.hpp packs. Pure:
// no clock, no I/O; allocates nothing after construction. Thread rule: one thread.
#pragma once

#include <cstddef>
#include <cstdint>
#include <span>
#include <vector>

#include "config/robot_config.hpp"
#include "executive/contract/observation.hpp"
#include "executive/contract/policy_input.hpp"
#include "executive/contract/sensor_sample.hpp"
#include "policy_host/observation_builder.hpp"
#include "policy_host/responder.hpp"

namespace takt::policy_host {

class InputEvidence {
 public:
  // Precondition: check_policy_section passed, config::largest_policy_input(robot) is not 0. `owner`: as a Responder's.
  InputEvidence(const config::RobotConfig& robot, std::uint64_t policy_hash, bool built_in,
                PathOwner owner = PathOwner::policy);

  // `samples`: one per sensor of the robot file, as the answer was made from them. `sequence`: of the answer. The
  // result is valid until the next call, and no longer than largest_policy_input().
  std::span<const std::byte> pack(const Observation& answered, std::span<const SensorSample> samples,
                                  std::uint64_t sequence, const Inference& inference);

 private:
  void put_samples(PolicyInputPacker& packer, std::span<const SensorSample> samples,
                   std::span<const SeenImage> images) const;

  std::size_t joints_;
  PathOwner owner_;
  std::vector<std::size_t> sensors_;  // in use, without images
  std::vector<ImagePlace> image_places_;
  PolicyInputHeader header_;  // the constant part
  std::vector<std::byte> payload_;
};

}  // namespace takt::policy_host

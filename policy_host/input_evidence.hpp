// What a policy's network was shown and what it said, as bytes for the recorder (executive/contract/policy_input.hpp).
//
// Of hosts whose engines see numbers only; a host of takt/client.h makes its own inputs, and says nothing of them.
// Pure: no clock, no I/O; allocates nothing after construction. Thread rule: one thread.
#pragma once

#include <cstddef>
#include <cstdint>
#include <span>
#include <vector>

#include "config/robot_config.hpp"
#include "executive/contract/observation.hpp"
#include "executive/contract/policy_input.hpp"
#include "executive/contract/sensor_sample.hpp"
#include "policy_host/responder.hpp"

namespace takt::policy_host {

class InputEvidence {
 public:
  // Precondition: check_policy_section passed, config::largest_policy_input(robot) is not 0.
  InputEvidence(const config::RobotConfig& robot, std::uint64_t policy_hash, bool built_in);

  // `samples`: one per sensor of the robot file, as the answer was made from them. `sequence`: of the answer. The
  // result is valid until the next call, and no longer than largest_policy_input().
  std::span<const std::byte> pack(const Observation& answered, std::span<const SensorSample> samples,
                                  std::uint64_t sequence, const Inference& inference);

 private:
  std::size_t joints_;
  std::vector<std::size_t> sensors_;  // in use
  PolicyInputHeader header_;          // the constant part
  std::vector<std::byte> payload_;
};

}  // namespace takt::policy_host

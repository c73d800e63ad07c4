// SPDX-License-Identifier: Apache-2.0
// What is not ours in a rollout: commands of the user's.
#pragma once

#include <string>

#include "policy_host/boundary.hpp"

namespace takt::evidence {

struct OutsideProcesses {
  std::string world =
      {};  // a command or a socket, as simulation::WorldProcess has it; empty: the robot file's own mechanics
  std::string policy = {};  // as PolicyProcess has it; empty: policy.file is a network
  policy_host::Grants policy_may = {};
};

}  // namespace takt::evidence

// SPDX-License-Identifier: Apache-2.0
// Networks behind the Policy port, and what feeds what: the observation, each other, their own past.
//
//   observation   the inputs that carry it, one after the other
//   flows         outputs that feed inputs of later networks, within one inference
//   states        outputs that feed inputs of the next inference; `start` after load and reset
//   time_steps    inputs of one number: inferences since load or reset (motion trackers)
//   step_counts   likewise, begun anew after kStepCounts, a multiple of every number to 10: who takes the remainder of
//                 one of those never sees a step too many or too few (exploy)
//   references    stretches of the observation that outputs of the inference before fill. After load and reset that is
//                 one of an observation of zeros at time step 0; the first answer then has time step 1, as the
//                 exporters' own runtime does it
//   outputs       what the policy gives, one after the other, the action first
#pragma once

#include <cstddef>
#include <cstdint>
#include <memory>
#include <vector>

#include "policy_host/network.hpp"
#include "policy_host/policy.hpp"

namespace takt::policy_host {

struct Port {
  std::size_t network = 0, tensor = 0;
  bool operator==(const Port&) const = default;
};

// As many steps as a float32 tells apart.
inline constexpr std::uint64_t kStepCounts = (1U << 24U) / 2520 * 2520;

struct Wiring {
  struct Flow {
    Port from, to;
  };
  struct State {
    Port from, to;
    std::vector<float> start;  // as many as the tensor has
  };
  struct Reference {
    Port from;
    std::size_t at = 0;  // index of its first value in the observation
  };
  std::vector<Port> observation, time_steps, step_counts, outputs;
  std::vector<Flow> flows;
  std::vector<State> states;
  std::vector<Reference> references;
};

struct NetworkGraph {
  std::vector<std::unique_ptr<Network>> networks;  // in the order in which they run
  Wiring wiring;
};

// Precondition: at least one network; every port exists, flows go from earlier networks to later ones, sizes of
// connected tensors are equal.
std::unique_ptr<Policy> make_network_policy(std::vector<std::unique_ptr<Network>> networks, Wiring wiring);

}  // namespace takt::policy_host

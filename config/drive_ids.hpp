// SPDX-License-Identifier: Apache-2.0
// Which CAN ids a drive hears and speaks, by protocol: for filters, for telling drives apart, for noticing strangers.
// Source of every number: the protocol's codec in drivers/. Pure.
#pragma once

#include <cstdint>
#include <vector>

#include "config/robot_config.hpp"

namespace takt::config {

// Every id that equals `id` in the bits of `mask`.
struct IdPattern {
  std::uint32_t id = 0;
  std::uint32_t mask = 0x7FF;
  bool extended = false;
  [[nodiscard]] constexpr bool matches(std::uint32_t other, bool other_extended) const {
    return other_extended == extended && ((other ^ id) & mask) == 0;
  }
};

// Some id fits both.
constexpr bool overlap(const IdPattern& a, const IdPattern& b) {
  return a.extended == b.extended && ((a.id ^ b.id) & a.mask & b.mask) == 0;
}

struct DriveIds {
  std::vector<IdPattern> commands;    // to this drive alone
  std::vector<IdPattern> broadcasts;  // to every drive of its protocol
  std::vector<IdPattern> replies;     // from this drive
  std::vector<IdPattern> betrayals;   // from it too, should it speak another protocol: heard, so that it can be named
};

DriveIds ids_of(const Drive& drive);

}  // namespace takt::config

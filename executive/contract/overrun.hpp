// SPDX-License-Identifier: Apache-2.0
// Why a period was missed, from the scheduling evidence around it (first match wins; see runtime/overrun).
#pragma once

#include <array>
#include <cstddef>
#include <cstdint>
#include <string_view>

namespace takt {

enum class OverrunCause : std::uint8_t {
  none,
  blocked,         // the loop slept inside the tick: a voluntary switch in its own call
  preempted,       // run delay grew: the scheduler gave the core to another task
  page_fault,      // memory was not resident
  own_overrun,     // the tick itself worked for too long
  platform_stall,  // neither: hypervisor steal, SMI, late timer
};
inline constexpr std::size_t kOverrunCauseCount = 6;

constexpr std::string_view name(OverrunCause cause) {
  constexpr std::array<std::string_view, kOverrunCauseCount> names{"none",       "blocked",     "preempted",
                                                                   "page_fault", "own_overrun", "platform_stall"};
  const auto index = static_cast<std::size_t>(cause);
  return index < names.size() ? names[index] : "invalid";
}

}  // namespace takt

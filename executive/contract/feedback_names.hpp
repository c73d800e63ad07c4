// SPDX-License-Identifier: Apache-2.0
// How files, metrics and screens spell what drives and buses report.
#pragma once

#include <array>
#include <string_view>

#include "executive/contract/feedback.hpp"

namespace takt {

inline constexpr std::array<std::string_view, 4> kDriveStateNames{"unknown", "disabled", "enabled", "fault"};
inline constexpr std::array<std::string_view, 4> kBusStateNames{"up", "error_passive", "bus_off", "down"};

// "invalid" for a value that is none.
constexpr std::string_view name(DriveState state) {
  const auto index = static_cast<std::size_t>(state);
  return index < kDriveStateNames.size() ? kDriveStateNames[index] : "invalid";
}

constexpr std::string_view name(BusState state) {
  const auto index = static_cast<std::size_t>(state);
  return index < kBusStateNames.size() ? kBusStateNames[index] : "invalid";
}

}  // namespace takt

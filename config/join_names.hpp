// SPDX-License-Identifier: Apache-2.0
// policy.action.join.kind, as a robot file spells it.
#pragma once

#include <array>
#include <cstddef>
#include <string_view>

#include "config/robot_config.hpp"

namespace takt::config {

inline constexpr std::array<std::string_view, 7> kJoinNames{"replace", "cross_fade", "blend", "ensemble",
                                                            "align",   "quintic",    "prefix"};
constexpr std::string_view name(JoinKind kind) {
  return kJoinNames[static_cast<std::size_t>(kind)];
}

}  // namespace takt::config

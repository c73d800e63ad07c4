// SPDX-License-Identifier: Apache-2.0
// The angle by which a person saw a joint turn, or the way by which a slide moved, against what its drive told: the
// only proof of gear_ratio, and of what else scales every number of a drive alike. Kept in the runtime directory
// (seen-N) for the drive card, until the robot file has another scale for that drive. Set-up only.
#pragma once

#include <cstddef>
#include <expected>
#include <optional>
#include <string>

#include "config/robot_config.hpp"

namespace takt::drivers {

struct SeenAngle {
  double moved = 0;  // rad, of a slide m, joint side, by what the drive told
  double seen = 0;   // by a person's word
  std::string day{};
};

// A person sees a degree or a millimetre, or a tenth of a longer way.
inline constexpr double kSeenShare = 0.1;

// What is wrong by that word; empty: it fits.
std::string contradicted_by_eye(const config::Joint& joint, const SeenAngle& angle);
// "+5.0 deg seen where the drive told +5.0 deg, 2026-11-28"
std::string text_of(config::JointKind kind, const SeenAngle& angle);

// The error is a sentence. Without `angle` what was kept is gone.
std::expected<void, std::string> keep_seen_angle(const std::string& runtime_directory, const config::RobotConfig& robot,
                                                 std::size_t joint, const std::optional<SeenAngle>& angle);
// Nothing: none was kept, or the robot file has another scale now.
std::optional<SeenAngle> seen_angle(const std::string& runtime_directory, const config::RobotConfig& robot,
                                    std::size_t joint);

}  // namespace takt::drivers

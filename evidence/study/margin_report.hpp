// What `takt margin` shows: a table for the terminal (at most 80 columns, UTF-8), one JSON object, a Bode plot.
#pragma once

#include <nlohmann/json.hpp>
#include <optional>
#include <span>
#include <string>

#include "config/robot_config.hpp"
#include "evidence/study/age_tolerance.hpp"
#include "evidence/study/joint_margins.hpp"

namespace takt::margin {

// Why a robot on a base of its own has no joints in its report.
inline constexpr const char* kNoInnerLoop =
    "its base is free: without the policy it falls, and there is no rest to measure a joint's loop at";

struct MarginReport {
  const config::RobotConfig& robot;
  std::vector<JointMargins> joints;
  std::optional<AgeTolerance> tolerance;  // absent: not asked for, or no policy
  [[nodiscard]] bool agrees() const;
};

std::string margin_text(const MarginReport& report);
nlohmann::ordered_json to_json(const MarginReport& report);
// Gain and phase of every joint's loop: lines computed, marks injected.
std::string bode_svg(std::span<const JointMargins> joints);

}  // namespace takt::margin

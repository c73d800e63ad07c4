// SPDX-License-Identifier: Apache-2.0
// What `takt margin` shows: a table for the terminal (at most 80 columns, UTF-8), one JSON object, a Bode plot.
#pragma once

#include <nlohmann/json.hpp>
#include <optional>
#include <span>
#include <string>

#include "config/robot_config.hpp"
#include "lab/study/age_tolerance.hpp"
#include "lab/study/joint_margins.hpp"

namespace takt::study {

struct MarginReport {
  const config::RobotConfig& robot;
  std::vector<JointMargins> joints;
  std::optional<AgeTolerance> tolerance;  // absent: not asked for, or no policy
  std::string not_measured = {};          // why there are no joints; empty: there are
  [[nodiscard]] bool agrees() const;
  [[nodiscard]] bool rings() const;
};

// Of a joint that rings: its margin, and what corrects it. One sentence.
std::string ringing_sentence(const JointMargins& joint);
std::string margin_text(const MarginReport& report);
nlohmann::ordered_json to_json(const MarginReport& report);
// Gain and phase of every joint's loop: lines computed, marks injected. Precondition: some joint has a loop.
std::string bode_svg(std::span<const JointMargins> joints);

}  // namespace takt::study

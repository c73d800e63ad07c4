// SPDX-License-Identifier: Apache-2.0
// The screen's upper lines: what holds for the robot as a whole. Pure.
#pragma once

#include "cli/top/picture.hpp"
#include "cli/top/screen_line.hpp"
#include "cli/top/screen_plots.hpp"

namespace takt::monitor::top {

Line title(const Picture& picture);
// Why the robot stands, over as many lines as it takes, at most kIncidentRows; none while it does not.
inline constexpr std::size_t kIncidentRows = 3;
std::vector<Line> incident_lines(const Picture& picture, std::size_t columns);
Line age_line(const Picture& picture);
Line stages_line(const Picture& picture, Glyphs glyphs);
Line misses_line(const Picture& picture);
Line overruns_line(const Picture& picture);
Line policy_line(const Picture& picture);

}  // namespace takt::monitor::top

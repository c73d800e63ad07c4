// The screen's upper lines: what holds for the robot as a whole. Pure.
#pragma once

#include "cli/top/picture.hpp"
#include "cli/top/screen_line.hpp"
#include "cli/top/screen_plots.hpp"

namespace takt::monitor::top {

Line title(const Picture& picture);
Line age_line(const Picture& picture);
Line stages_line(const Picture& picture, Glyphs glyphs);
Line misses_line(const Picture& picture);
Line overruns_line(const Picture& picture);
Line policy_line(const Picture& picture);

}  // namespace takt::monitor::top

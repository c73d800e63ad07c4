// SPDX-License-Identifier: Apache-2.0
// The screen's lower lines: buses and joints. Pure.
#pragma once

#include <cstddef>
#include <vector>

#include "cli/top/picture.hpp"
#include "cli/top/screen_line.hpp"

namespace takt::monitor::top {

// As many side by side as fit.
std::vector<Line> bus_lines(const Picture& picture, std::size_t columns);
// A header and the joints from number `scroll` on, or the last that fill `rows`.
std::vector<Line> joint_lines(const Picture& picture, std::size_t scroll, std::size_t rows);

}  // namespace takt::monitor::top

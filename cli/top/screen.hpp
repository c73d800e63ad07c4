// SPDX-License-Identifier: Apache-2.0
// What `takt top` shows: a picture and the state of its keyboard in, lines of text out. Pure: same input, same lines.
//
// Never more lines than rows, never a line wider than columns. 80 x 24 holds twelve joints and four buses; with more
// room the age plot grows, with less the list of joints scrolls; below kLeast one line says that it is too small.
#pragma once

#include <cstddef>
#include <string>
#include <vector>

#include "cli/top/keys.hpp"
#include "cli/top/picture.hpp"
#include "cli/top/screen_line.hpp"
#include "cli/top/screen_plots.hpp"

namespace takt::monitor::top {

struct Size {
  std::size_t rows = 24, columns = 80;
};
inline constexpr Size kLeast{16, 72};

std::vector<Line> render(const Picture& picture, const Prompt& prompt, Size size, Glyphs glyphs);

}  // namespace takt::monitor::top

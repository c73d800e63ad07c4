// SPDX-License-Identifier: Apache-2.0
// The drawings of the screen: the mode band, the age over time against its limit, bars. Pure.
#pragma once

#include <cstddef>
#include <span>
#include <vector>

#include "cli/top/picture.hpp"
#include "cli/top/screen_line.hpp"

namespace takt::monitor::top {

// unicode: block elements (U+2581 and on); ascii: for terminals and locales without them.
enum class Glyphs : std::uint8_t { unicode, ascii };

Style mode_style(Mode mode);

// One letter per slice, the newest at the right: s standby, a arming, T tracking, D degraded, S damped stop, F fault,
// `!` where the operator marked, blank where nothing is known.
Line mode_band(std::span<const Slice> history, std::size_t columns);

// `rows` lines, top first, one column per slice, the newest at the right. With one row its last level means "past the
// limit"; with more the limit is a line of its own at three quarters of the height. What is past it, or missed, is in
// alarm style; a slice without any command shows nothing.
std::vector<Line> age_plot(std::span<const Slice> history, Duration limit, std::size_t columns, std::size_t rows,
                           Glyphs glyphs);

// Parts of a whole side by side, `whole` being `columns` wide; parts are cut off at its end.
inline constexpr std::size_t kMostParts = 5;
Line stacked_bar(std::span<const double> parts, double whole, std::size_t columns, Glyphs glyphs);
// What the n-th part of a stacked bar is drawn with.
std::string_view part_glyph(std::size_t part, Glyphs glyphs);

}  // namespace takt::monitor::top

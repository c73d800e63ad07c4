// SPDX-License-Identifier: Apache-2.0
#include "cli/top/screen_plots.hpp"

#include <algorithm>
#include <array>
#include <cmath>

namespace takt::monitor::top {
namespace {

constexpr std::size_t kLevels = 8;  // of one cell, besides empty
constexpr std::array<std::string_view, kLevels + 1> kUnicodeLevels{" ", "▁", "▂", "▃", "▄", "▅", "▆", "▇", "█"};
constexpr std::array<std::string_view, kLevels + 1> kAsciiLevels{" ", ".", ".", ":", "-", "=", "+", "*", "#"};
constexpr std::array<std::string_view, kMostParts> kUnicodeParts{"█", "▓", "▒", "░", "╌"};
constexpr std::array<std::string_view, kMostParts> kAsciiParts{"s", "q", "i", "p", "h"};

char letter_of(Mode mode) {
  switch (mode) {
    case Mode::standby:
      return 's';
    case Mode::arming:
      return 'a';
    case Mode::tracking:
      return 'T';
    case Mode::degraded:
      return 'D';
    case Mode::damped_stop:
      return 'S';
    case Mode::fault_latched:
      return 'F';
  }
  return '?';
}

std::span<const Slice> newest(std::span<const Slice> history, std::size_t columns) {
  return history.last(std::min(history.size(), columns));
}

// Blanks on the left, so that the newest slice stands at the right edge.
Line padded(std::size_t shown, std::size_t columns) {
  Line line;
  line.add(std::string(columns - shown, ' '));
  return line;
}

// How many of `rows` x kLevels levels the age fills.
std::size_t levels_of(Duration age, Duration limit, std::size_t rows) {
  const std::size_t all = rows * kLevels;
  const std::size_t at_limit = rows == 1 ? kLevels - 1 : all * 3 / 4;
  if (age.ns <= 0 || limit.ns <= 0) return 0;
  const double level =
      std::ceil(static_cast<double>(age.ns) / static_cast<double>(limit.ns) * static_cast<double>(at_limit));
  return level < static_cast<double>(all) ? static_cast<std::size_t>(level) : all;
}

}  // namespace

Style mode_style(Mode mode) {
  switch (mode) {
    case Mode::standby:
      return Style::faint;
    case Mode::arming:
      return Style::plain;
    case Mode::tracking:
      return Style::good;
    case Mode::degraded:
      return Style::warning;
    case Mode::damped_stop:
    case Mode::fault_latched:
      return Style::alarm;
  }
  return Style::plain;
}

Line mode_band(std::span<const Slice> history, std::size_t columns) {
  const auto shown = newest(history, columns);
  Line line = padded(shown.size(), columns);
  for (const Slice& slice : shown) {
    const char letter = slice.ticks == 0 ? ' ' : slice.marked ? '!' : letter_of(slice.mode);
    line.add(std::string(1, letter), slice.marked ? Style::strong : mode_style(slice.mode));
  }
  return line;
}

std::vector<Line> age_plot(std::span<const Slice> history, Duration limit, std::size_t columns, std::size_t rows,
                           Glyphs glyphs) {
  const auto& levels = glyphs == Glyphs::unicode ? kUnicodeLevels : kAsciiLevels;
  const std::string_view limit_glyph = glyphs == Glyphs::unicode ? "╌" : "-";
  // The row whose top edge is the limit, counted from the bottom; none with a single row.
  const std::size_t limit_row = rows > 1 ? rows * 3 / 4 : rows;
  const auto shown = newest(history, columns);
  std::vector<Line> lines;
  for (std::size_t row = rows; row-- > 0;) {
    const std::string_view empty = row == limit_row ? limit_glyph : " ";
    Line line;
    for (std::size_t column = shown.size(); column < columns; ++column) line.add(empty, Style::faint);
    for (const Slice& slice : shown) {
      const std::size_t filled = levels_of(slice.age, limit, rows);
      const std::size_t here = std::clamp(filled, row * kLevels, (row + 1) * kLevels) - row * kLevels;
      const bool is_late = slice.missed || slice.age > limit;
      line.add(here == 0 ? empty : levels[here], here == 0 ? Style::faint : is_late ? Style::alarm : Style::plain);
    }
    lines.push_back(std::move(line));
  }
  return lines;
}

std::string_view part_glyph(std::size_t part, Glyphs glyphs) {
  return (glyphs == Glyphs::unicode ? kUnicodeParts : kAsciiParts).at(part);
}

Line stacked_bar(std::span<const double> parts, double whole, std::size_t columns, Glyphs glyphs) {
  Line line;
  double sum = 0;
  std::size_t drawn = 0;
  for (std::size_t part = 0; part < std::min(parts.size(), kMostParts); ++part) {
    sum += std::max(parts[part], 0.0);
    const double end = whole > 0 ? std::round(sum / whole * static_cast<double>(columns)) : 0;
    const std::size_t until = end < static_cast<double>(columns) ? static_cast<std::size_t>(end) : columns;
    for (; drawn < until; ++drawn) line.add(part_glyph(part, glyphs), sum > whole ? Style::alarm : Style::plain);
  }
  line.add(std::string(columns - drawn, ' '));
  return line;
}

}  // namespace takt::monitor::top

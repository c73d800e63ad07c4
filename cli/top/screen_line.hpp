// SPDX-License-Identifier: Apache-2.0
// A line of a terminal's screen as pieces of styled text, measured in cells. Every character that is ever put into one
// takes one cell (names in robot files are ASCII, our own glyphs are narrow). Pure.
#pragma once

#include <cstddef>
#include <cstdint>
#include <string>
#include <string_view>
#include <vector>

namespace takt::monitor::top {

// What a piece means; the terminal gives it a colour, or none.
enum class Style : std::uint8_t { plain, faint, strong, good, warning, alarm };

struct Piece {
  Style style = Style::plain;
  std::string text;  // UTF-8
};

// Cells that UTF-8 text takes.
std::size_t cells(std::string_view text);
// Its first `most` cells.
std::string_view first_cells(std::string_view text, std::size_t most);

class Line {
 public:
  Line& add(std::string_view text, Style style = Style::plain);
  Line& add(const Line& more);
  // Blanks up to this column; at least one when something stands before it already.
  Line& to(std::size_t column);
  // Cuts off what does not fit.
  void clip(std::size_t columns);
  [[nodiscard]] std::size_t width() const;
  [[nodiscard]] const std::vector<Piece>& pieces() const { return pieces_; }
  [[nodiscard]] std::string text() const;  // without styles

 private:
  std::vector<Piece> pieces_;
};

inline constexpr std::size_t kLabel = 9;  // columns of the labels at the left
// A line that begins with its label.
Line labelled(std::string_view label);

}  // namespace takt::monitor::top

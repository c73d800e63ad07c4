// SPDX-License-Identifier: Apache-2.0
#include "cli/top/screen_line.hpp"

#include <algorithm>

namespace takt::monitor::top {
namespace {

// Not the second, third or fourth byte of a character.
bool begins_character(char byte) {
  return (static_cast<unsigned char>(byte) & 0xC0U) != 0x80U;
}

}  // namespace

std::size_t cells(std::string_view text) {
  return static_cast<std::size_t>(std::ranges::count_if(text, begins_character));
}

std::string_view first_cells(std::string_view text, std::size_t most) {
  std::size_t begun = 0;
  const auto end = std::ranges::find_if(text, [&](char byte) { return begins_character(byte) && begun++ == most; });
  return text.substr(0, static_cast<std::size_t>(end - text.begin()));
}

Line& Line::add(std::string_view text, Style style) {
  if (!text.empty()) pieces_.push_back({style, std::string(text)});
  return *this;
}

Line& Line::add(const Line& more) {
  pieces_.insert(pieces_.end(), more.pieces_.begin(), more.pieces_.end());
  return *this;
}

Line& Line::to(std::size_t column) {
  const std::size_t now = width();
  if (now == 0 && column == 0) return *this;
  return add(std::string(column > now ? column - now : 1, ' '));
}

void Line::clip(std::size_t columns) {
  std::size_t used = 0;
  for (Piece& piece : pieces_) {
    piece.text = first_cells(piece.text, columns - used);
    used += cells(piece.text);
  }
  std::erase_if(pieces_, [](const Piece& piece) { return piece.text.empty(); });
}

std::size_t Line::width() const {
  std::size_t sum = 0;
  for (const Piece& piece : pieces_) sum += cells(piece.text);
  return sum;
}

Line labelled(std::string_view label) {
  Line line;
  return line.add(label, Style::faint).to(kLabel);
}

std::string Line::text() const {
  std::string all;
  for (const Piece& piece : pieces_) all += piece.text;
  return all;
}

}  // namespace takt::monitor::top

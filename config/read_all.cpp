// SPDX-License-Identifier: Apache-2.0
#include "config/read_all.hpp"

#include <array>

namespace takt::config {

std::optional<std::string> read_all(std::istream& stream) {
  if (!stream) return std::nullopt;
  std::string text;
  std::array<char, 16384> piece;
  while (stream) {
    stream.read(piece.data(), piece.size());
    text.append(piece.data(), static_cast<std::size_t>(stream.gcount()));
  }
  if (stream.bad()) return std::nullopt;
  return text;
}

}  // namespace takt::config

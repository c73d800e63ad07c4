// SPDX-License-Identifier: Apache-2.0
// `--margin` of what compares the success of two methods: a share, written "2%".
#pragma once

#include <charconv>
#include <optional>
#include <string_view>

namespace takt::cli {

// "2%" as 0.02; between 0 and 100 %.
inline std::optional<double> margin_of(std::string_view text) {
  if (!text.ends_with('%')) return std::nullopt;
  text.remove_suffix(1);
  double percent = 0;
  const auto [end, error] = std::from_chars(text.data(), text.data() + text.size(), percent);
  if (error != std::errc{} || end != text.data() + text.size() || !(percent > 0 && percent < 100)) return std::nullopt;
  return percent / 100;
}

}  // namespace takt::cli

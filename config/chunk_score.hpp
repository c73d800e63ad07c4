// SPDX-License-Identifier: Apache-2.0
// Numbers that a chunk monitor reads off a policy's answers. What each one measures: monitor/judge/chunk_scores.hpp.
#pragma once

#include <array>
#include <cstddef>
#include <cstdint>
#include <string_view>

namespace takt::config {

enum class ChunkScore : std::uint8_t { temporal_error, reversals, jerk, inefficiency, stall, velocity };
inline constexpr std::size_t kChunkScoreCount = 6;
inline constexpr std::array<std::string_view, kChunkScoreCount> kChunkScoreNames{
    "temporal_error", "reversals", "jerk", "inefficiency", "stall", "velocity"};
constexpr std::string_view name(ChunkScore score) {
  return kChunkScoreNames[static_cast<std::size_t>(score)];
}

}  // namespace takt::config

// SPDX-License-Identifier: Apache-2.0
// One image of an outside sensor, in a mailbox of its own: this header, then height x width x channels bytes, row after
// row, the channels of a pixel together. The shape is the robot file's and part of the mailbox's layout.
#pragma once

#include <array>
#include <concepts>
#include <cstdint>
#include <type_traits>

#include "executive/contract/layout.hpp"
#include "executive/contract/mono_time.hpp"

namespace takt {

struct ImageHeader {
  std::uint64_t sequence = 0;  // 1, 2, 3, ...; 0: none
  MonoTime sensed_at;          // shutter
  MonoTime published_at;
  std::uint32_t bytes = 0;  // that follow
  std::uint32_t reserved = 0;
};
template <std::same_as<ImageHeader> Of>
constexpr auto fields_of(Shared<Of>) {
  return std::array{
      TAKT_FIELD(sequence), TAKT_FIELD(sensed_at), TAKT_FIELD(published_at), TAKT_FIELD(bytes), TAKT_FIELD(reserved),
  };
}
static_assert(std::is_standard_layout_v<ImageHeader> && std::is_trivially_copyable_v<ImageHeader>);
static_assert(sizeof(ImageHeader) == 32);

inline constexpr std::uint32_t kMaxImageBytes = 16U << 20U;

// Images of another shape have another layout, even where they have as many bytes.
constexpr std::uint64_t image_layout(std::uint32_t height, std::uint32_t width, std::uint32_t channels) {
  return layout_hash({{sizeof(ImageHeader), height}, {width, channels}});
}

}  // namespace takt

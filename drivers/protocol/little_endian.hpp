// SPDX-License-Identifier: Apache-2.0
// Numbers in a frame's bytes, least significant first, whatever the host's own order. Pure.
// Precondition everywhere: the bytes lie inside the buffer.
#pragma once

#include <bit>
#include <cstddef>
#include <cstdint>

namespace takt::drivers {

constexpr void put_u16(std::uint8_t* at, std::uint16_t value) noexcept {
  at[0] = static_cast<std::uint8_t>(value & 0xFFU);
  at[1] = static_cast<std::uint8_t>(value >> 8U);
}

constexpr void put_u32(std::uint8_t* at, std::uint32_t value) noexcept {
  for (unsigned i = 0; i < 4; ++i) at[i] = static_cast<std::uint8_t>(value >> 8 * i & 0xFFU);
}

constexpr void put_f32(std::uint8_t* at, float value) noexcept {
  put_u32(at, std::bit_cast<std::uint32_t>(value));
}

constexpr std::uint16_t get_u16(const std::uint8_t* at) noexcept {
  return static_cast<std::uint16_t>(at[0] | at[1] << 8U);
}

constexpr std::uint32_t get_u32(const std::uint8_t* at) noexcept {
  std::uint32_t value = 0;
  for (unsigned i = 0; i < 4; ++i) value |= std::uint32_t{at[i]} << 8 * i;
  return value;
}

constexpr float get_f32(const std::uint8_t* at) noexcept {
  return std::bit_cast<float>(get_u32(at));
}

}  // namespace takt::drivers

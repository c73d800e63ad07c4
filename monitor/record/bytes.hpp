// SPDX-License-Identifier: Apache-2.0
// The growable byte buffer of this room.
#pragma once

#include <bit>
#include <cstddef>
#include <span>
#include <type_traits>
#include <vector>

namespace takt::monitor {

static_assert(std::endian::native == std::endian::little, "records are stored little-endian without conversion");

using Bytes = std::vector<std::byte>;

template <class T>
std::span<const std::byte> bytes_of(const T& value) {
  static_assert(std::is_trivially_copyable_v<T>);
  return std::as_bytes(std::span(&value, 1));
}

}  // namespace takt::monitor

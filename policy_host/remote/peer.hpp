// SPDX-License-Identifier: Apache-2.0
// Which process of the DDS domain sent a message. What a message says of its sender is a claim, which every process
// can make; this is what DDS says. Pure.
#pragma once

#include <array>
#include <cstddef>
#include <cstdint>
#include <string>

namespace takt::policy_host::remote {

// The GUID of its DDS participant, which a process has for its life and no other has. All zero: unknown.
struct PeerId {
  std::array<std::uint8_t, 16> guid{};
  [[nodiscard]] constexpr bool is_known() const { return *this != PeerId{}; }
  friend constexpr bool operator==(const PeerId&, const PeerId&) = default;
};

// 32 hexadecimal digits.
inline std::string text_of(const PeerId& peer) {
  constexpr char kDigits[] = "0123456789abcdef";
  std::string text;
  for (const std::uint8_t byte : peer.guid) {
    text += kDigits[byte >> 4U];
    text += kDigits[byte & 15U];
  }
  return text;
}

}  // namespace takt::policy_host::remote

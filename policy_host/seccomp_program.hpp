// SPDX-License-Identifier: Apache-2.0
// What seccomp(2) filters are written of: statements of BPF, and the architecture whose calls they know by number.
#pragma once

#include <linux/audit.h>
#include <linux/filter.h>

#include <cstdint>

namespace takt::policy_host {

#if defined(__x86_64__)
inline constexpr std::uint32_t kArchitecture = AUDIT_ARCH_X86_64;
#elif defined(__aarch64__)
inline constexpr std::uint32_t kArchitecture = AUDIT_ARCH_AARCH64;
#endif
inline constexpr std::uint32_t kX32Bit = 0x40000000;  // the same calls by other numbers, x86-64

constexpr sock_filter statement(std::uint32_t code, std::uint32_t value) {
  return {static_cast<std::uint16_t>(code), 0, 0, value};
}
// Over so many of the statements that follow.
constexpr sock_filter jump(std::uint32_t code, std::uint32_t value, std::uint8_t if_true, std::uint8_t if_false) {
  return {static_cast<std::uint16_t>(code), if_true, if_false, value};
}

}  // namespace takt::policy_host

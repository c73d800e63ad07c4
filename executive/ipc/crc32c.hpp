// SPDX-License-Identifier: Apache-2.0
// CRC-32C (Castagnoli, RFC 3720 section 12.1): detects payloads that were changed while they were copied.
// It is no authentication: a process that can write the segment can also write a matching checksum.
//
// Uses the processor's own instruction where it has one (chosen at the first call), a table elsewhere; both give equal
// results. Thread rule: any thread; no allocation, lock or system call.
#pragma once

#include <cstddef>
#include <cstdint>
#include <span>

namespace takt::ipc {

// Checksum of `previous`'s data followed by `data`; crc32c("123456789") == 0xE3069283.
std::uint32_t crc32c(std::span<const std::byte> data, std::uint32_t previous = 0) noexcept;

// The implementation for processors without the instruction, callable everywhere so that a test can compare the two.
std::uint32_t crc32c_by_table(std::span<const std::byte> data, std::uint32_t previous) noexcept;

}  // namespace takt::ipc

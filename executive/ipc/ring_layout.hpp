// SPDX-License-Identifier: Apache-2.0
// What a ring looks like in shared memory: the words that SlotWriter writes and SlotReader reads, and nothing else.
//
//   byte 0    RingHeader: identity, fixed once formatted; `head`, on a line of its own, names the newest complete slot
//   byte 128  slot_count slots, each: version | size and CRC | payload words, padded to a 64-byte line
//
// Sequences count payloads from 1. Sequence s lives in slot (s - 1) mod slot_count; its version is 2s - 1 while it is
// being written and 2s once it is complete. Every shared word is an atomic: a peer may change any of them at any time.
#pragma once

#include <atomic>
#include <cstddef>
#include <cstdint>
#include <span>
#include <type_traits>

#include "executive/ipc/crc32c.hpp"
#include "executive/ipc/slot_ring.hpp"

namespace takt::ipc {

using Word = std::atomic<std::uint64_t>;
static_assert(Word::is_always_lock_free && sizeof(Word) == 8 && std::is_standard_layout_v<Word>);

inline constexpr std::size_t kLineBytes = 64;

struct RingHeader {
  Word magic;
  Word abi_version;
  Word slot_count;
  Word payload_capacity;
  Word layout;
  Word reserved[3];
  Word head;
  Word padding[7];
};
static_assert(sizeof(RingHeader) == 2 * kLineBytes && offsetof(RingHeader, head) == kLineBytes);

struct SlotHeader {
  Word version;
  Word size_and_crc;  // size in the low half
};
static_assert(sizeof(SlotHeader) == 16);

constexpr bool is_valid(const RingShape& shape) {
  return shape.slot_count >= 2 && shape.slot_count <= 65536 && (shape.slot_count & (shape.slot_count - 1)) == 0 &&
         shape.payload_capacity >= 1 && shape.payload_capacity <= kLargestPayload;
}

constexpr std::size_t slot_stride(const RingShape& shape) {
  return (sizeof(SlotHeader) + shape.payload_capacity + kLineBytes - 1) / kLineBytes * kLineBytes;
}

constexpr std::size_t slot_offset(const RingShape& shape, std::uint64_t sequence) {
  return sizeof(RingHeader) + ((sequence - 1) & (shape.slot_count - 1)) * slot_stride(shape);
}

constexpr std::uint64_t version_while_writing(std::uint64_t sequence) {
  return 2 * sequence - 1;
}
constexpr std::uint64_t version_when_complete(std::uint64_t sequence) {
  return 2 * sequence;
}

constexpr std::uint64_t pack_size_and_crc(std::uint32_t size, std::uint32_t crc) {
  return (std::uint64_t{crc} << 32U) | size;
}

// Checksum of a payload given in two pieces: its size first, so that a wrong size is noticed too.
inline std::uint32_t payload_crc(std::uint32_t size, std::span<const std::byte> head,
                                 std::span<const std::byte> tail) noexcept {
  const std::uint32_t of_size = crc32c(std::as_bytes(std::span(&size, 1)));
  const std::uint32_t of_head = crc32c(head, of_size);
  return tail.empty() ? of_head : crc32c(tail, of_head);
}

inline bool is_line_aligned(const std::byte* memory) {
  return reinterpret_cast<std::uintptr_t>(memory) % kLineBytes == 0;
}

// The shared words at an address. They live in memory that another process may have formatted, so no constructor of
// ours ran there; lock-free atomics of 8 bytes have the same representation as the integer.
template <class Shared>
Shared& shared_at(std::byte* address) {
  return *reinterpret_cast<Shared*>(address);
}
template <class Shared>
const Shared& shared_at(const std::byte* address) {
  return *reinterpret_cast<const Shared*>(address);
}

}  // namespace takt::ipc

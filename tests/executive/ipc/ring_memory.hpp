// SPDX-License-Identifier: Apache-2.0
// Memory for a ring, private or shared with forked children, and payloads that show tearing: every word depends on
// the sequence, so that no mixture of two payloads passes for one.
#pragma once

#include <sys/mman.h>

#include <cstddef>
#include <cstdint>
#include <cstring>
#include <new>
#include <optional>
#include <span>
#include <vector>

#include "executive/ipc/slot_ring.hpp"

namespace takt::ipc {

// Anonymous pages, shared with children of fork(). The last byte is followed by a page that faults when touched.
class RingMemory {
 public:
  explicit RingMemory(const RingShape& shape) : size_(ring_bytes(shape)) {
    constexpr std::size_t kPage = 4096;
    mapped_ = (size_ + kPage - 1) / kPage * kPage + kPage;
    void* const at = mmap(nullptr, mapped_, PROT_READ | PROT_WRITE, MAP_SHARED | MAP_ANONYMOUS, -1, 0);
    if (at == MAP_FAILED) throw std::bad_alloc();
    pages_ = static_cast<std::byte*>(at);
    mprotect(pages_ + mapped_ - kPage, kPage, PROT_NONE);
    data_ = pages_ + mapped_ - kPage - size_;
  }
  RingMemory(const RingMemory&) = delete;
  RingMemory& operator=(const RingMemory&) = delete;
  ~RingMemory() { munmap(pages_, mapped_); }
  [[nodiscard]] std::span<std::byte> bytes() const { return {data_, size_}; }

 private:
  std::size_t size_;
  std::size_t mapped_ = 0;
  std::byte* pages_ = nullptr;
  std::byte* data_ = nullptr;
};

// Word i of payload `sequence`; word 0 is the sequence itself.
inline std::uint64_t payload_word(std::uint64_t sequence, std::size_t index) {
  return index == 0 ? sequence : (sequence * 0x9E37'79B9'7F4A'7C15ULL) ^ (index * 0xD6E8'FEB8'6659'FD93ULL);
}

inline std::vector<std::byte> make_payload(std::uint64_t sequence, std::size_t bytes) {
  std::vector<std::byte> payload(bytes);
  for (std::size_t at = 0; at < bytes; at += 8) {
    const std::uint64_t word = payload_word(sequence, at / 8);
    std::memcpy(payload.data() + at, &word, bytes - at < 8 ? bytes - at : 8);
  }
  return payload;
}

// The sequence that a payload of at least 8 bytes belongs to, or nothing when it is torn.
inline std::optional<std::uint64_t> sequence_of(std::span<const std::byte> payload) {
  std::uint64_t sequence = 0;
  std::memcpy(&sequence, payload.data(), 8);
  for (std::size_t at = 8; at < payload.size(); at += 8) {
    const std::uint64_t word = payload_word(sequence, at / 8);
    if (std::memcmp(payload.data() + at, &word, payload.size() - at < 8 ? payload.size() - at : 8) != 0) return {};
  }
  return sequence;
}

}  // namespace takt::ipc

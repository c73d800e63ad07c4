// SPDX-License-Identifier: Apache-2.0
// Single-writer ring of versioned slots in shared memory: the one mechanism behind the latest-value mailbox
// (8 slots, read_latest) and the record rings (many slots, read_next). Readers map it read-only.
//
// The writer never waits and never learns about readers. A reader copies words out, then checks that the version did
// not move; it gives up after kMaxTries and says so. A reader that falls a whole ring behind is told how many it lost.
// The payload carries a CRC-32C: a hostile writer can keep a version valid while it mutates the payload.
// Memory layout, the bad interleavings and the paired synchronisation points are drawn in slot_ring.md.
//
// Thread rules: one writer thread; any number of readers, each with its own SlotReader. Writer and reader are
// allocation-, lock- and syscall-free after construction. Payload sizes are bytes, at most payload_capacity.
#pragma once

#include <cstddef>
#include <cstdint>
#include <expected>
#include <span>
#include <string>

namespace takt::ipc {

inline constexpr std::size_t kMailboxSlots = 8;
inline constexpr int kMaxTries = 4;
inline constexpr std::uint32_t kLargestPayload = (16U << 20U) + 4096;  // bytes: the largest image, and its header

struct RingShape {
  std::uint32_t slot_count = 0;        // power of two, 2..65536
  std::uint32_t payload_capacity = 0;  // bytes per slot, 1..kLargestPayload
  std::uint64_t layout = 0;            // layout hash of the payload structure
  friend bool operator==(const RingShape&, const RingShape&) = default;
};

// Bytes of zeroed, 64-byte aligned memory a ring of this shape needs.
std::size_t ring_bytes(const RingShape& shape);

class SlotWriter {
 public:
  // Formats zeroed memory of at least ring_bytes(shape). Aborts on a shape outside its ranges (our own bug).
  SlotWriter(std::span<std::byte> memory, const RingShape& shape);
  // Precondition: payload.size() <= payload_capacity (aborts otherwise: our own bug).
  void publish(std::span<const std::byte> payload) noexcept;
  // Same, payload given in two pieces that are stored one after the other; head.size() must be a multiple of 8.
  void publish(std::span<const std::byte> head, std::span<const std::byte> tail) noexcept;
  // Large payloads, without a copy: the slot of the next one, to be filled in place, payload_capacity bytes. It is
  // marked as being written until commit(); calling begin() again gives the same slot. What is in it is what was
  // published there slot_count payloads ago.
  std::span<std::byte> begin() noexcept;
  // Publishes the first `bytes` of what begin() gave. Who writes to it afterwards makes the payload corrupt.
  // Precondition: begin() was called, bytes <= payload_capacity (aborts otherwise: our own bug).
  void commit(std::size_t bytes) noexcept;
  [[nodiscard]] std::uint64_t published() const noexcept { return published_; }

 private:
  std::byte* memory_;
  RingShape shape_;
  std::uint64_t published_ = 0;
  bool begun_ = false;
};

// contended: the writer was faster on every try; ask again later.
// corrupt: the segment says something no honest writer says (checksum, size, version or head running backwards); the
// payload, if it was one, is skipped.
// cut: the payload is larger than `out`, as the size says. Its beginning is there, unchecked; the rest was not read.
enum class ReadStatus : std::uint8_t { fresh, nothing_new, contended, corrupt, cut };

struct ReadResult {
  ReadStatus status = ReadStatus::nothing_new;
  std::uint64_t sequence = 0;  // of the payload returned or refused; 1, 2, 3, ...; 0 none
  std::uint64_t lost = 0;      // read_next: payloads overwritten before this one could be read
  std::uint32_t size = 0;      // bytes of the payload: all of them returned, unless it was cut
  int tries = 0;
};

class SlotReader {
 public:
  // Checks magic, ABI version, shape, layout and size against what is expected; the error is one sentence.
  static std::expected<SlotReader, std::string> attach(std::span<const std::byte> memory, const RingShape& expected);

  // Newest payload, if newer than the last one returned. At most kMaxTries copies, each of at most out.size() bytes.
  ReadResult read_latest(std::span<std::byte> out) noexcept;
  // Oldest payload not yet returned. Skips what was overwritten and says how many.
  ReadResult read_next(std::span<std::byte> out) noexcept;
  // Next read_next starts after everything published so far.
  void skip_to_newest() noexcept;
  // Cheap: has anything been published since the last read?
  [[nodiscard]] bool has_news() const noexcept;

 private:
  SlotReader(const std::byte* memory, const RingShape& shape) : memory_(memory), shape_(shape) {}
  [[nodiscard]] std::uint64_t head() const noexcept;
  ReadResult copy_slot(std::uint64_t sequence, std::span<std::byte> out) const noexcept;
  const std::byte* memory_;
  RingShape shape_;
  std::uint64_t last_ = 0;
};

}  // namespace takt::ipc

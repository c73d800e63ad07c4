// SPDX-License-Identifier: Apache-2.0
#include <cstdio>
#include <cstdlib>
#include <cstring>

#include "executive/contract/layout.hpp"
#include "executive/ipc/ring_layout.hpp"
#include "executive/ipc/slot_ring.hpp"

namespace takt::ipc {
namespace {

[[noreturn]] void abort_on_our_bug(const char* what) {
  std::fprintf(stderr, "takt: internal error: slot ring: %s\n", what);
  std::abort();
}

// Release on every word: a reader that sees one of them also sees the odd version that was stored before.
Word* store_words(Word* to, std::span<const std::byte> bytes) noexcept {
  const std::byte* from = bytes.data();
  for (std::size_t left = bytes.size() / 8; left != 0; --left, from += 8, ++to) {
    std::uint64_t word = 0;
    std::memcpy(&word, from, 8);
    to->store(word, std::memory_order_release);
  }
  if (const std::size_t rest = bytes.size() % 8; rest != 0) {
    std::uint64_t word = 0;
    std::memcpy(&word, from, rest);
    to->store(word, std::memory_order_release);
    ++to;
  }
  return to;
}

// A slot is cold when its turn comes: ask for all its lines at once, or the stores would wait for one after the other.
void prefetch_for_writing(const std::byte* at, std::size_t bytes) noexcept {
  for (std::size_t line = 0; line < bytes; line += kLineBytes) {
#if defined(__x86_64__)
    asm volatile("prefetchw %0" : : "m"(at[line]));  // no operation on processors without it
#else
    __builtin_prefetch(at + line, 1);
#endif
  }
}

}  // namespace

std::size_t ring_bytes(const RingShape& shape) {
  return sizeof(RingHeader) + shape.slot_count * slot_stride(shape);
}

SlotWriter::SlotWriter(std::span<std::byte> memory, const RingShape& shape) : memory_(memory.data()), shape_(shape) {
  if (!is_valid(shape)) abort_on_our_bug("shape outside its ranges");
  if (memory.size() < ring_bytes(shape)) abort_on_our_bug("memory too small for its shape");
  if (!is_line_aligned(memory_)) abort_on_our_bug("memory not aligned to a cache line");
  auto& header = shared_at<RingHeader>(memory_);
  header.abi_version.store(kAbiVersion, std::memory_order_relaxed);
  header.slot_count.store(shape.slot_count, std::memory_order_relaxed);
  header.payload_capacity.store(shape.payload_capacity, std::memory_order_relaxed);
  header.layout.store(shape.layout, std::memory_order_relaxed);
  header.magic.store(kMagic, std::memory_order_release);
}

void SlotWriter::publish(std::span<const std::byte> payload) noexcept {
  publish(payload, {});
}

void SlotWriter::publish(std::span<const std::byte> head, std::span<const std::byte> tail) noexcept {
  const std::size_t total = head.size() + tail.size();
  if (total > shape_.payload_capacity) abort_on_our_bug("payload larger than the slot");
  if (!tail.empty() && head.size() % 8 != 0) abort_on_our_bug("first piece is not whole words");
  const auto size = static_cast<std::uint32_t>(total);
  const std::uint64_t sequence = published_ + 1;
  std::byte* const at = memory_ + slot_offset(shape_, sequence);
  prefetch_for_writing(at, sizeof(SlotHeader) + total);  // arrives while the checksum is computed
  const std::uint64_t size_and_crc = pack_size_and_crc(size, payload_crc(size, head, tail));

  auto& slot = shared_at<SlotHeader>(at);
  slot.version.store(version_while_writing(sequence), std::memory_order_relaxed);
  slot.size_and_crc.store(size_and_crc, std::memory_order_release);
  Word* words = store_words(&shared_at<Word>(at + sizeof(SlotHeader)), head);
  store_words(words, tail);
  slot.version.store(version_when_complete(sequence), std::memory_order_release);
  shared_at<RingHeader>(memory_).head.store(sequence, std::memory_order_release);
  published_ = sequence;
}

// The caller's stores are plain: the exchange keeps them behind the odd version, as the release stores of publish() do.
// (A fence would do, but the thread sanitizer knows none.) A reader that is overtaken all the same has the checksum.
std::span<std::byte> SlotWriter::begin() noexcept {
  const std::uint64_t sequence = published_ + 1;
  std::byte* const at = memory_ + slot_offset(shape_, sequence);
  (void)shared_at<SlotHeader>(at).version.exchange(version_while_writing(sequence), std::memory_order_acq_rel);
  begun_ = true;
  return {at + sizeof(SlotHeader), shape_.payload_capacity};
}

void SlotWriter::commit(std::size_t bytes) noexcept {
  if (!begun_) abort_on_our_bug("commit without begin");
  if (bytes > shape_.payload_capacity) abort_on_our_bug("payload larger than the slot");
  begun_ = false;
  const std::uint64_t sequence = published_ + 1;
  std::byte* const at = memory_ + slot_offset(shape_, sequence);
  auto& slot = shared_at<SlotHeader>(at);
  const auto size = static_cast<std::uint32_t>(bytes);
  const std::uint32_t crc = payload_crc(size, {at + sizeof(SlotHeader), bytes}, {});
  slot.size_and_crc.store(pack_size_and_crc(size, crc), std::memory_order_release);
  slot.version.store(version_when_complete(sequence), std::memory_order_release);
  shared_at<RingHeader>(memory_).head.store(sequence, std::memory_order_release);
  published_ = sequence;
}

}  // namespace takt::ipc

// SPDX-License-Identifier: Apache-2.0
#include <algorithm>
#include <array>
#include <cstring>

#include "executive/contract/layout.hpp"
#include "executive/ipc/ring_layout.hpp"
#include "executive/ipc/slot_ring.hpp"

namespace takt::ipc {
namespace {

// Acquire on every word: the version is looked at again only after all of them.
void load_words(const Word* from, std::byte* to, std::size_t bytes) noexcept {
  for (std::size_t left = bytes / 8; left != 0; --left, ++from, to += 8) {
    const std::uint64_t word = from->load(std::memory_order_acquire);
    std::memcpy(to, &word, 8);
  }
  if (const std::size_t rest = bytes % 8; rest != 0) {
    const std::uint64_t word = from->load(std::memory_order_acquire);
    std::memcpy(to, &word, rest);
  }
}

}  // namespace

std::expected<SlotReader, std::string> SlotReader::attach(std::span<const std::byte> memory,
                                                          const RingShape& expected) {
  if (!is_valid(expected)) return std::unexpected("ring: the expected shape is outside its ranges: fix the caller");
  if (memory.size() < ring_bytes(expected)) {
    return std::unexpected("ring: segment has " + std::to_string(memory.size()) + " bytes, its shape needs " +
                           std::to_string(ring_bytes(expected)) + ": both sides must run the same version of Takt");
  }
  if (!is_line_aligned(memory.data()))
    return std::unexpected("ring: memory is not aligned to 64 bytes: map whole pages");

  struct Identity {
    const char* what;
    const Word& found;
    std::uint64_t wanted;
  };
  const auto& header = shared_at<RingHeader>(memory.data());
  const std::array identities{
      Identity{"magic number", header.magic, kMagic},
      Identity{"ABI version", header.abi_version, kAbiVersion},
      Identity{"slot count", header.slot_count, expected.slot_count},
      Identity{"payload capacity", header.payload_capacity, expected.payload_capacity},
      Identity{"payload layout", header.layout, expected.layout},
  };
  for (const Identity& identity : identities) {
    const std::uint64_t found = identity.found.load(std::memory_order_acquire);
    if (found == identity.wanted) continue;
    return std::unexpected("ring: " + std::string(identity.what) + " is " + std::to_string(found) + ", expected " +
                           std::to_string(identity.wanted) + ": both sides must run the same version of Takt");
  }
  return SlotReader(memory.data(), expected);
}

std::uint64_t SlotReader::head() const noexcept {
  return shared_at<RingHeader>(memory_).head.load(std::memory_order_acquire);
}

// One attempt. Everything is bounded by shape_, which is ours; nothing read from the segment is used as a bound before
// it was compared with it.
ReadResult SlotReader::copy_slot(std::uint64_t sequence, std::span<std::byte> out) const noexcept {
  const std::byte* const at = memory_ + slot_offset(shape_, sequence);
  const auto& slot = shared_at<SlotHeader>(at);
  ReadResult result{.sequence = sequence};

  const std::uint64_t version = slot.version.load(std::memory_order_acquire);
  if (version != version_when_complete(sequence)) {
    // Head named this sequence complete before, so an honest slot can only have moved on.
    result.status = version < version_when_complete(sequence) ? ReadStatus::corrupt : ReadStatus::contended;
    return result;
  }
  const std::uint64_t size_and_crc = slot.size_and_crc.load(std::memory_order_acquire);
  const auto size = static_cast<std::uint32_t>(size_and_crc);
  const bool fits = size <= shape_.payload_capacity;
  const bool is_cut = fits && size > out.size();
  if (fits) load_words(&shared_at<Word>(at + sizeof(SlotHeader)), out.data(), is_cut ? out.size() : size);

  if (slot.version.load(std::memory_order_relaxed) != version) {
    result.status = ReadStatus::contended;
  } else if (is_cut) {
    result.status = ReadStatus::cut;
    result.size = size;
  } else if (!fits || payload_crc(size, out.first(size), {}) != size_and_crc >> 32U) {
    result.status = ReadStatus::corrupt;
  } else {
    result.status = ReadStatus::fresh;
    result.size = size;
  }
  return result;
}

ReadResult SlotReader::read_latest(std::span<std::byte> out) noexcept {
  ReadResult result;
  for (int tries = 1; tries <= kMaxTries; ++tries) {
    const std::uint64_t newest = head();
    if (newest == last_) return {.tries = tries};
    if (newest < last_) return {.status = ReadStatus::corrupt, .tries = tries};  // no honest head runs backwards
    result = copy_slot(newest, out);
    result.tries = tries;
    if (result.status == ReadStatus::contended) continue;
    last_ = newest;  // also when corrupt: one bad payload is reported once
    return result;
  }
  return result;
}

ReadResult SlotReader::read_next(std::span<std::byte> out) noexcept {
  ReadResult result;
  for (int tries = 1; tries <= kMaxTries; ++tries) {
    const std::uint64_t newest = head();
    if (newest == last_) return {.tries = tries};
    if (newest < last_) return {.status = ReadStatus::corrupt, .tries = tries};
    // The writer overwrites the oldest slot next. Each new try gives up a quarter of the ring, to get out of its way.
    const std::uint64_t given_up = static_cast<std::uint64_t>(tries - 1) * shape_.slot_count / kMaxTries;
    const std::uint64_t reachable = shape_.slot_count - given_up;
    const std::uint64_t behind = newest - last_;
    const std::uint64_t lost = behind > reachable ? behind - reachable : 0;
    result = copy_slot(last_ + 1 + lost, out);
    result.tries = tries;
    if (result.status == ReadStatus::contended) continue;
    result.lost = lost;
    last_ = result.sequence;
    return result;
  }
  return result;
}

void SlotReader::skip_to_newest() noexcept {
  last_ = head();
}

bool SlotReader::has_news() const noexcept {
  return head() != last_;
}

}  // namespace takt::ipc

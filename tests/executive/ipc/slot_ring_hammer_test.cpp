// SPDX-License-Identifier: Apache-2.0
// Goal: a reader beside a writer that never pauses gets whole payloads in order, within the bounded tries, and the race
// detector finds nothing. Method: two threads, a fixed number of publications, payloads that show tearing.
#include <gtest/gtest.h>

#include <atomic>
#include <thread>

#include "executive/ipc/slot_ring.hpp"
#include "tests/executive/ipc/ring_memory.hpp"

namespace takt::ipc {
namespace {

constexpr std::uint64_t kPublications = 200'000;

struct Tally {
  std::uint64_t fresh = 0;
  std::uint64_t lost = 0;
  std::uint64_t last = 0;
};

// Runs a hammering writer, and `read` in this thread until the last publication was returned.
template <class Read>
Tally hammer(const RingShape& shape, Read read) {
  const RingMemory memory(shape);
  SlotWriter writer(memory.bytes(), shape);
  auto reader = SlotReader::attach(memory.bytes(), shape);
  std::atomic<bool> may_stop = false;
  std::jthread writing([&] {
    for (std::uint64_t sequence = 1; sequence <= kPublications; ++sequence) {
      const std::size_t bytes = 8 + (sequence * 13) % (shape.payload_capacity - 7);
      writer.publish(make_payload(sequence, bytes));
    }
    may_stop.store(true);
  });

  Tally tally;
  std::vector<std::byte> out(shape.payload_capacity);
  while (tally.last < kPublications) {
    const bool writer_is_done = may_stop.load();
    const ReadResult result = read(*reader, std::span(out));
    EXPECT_LE(result.tries, kMaxTries);
    EXPECT_NE(result.status, ReadStatus::corrupt) << "sequence " << result.sequence;
    if (result.status == ReadStatus::fresh) {
      EXPECT_GT(result.sequence, tally.last);
      EXPECT_EQ(sequence_of(std::span(out).first(result.size)), std::optional(result.sequence));
      ++tally.fresh;
      tally.lost += result.lost;
      tally.last = result.sequence;
    } else if (writer_is_done) {
      ADD_FAILURE() << "the writer is done, yet the newest payload cannot be read";
      break;
    }
    if (testing::Test::HasFailure()) break;
  }
  return tally;
}

TEST(SlotRingHammer, LatestIsWholeAndMovesForward) {
  const Tally tally =
      hammer({8, 512, 1}, [](SlotReader& reader, std::span<std::byte> out) { return reader.read_latest(out); });
  EXPECT_EQ(tally.last, kPublications);
}

TEST(SlotRingHammer, NextAccountsForEveryPublication) {
  for (const std::uint32_t slots : {2U, 8U, 1024U}) {
    const Tally tally =
        hammer({slots, 96, 1}, [](SlotReader& reader, std::span<std::byte> out) { return reader.read_next(out); });
    EXPECT_EQ(tally.fresh + tally.lost, kPublications) << slots << " slots";
  }
}

}  // namespace
}  // namespace takt::ipc

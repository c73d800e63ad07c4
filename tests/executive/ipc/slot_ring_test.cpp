// SPDX-License-Identifier: Apache-2.0
// Goal: one writer's payloads arrive whole, in order, with exact loss counts, and nothing in the segment can lead a
// reader out of bounds. Method: unit cases on private memory, a model (plain list of payloads) driven by RapidCheck,
// and segments composed of hostile words.
#include "executive/ipc/slot_ring.hpp"

#include <gtest/gtest.h>
#include <rapidcheck.h>

#include <algorithm>
#include <array>
#include <limits>
#include <random>
#include <stdexcept>

#include "executive/contract/layout.hpp"
#include "executive/ipc/ring_layout.hpp"
#include "tests/executive/ipc/ring_memory.hpp"

namespace takt::ipc {
namespace {

constexpr RingShape kShape{8, 200, 0x1234};

SlotReader reader_of(const RingMemory& memory, const RingShape& shape) {
  auto reader = SlotReader::attach(memory.bytes(), shape);
  if (!reader) throw std::runtime_error(reader.error());
  return *reader;
}

struct Ring {
  explicit Ring(const RingShape& with = kShape)
      : shape(with),
        memory(shape),
        writer(memory.bytes(), shape),
        reader(reader_of(memory, shape)),
        out(shape.payload_capacity) {}
  void publish(std::size_t bytes) { writer.publish(make_payload(writer.published() + 1, bytes)); }
  void publish_many(std::size_t count) {
    for (std::size_t i = 0; i < count; ++i) publish(shape.payload_capacity);
  }
  RingHeader& header() { return shared_at<RingHeader>(memory.bytes().data()); }
  SlotHeader& slot(std::uint64_t sequence) {
    return shared_at<SlotHeader>(memory.bytes().data() + slot_offset(shape, sequence));
  }
  std::byte* payload(std::uint64_t sequence) {
    return memory.bytes().data() + slot_offset(shape, sequence) + sizeof(SlotHeader);
  }
  RingShape shape;
  RingMemory memory;
  SlotWriter writer;
  SlotReader reader;
  std::vector<std::byte> out;
};

TEST(SlotRing, NothingPublishedIsNothingNew) {
  Ring ring;
  EXPECT_FALSE(ring.reader.has_news());
  EXPECT_EQ(ring.reader.read_latest(ring.out).status, ReadStatus::nothing_new);
  EXPECT_EQ(ring.reader.read_next(ring.out).status, ReadStatus::nothing_new);
}

TEST(SlotRing, LatestSkipsToTheNewestAndReturnsItOnce) {
  Ring ring;
  ring.publish_many(5);
  EXPECT_TRUE(ring.reader.has_news());
  const ReadResult result = ring.reader.read_latest(ring.out);
  EXPECT_EQ(result.status, ReadStatus::fresh);
  EXPECT_EQ(result.sequence, 5U);
  EXPECT_EQ(result.tries, 1);
  EXPECT_EQ(ring.out, make_payload(5, kShape.payload_capacity));
  EXPECT_FALSE(ring.reader.has_news());
  EXPECT_EQ(ring.reader.read_latest(ring.out).status, ReadStatus::nothing_new);
}

TEST(SlotRing, OnlyUsedBytesAreCopied) {
  Ring ring;
  for (std::size_t bytes = 0; bytes <= kShape.payload_capacity; ++bytes) {
    std::ranges::fill(ring.out, std::byte{0xEE});
    ring.publish(bytes);
    const ReadResult result = ring.reader.read_latest(ring.out);
    ASSERT_EQ(result.status, ReadStatus::fresh);
    ASSERT_EQ(result.size, bytes);
    const auto untouched = std::span(ring.out).subspan(bytes);
    ASSERT_TRUE(std::ranges::all_of(untouched, [](std::byte b) { return b == std::byte{0xEE}; })) << bytes;
    ASSERT_TRUE(std::ranges::equal(std::span(ring.out).first(bytes), make_payload(ring.writer.published(), bytes)));
  }
}

TEST(SlotRing, TwoPiecesAreOnePayload) {
  Ring ring;
  const std::vector<std::byte> whole = make_payload(1, 61);
  ring.writer.publish(std::span(whole).first(24), std::span(whole).subspan(24));
  EXPECT_EQ(ring.reader.read_next(ring.out).size, 61U);
  EXPECT_TRUE(std::ranges::equal(std::span(ring.out).first(61), whole));
}

TEST(SlotRing, NextReturnsEveryPayloadInOrder) {
  Ring ring;
  std::uint64_t expected = 0;
  for (int round = 0; round < 20; ++round) {
    ring.publish_many(kShape.slot_count);
    for (std::size_t i = 0; i < kShape.slot_count; ++i) {
      const ReadResult result = ring.reader.read_next(ring.out);
      ASSERT_EQ(result.status, ReadStatus::fresh);
      ASSERT_EQ(result.sequence, ++expected);
      ASSERT_EQ(result.lost, 0U);
    }
    ASSERT_EQ(ring.reader.read_next(ring.out).status, ReadStatus::nothing_new);
  }
}

TEST(SlotRing, NextCountsWhatWasOverwritten) {
  Ring ring;
  ring.publish_many(30);
  const ReadResult result = ring.reader.read_next(ring.out);
  EXPECT_EQ(result.status, ReadStatus::fresh);
  EXPECT_EQ(result.lost, 22U);
  EXPECT_EQ(result.sequence, 23U);
}

TEST(SlotRing, SkipForgetsTheBacklog) {
  Ring ring;
  ring.publish_many(6);
  ring.reader.skip_to_newest();
  EXPECT_EQ(ring.reader.read_next(ring.out).status, ReadStatus::nothing_new);
  ring.publish(64);
  EXPECT_EQ(ring.reader.read_next(ring.out).sequence, 7U);
}

// Every history of publishing and reading, for several ring sizes: sequences increase, payloads are whole, and
// returned + lost + waiting always equals published.
TEST(SlotRing, AgreesWithAModel) {
  EXPECT_TRUE(rc::check("loss counts are exact", [] {
    const RingShape shape{1U << *rc::gen::inRange<std::uint32_t>(1, 6), *rc::gen::inRange<std::uint32_t>(8, 300), 7};
    Ring ring(shape);
    std::uint64_t accounted = 0;
    const auto steps =
        *rc::gen::container<std::vector<int>>(rc::gen::inRange(0, 3 * static_cast<int>(shape.slot_count)));
    for (const int step : steps) {
      for (int i = 0; i < step; ++i) {
        ring.publish(*rc::gen::inRange<std::size_t>(8, shape.payload_capacity + 1));
      }
      const ReadResult result = ring.reader.read_next(ring.out);
      if (accounted == ring.writer.published()) {
        RC_ASSERT(result.status == ReadStatus::nothing_new);
        continue;
      }
      RC_ASSERT(result.status == ReadStatus::fresh);
      RC_ASSERT(result.tries == 1);
      accounted += result.lost + 1;
      RC_ASSERT(result.sequence == accounted);
      RC_ASSERT(sequence_of(std::span(ring.out).first(result.size)) == std::optional(accounted));
      RC_ASSERT(ring.writer.published() - accounted < shape.slot_count);
    }
  }));
}

TEST(SlotRing, AttachRefusesEveryMismatchInOneSentence) {
  Ring ring;
  const auto refused = [&](const RingShape& shape, const char* word) {
    const auto reader = SlotReader::attach(ring.memory.bytes(), shape);
    return !reader && reader.error().find(word) != std::string::npos && reader.error().find('\n') == std::string::npos;
  };
  EXPECT_TRUE(refused({4, 200, 0x1234}, "slot count"));
  EXPECT_TRUE(refused({8, 199, 0x1234}, "payload capacity"));
  EXPECT_TRUE(refused({8, 200, 0x1235}, "layout"));
  EXPECT_TRUE(refused({16, 200, 0x1234}, "bytes"));
  EXPECT_TRUE(refused({7, 200, 0x1234}, "ranges"));
  EXPECT_TRUE(refused({8, 0, 0x1234}, "ranges"));
  ring.header().abi_version.store(kAbiVersion + 1);
  EXPECT_TRUE(refused(kShape, "ABI"));
  ring.header().magic.store(0);
  EXPECT_TRUE(refused(kShape, "magic"));
  EXPECT_FALSE(SlotReader::attach(ring.memory.bytes().subspan(8), {2, 8, 0}).has_value());
}

TEST(SlotRingDeath, MisuseByOurselvesAborts) {
  EXPECT_DEATH(Ring({6, 64, 0}), "shape");
  Ring ring;
  EXPECT_DEATH(ring.publish(kShape.payload_capacity + 1), "larger than the slot");
  EXPECT_DEATH(ring.writer.publish(make_payload(1, 12), make_payload(1, 8)), "whole words");
}

TEST(HostileSegment, ChangedPayloadIsCorruptAndReportedOnce) {
  Ring ring;
  ring.publish_many(3);
  ring.payload(3)[17] ^= std::byte{1};
  EXPECT_EQ(ring.reader.read_latest(ring.out).status, ReadStatus::corrupt);
  EXPECT_EQ(ring.reader.read_latest(ring.out).status, ReadStatus::nothing_new);
  ring.publish(64);
  EXPECT_EQ(ring.reader.read_latest(ring.out).status, ReadStatus::fresh);
}

TEST(HostileSegment, EveryChangedBitOfSizeOrChecksumIsCorrupt) {
  for (unsigned bit = 0; bit < 64; ++bit) {
    Ring ring;
    ring.publish(64);
    ring.slot(1).size_and_crc.fetch_xor(std::uint64_t{1} << bit);
    EXPECT_EQ(ring.reader.read_latest(ring.out).status, ReadStatus::corrupt) << "bit " << bit;
  }
}

TEST(InPlace, WhatIsBegunIsSeenOnceItIsCommittedAndNotBefore) {
  Ring ring;
  ring.publish(64);
  const std::span<std::byte> slot = ring.writer.begin();
  ASSERT_EQ(slot.size(), ring.shape.payload_capacity);
  std::ranges::fill(slot, std::byte{0x5A});
  EXPECT_EQ(ring.reader.read_latest(ring.out).sequence, 1U)
      << "the one before stays readable, for ever if the writer dies";
  EXPECT_EQ(ring.writer.begin().data(), slot.data()) << "still the same one";
  ring.writer.commit(48);
  const ReadResult result = ring.reader.read_latest(ring.out);
  EXPECT_EQ(result.status, ReadStatus::fresh);
  EXPECT_EQ(result.sequence, 2U);
  EXPECT_EQ(result.size, 48U);
  EXPECT_EQ(ring.out[47], std::byte{0x5A});
  EXPECT_NE(ring.writer.begin().data(), slot.data());
}

TEST(InPlace, ASlotThatIsBeingFilledAgainIsNotReadUnderItsOldName) {
  Ring ring;
  ring.publish_many(1);
  for (std::uint32_t i = 1; i < ring.shape.slot_count; ++i) ring.publish(8);
  (void)ring.writer.begin();  // the oldest, sequence 1
  const ReadResult oldest = ring.reader.read_next(ring.out);
  EXPECT_EQ(oldest.status, ReadStatus::fresh);
  EXPECT_GT(oldest.sequence, 1U);
  EXPECT_GT(oldest.lost, 0U);
}

TEST(InPlace, WhoWritesAfterTheCommitMakesItCorrupt) {
  Ring ring;
  const std::span<std::byte> slot = ring.writer.begin();
  std::ranges::fill(slot, std::byte{1});
  ring.writer.commit(slot.size());
  slot[7] = std::byte{2};
  EXPECT_EQ(ring.reader.read_latest(ring.out).status, ReadStatus::corrupt);
}

TEST(HostileSegment, SizeBeyondTheSlotCopiesNothing) {
  for (const std::uint32_t size : {kShape.payload_capacity + 1, 1U << 20U, std::numeric_limits<std::uint32_t>::max()}) {
    Ring ring;
    ring.publish(64);
    std::ranges::fill(ring.out, std::byte{0xEE});
    ring.slot(1).size_and_crc.store(pack_size_and_crc(size, 0));
    EXPECT_EQ(ring.reader.read_latest(ring.out).status, ReadStatus::corrupt);
    EXPECT_TRUE(std::ranges::all_of(ring.out, [](std::byte b) { return b == std::byte{0xEE}; }));
  }
}

// Bytes behind a reader's buffer are not its own, whatever size the writer claims: the payload's beginning is read.
TEST(HostileSegment, PayloadLargerThanTheReadersBufferIsCut) {
  Ring ring;
  ring.publish(64);
  std::ranges::fill(ring.out, std::byte{0xEE});
  const ReadResult result = ring.reader.read_latest(std::span(ring.out).first(32));
  EXPECT_EQ(result.status, ReadStatus::cut);
  EXPECT_EQ(result.size, 64U);
  const auto sent = make_payload(1, 64);
  EXPECT_TRUE(std::ranges::equal(std::span(ring.out).first(32), std::span(sent).first(32)));
  EXPECT_TRUE(std::ranges::all_of(std::span(ring.out).subspan(32), [](std::byte b) { return b == std::byte{0xEE}; }));
  EXPECT_EQ(ring.reader.read_latest(ring.out).status, ReadStatus::nothing_new) << "reported once";
}

// A writer that claims a head for a slot it has marked as being written keeps readers away for ever, but not longer
// than kMaxTries per call.
TEST(HostileSegment, SlotThatStaysOddIsContendedAfterBoundedTries) {
  Ring ring;
  ring.publish_many(2);
  ring.slot(2).version.store(version_while_writing(10));
  for (int i = 0; i < 3; ++i) {
    const ReadResult latest = ring.reader.read_latest(ring.out);
    EXPECT_EQ(latest.status, ReadStatus::contended);
    EXPECT_EQ(latest.tries, kMaxTries);
  }
}

TEST(HostileSegment, HeadRunningBackwardsIsCorrupt) {
  Ring ring;
  ring.publish_many(5);
  ASSERT_EQ(ring.reader.read_latest(ring.out).status, ReadStatus::fresh);
  ring.header().head.store(2);
  EXPECT_EQ(ring.reader.read_latest(ring.out).status, ReadStatus::corrupt);
  EXPECT_EQ(ring.reader.read_next(ring.out).status, ReadStatus::corrupt);
}

TEST(HostileSegment, HeadOfASlotNeverWrittenIsCorrupt) {
  Ring ring;
  ring.publish_many(2);
  ring.header().head.store(5);
  EXPECT_EQ(ring.reader.read_latest(ring.out).status, ReadStatus::corrupt);
}

TEST(HostileSegment, HeadJumpCostsArithmeticNotTime) {
  for (const std::uint64_t head : {std::uint64_t{1} << 40U, std::uint64_t{1} << 63U, ~std::uint64_t{0}}) {
    Ring ring;
    ring.publish_many(3);
    ring.header().head.store(head);
    const ReadResult result = ring.reader.read_next(ring.out);
    EXPECT_NE(result.status, ReadStatus::fresh);
    EXPECT_LE(result.tries, kMaxTries);
    EXPECT_NE(ring.reader.read_latest(ring.out).status, ReadStatus::fresh);
  }
}

// Words drawn from what could hurt: small numbers, plausible versions and sizes, extremes, noise. Under the address
// sanitizer an access outside the output shows; outside the segment it faults.
TEST(HostileSegment, ArbitraryBytesStayBoundedAndInBounds) {
  const RingShape shape{4, 1000, 9};
  for (std::uint32_t seed = 1; seed <= 2000; ++seed) {
    std::mt19937_64 random(seed);
    RingMemory memory(shape);
    const SlotWriter writer(memory.bytes(), shape);
    SlotReader reader = reader_of(memory, shape);
    std::vector<std::byte> out(shape.payload_capacity);
    for (int round = 0; round < 8; ++round) {
      for (std::size_t at = 0; at + 8 <= memory.bytes().size(); at += 8) {
        const std::array<std::uint64_t, 6> choices{random() % 16,
                                                   2 * (random() % 8),
                                                   pack_size_and_crc(static_cast<std::uint32_t>(random() % 1300), 0),
                                                   ~std::uint64_t{0},
                                                   std::uint64_t{1} << (random() % 64),
                                                   random()};
        shared_at<Word>(memory.bytes().data() + at).store(choices[random() % choices.size()]);
      }
      for (const ReadResult& result : {reader.read_latest(out), reader.read_next(out)}) {
        ASSERT_LE(result.tries, kMaxTries) << "seed " << seed;
        ASSERT_NE(result.status, ReadStatus::fresh) << "seed " << seed << ": a checksum matched by accident?";
      }
      reader.skip_to_newest();
    }
  }
}

}  // namespace
}  // namespace takt::ipc

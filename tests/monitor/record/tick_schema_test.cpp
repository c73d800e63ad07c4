// SPDX-License-Identifier: Apache-2.0
// Goal: no byte of a tick is lost on its way to disk, and every alteration is found and named. Method: records with
// random content in every described field; the tables against the structures; every single bit flipped in turn.
#include "monitor/record/tick_schema.hpp"

#include <gtest/gtest.h>

#include <cstring>
#include <random>
#include <vector>

#include "evidence/review/tick_difference.hpp"

namespace takt::monitor {
namespace {

TickRecord random_record(std::uint32_t seed, std::uint32_t joints, std::uint8_t buses) {
  std::mt19937_64 random(seed);
  TickRecord record;
  auto* base = std::as_writable_bytes(std::span(&record, 1)).data();
  const auto fill = [&](std::span<const TickField> fields, std::size_t at) {
    for (const TickField& field : fields) {
      const std::uint64_t value = random();
      std::memcpy(base + at + field.offset, &value, size_of(field.type));
    }
  };
  fill(header_fields(), 0);
  record.header.joint_count = joints;
  record.header.bus_count = buses;
  for (std::size_t bus = 0; bus < buses; ++bus) {
    fill(bus_fields(), offsetof(TickRecordHeader, buses) + bus * sizeof(BusHealth));
  }
  for (std::size_t joint = 0; joint < joints; ++joint) {
    fill(joint_fields(), sizeof(TickRecordHeader) + joint * sizeof(JointRecord));
  }
  return record;
}

// Bytes of a structure that no table row names.
std::vector<std::size_t> uncovered(std::span<const TickField> fields, std::size_t size) {
  std::vector<bool> covered(size, false);
  for (const TickField& field : fields) {
    for (std::size_t byte = 0; byte < size_of(field.type); ++byte) {
      EXPECT_FALSE(covered[field.offset + byte]) << field.name << " overlaps another field";
      covered[field.offset + byte] = true;
    }
  }
  std::vector<std::size_t> missing;
  for (std::size_t at = 0; at < size; ++at) {
    if (!covered[at]) missing.push_back(at);
  }
  return missing;
}

std::vector<std::size_t> range(std::size_t first, std::size_t count) {
  std::vector<std::size_t> result;
  for (std::size_t at = first; at < first + count; ++at) result.push_back(at);
  return result;
}

TEST(TickSchema, TablesCoverEverythingButReservedBytes) {
  std::vector<std::size_t> expected = range(offsetof(TickRecordHeader, buses), sizeof(TickRecordHeader::buses));
  const auto reserved = range(offsetof(TickRecordHeader, reserved), sizeof(TickRecordHeader::reserved));
  expected.insert(expected.end(), reserved.begin(), reserved.end());
  for (std::size_t seat = 0; seat < kSeatCount; ++seat) {
    const auto of_seat =
        range(offsetof(TickRecordHeader, seats) + seat * sizeof(SeatRecord) + offsetof(SeatRecord, reserved),
              sizeof(SeatRecord::reserved));
    expected.insert(expected.end(), of_seat.begin(), of_seat.end());
  }
  EXPECT_EQ(uncovered(header_fields(), sizeof(TickRecordHeader)), expected);
  EXPECT_EQ(uncovered(bus_fields(), sizeof(BusHealth)), range(offsetof(BusHealth, reserved), 2));
  EXPECT_EQ(uncovered(joint_fields(), sizeof(JointRecord)),
            range(offsetof(JointRecord, reserved), sizeof(JointRecord::reserved)));
}

TEST(TickSchema, EveryByteSurvivesTheJourney) {
  CdrWriter out;
  for (std::uint32_t seed = 1; seed <= 200; ++seed) {
    const TickRecord record = random_record(seed, 1 + seed % kMaxJoints, static_cast<std::uint8_t>(seed % 9));
    encode_tick(record, crc_of(record), out);
    RecordedTick back;
    ASSERT_TRUE(decode_tick(out.bytes(), back)) << seed;
    ASSERT_EQ(std::memcmp(&record, &back.record, record.used_bytes()), 0) << seed;
    ASSERT_EQ(back.crc, crc_of(back.record)) << seed;
  }
}

TEST(TickSchema, NoShorterMessageIsATick) {
  CdrWriter out;
  encode_tick(random_record(1, 6, 2), 0, out);
  RecordedTick back;
  for (std::size_t length = 0; length < out.bytes().size(); ++length) {
    EXPECT_FALSE(decode_tick(std::span(out.bytes()).first(length), back)) << length;
  }
}

// One bit of one field at a time: the checksum notices, the search names that very field, the value is put right.
TEST(TickSchema, EveryFlippedBitIsLocated) {
  const TickRecord original = random_record(7, 3, 2);
  const std::uint32_t crc = crc_of(original);
  const auto check = [&](std::span<const TickField> fields, std::size_t base, evidence::FieldPlace::Group group,
                         std::size_t index) {
    for (const TickField& field : fields) {
      if (field.name == "joint_count" || field.name == "bus_count") continue;  // they fix the message's length
      for (std::size_t bit = 0; bit < 8 * size_of(field.type); ++bit) {
        RecordedTick altered{original, crc};
        auto* bytes = std::as_writable_bytes(std::span(&altered.record, 1)).data();
        bytes[base + field.offset + bit / 8] ^= std::byte{static_cast<unsigned char>(1U << (bit % 8))};
        TickRecord mended;
        const auto place = evidence::locate_flipped_bit(altered, mended);
        ASSERT_TRUE(place) << field.name;
        EXPECT_EQ(place->field->name, field.name);
        EXPECT_EQ(place->group, group);
        EXPECT_EQ(place->index, index);
        EXPECT_EQ(std::memcmp(&mended, &original, original.used_bytes()), 0);
        const auto difference = evidence::first_difference(altered.record, original);
        ASSERT_TRUE(difference);
        EXPECT_EQ(difference->offset, place->offset);
      }
    }
  };
  check(header_fields(), 0, evidence::FieldPlace::Group::header, 0);
  check(bus_fields(), offsetof(TickRecordHeader, buses) + sizeof(BusHealth), evidence::FieldPlace::Group::bus, 1);
  check(joint_fields(), sizeof(TickRecordHeader) + 2 * sizeof(JointRecord), evidence::FieldPlace::Group::joint, 2);
}

TEST(TickSchema, ValuesReadAsPeopleSayThem) {
  TickRecord record;
  record.header.mode = Mode::degraded;
  record.header.joint_count = 1;
  record.joints[0].q_estimate = 0.1F;
  TickRecord other = record;
  other.header.mode = Mode::tracking;
  auto place = evidence::first_difference(record, other);
  ASSERT_TRUE(place);
  EXPECT_EQ(evidence::value_text(record, *place), "degraded (3)");
  other = record;
  other.joints[0].q_estimate = 0.10000001F;
  place = evidence::first_difference(record, other);
  ASSERT_TRUE(place);
  EXPECT_EQ(place->field->name, "q_estimate");
  EXPECT_NE(evidence::value_text(record, *place), evidence::value_text(other, *place));
  EXPECT_FALSE(evidence::first_difference(record, record));
}

TEST(TickSchema, SchemaNamesEveryFieldAndEnumValue) {
  const std::string schema = tick_schema();
  for (const std::string_view line : {"int64 age_infer", "float32[] q_estimate", "uint8 MODE_FAULT_LATCHED=5",
                                      "uint8 CAUSE_COMMAND_LOST=9", "uint32[] bus_tx_dropped", "uint32 crc",
                                      "uint16 INTERVENTION_ENVELOPE_CLAMP=512", "uint8 OVERRUN_CAUSE_PREEMPTED=2"}) {
    EXPECT_NE(schema.find(line), std::string::npos) << line;
  }
}

}  // namespace
}  // namespace takt::monitor

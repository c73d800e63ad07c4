// SPDX-License-Identifier: Apache-2.0
#include "evidence/review/tick_difference.hpp"

#include <fmt/format.h>

#include <cstring>

namespace takt::evidence {
namespace {

using Group = FieldPlace::Group;

// Calls `visit(place)` for every field of a record of this shape, in table order, until it returns true.
template <class Visit>
bool any_field(const TickRecordHeader& shape, const Visit& visit) {
  for (const monitor::TickField& field : monitor::header_fields()) {
    if (visit(FieldPlace{&field, Group::header, 0, field.offset})) return true;
  }
  for (std::size_t bus = 0; bus < shape.bus_count && bus < kMaxBuses; ++bus) {
    const std::size_t base = offsetof(TickRecordHeader, buses) + bus * sizeof(BusHealth);
    for (const monitor::TickField& field : monitor::bus_fields()) {
      if (visit(FieldPlace{&field, Group::bus, bus, base + field.offset})) return true;
    }
  }
  for (std::size_t joint = 0; joint < shape.joint_count && joint < kMaxJoints; ++joint) {
    const std::size_t base = sizeof(TickRecordHeader) + joint * sizeof(JointRecord);
    for (const monitor::TickField& field : monitor::joint_fields()) {
      if (visit(FieldPlace{&field, Group::joint, joint, base + field.offset})) return true;
    }
  }
  return false;
}

template <class T>
T value_at(const TickRecord& record, std::size_t offset) {
  T value{};
  std::memcpy(&value, monitor::bytes_of(record).data() + offset, sizeof value);
  return value;
}

std::string enum_text(unsigned value, const monitor::TickField& field) {
  if (value < field.values.size()) return fmt::format("{} ({})", field.values[value], value);
  return fmt::format("{}", value);
}

}  // namespace

std::optional<FieldPlace> first_difference(const TickRecord& a, const TickRecord& b) {
  std::optional<FieldPlace> found;
  const std::byte* bytes_a = monitor::bytes_of(a).data();
  const std::byte* bytes_b = monitor::bytes_of(b).data();
  any_field(a.header, [&](const FieldPlace& place) {
    if (std::memcmp(bytes_a + place.offset, bytes_b + place.offset, monitor::size_of(place.field->type)) == 0)
      return false;
    found = place;
    return true;
  });
  return found;
}

// A CRC-32C tells all single-bit errors of a record this short apart, so at most one candidate matches.
std::optional<FieldPlace> locate_flipped_bit(const monitor::RecordedTick& tick, TickRecord& mended) {
  std::optional<FieldPlace> found;
  mended = tick.record;
  auto* bytes = std::as_writable_bytes(std::span(&mended, 1)).data();
  any_field(tick.record.header, [&](const FieldPlace& place) {
    // A flip in a count changes how much was recorded, so that it can never come back as a whole record.
    for (std::size_t bit = 0; bit < 8 * size_of(place.field->type); ++bit) {
      const std::byte mask{static_cast<unsigned char>(1U << (bit % 8))};
      std::byte& target = bytes[place.offset + bit / 8];
      target ^= mask;
      const bool valid = mended.header.joint_count <= kMaxJoints && monitor::crc_of(mended) == tick.crc;
      if (valid) {
        found = place;
        return true;
      }
      target ^= mask;
    }
    return false;
  });
  return found;
}

std::string value_text(const TickRecord& record, const FieldPlace& place) {
  switch (place.field->type) {
    case monitor::FieldType::u8:
      return enum_text(value_at<std::uint8_t>(record, place.offset), *place.field);
    case monitor::FieldType::u16:
      return fmt::format("{:#x}", value_at<std::uint16_t>(record, place.offset));
    case monitor::FieldType::u32:
      return fmt::format("{}", value_at<std::uint32_t>(record, place.offset));
    case monitor::FieldType::u64:
      return fmt::format("{}", value_at<std::uint64_t>(record, place.offset));
    case monitor::FieldType::i64:
      return fmt::format("{}", value_at<std::int64_t>(record, place.offset));
    case monitor::FieldType::f32:
      return fmt::format("{:.9g}", value_at<float>(record, place.offset));
  }
  return {};
}

}  // namespace takt::evidence

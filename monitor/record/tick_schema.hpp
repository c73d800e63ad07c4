// SPDX-License-Identifier: Apache-2.0
// The one description of a tick record's fields: name, type, place, unit, and whether a field is an input of the
// decision or an output of it. The MCAP schema, the CDR encoding and replay's naming of differences all come from it;
// a test checks that together the tables cover every byte of the structures but the reserved ones.
#pragma once

#include <cstddef>
#include <cstdint>
#include <span>
#include <string>
#include <string_view>

#include "executive/contract/tick_record.hpp"
#include "monitor/record/cdr.hpp"

namespace takt::monitor {

enum class FieldType : std::uint8_t { u8, u16, u32, u64, i64, f32 };
enum class FieldRole : std::uint8_t { input, output };

// One field of TickRecordHeader, BusHealth or JointRecord.
struct TickField {
  std::string_view name;
  FieldType type;
  std::size_t offset;
  FieldRole role;
  std::string_view note;                          // unit or meaning, for the schema
  std::span<const std::string_view> values = {};  // names of an enum's values, for the schema's constants
};

constexpr std::size_t size_of(FieldType type) {
  switch (type) {
    case FieldType::u8:
      return 1;
    case FieldType::u16:
      return 2;
    case FieldType::u32:
    case FieldType::f32:
      return 4;
    case FieldType::u64:
    case FieldType::i64:
      return 8;
  }
  return 0;
}
std::span<const TickField> header_fields();  // offsets into TickRecordHeader
std::span<const TickField> bus_fields();     // offsets into BusHealth; one array entry per bus
std::span<const TickField> joint_fields();   // offsets into JointRecord; one array entry per joint

// takt_msgs/msg/Tick in ros2msg notation. Arrays are named bus_... and as the joint field.
std::string tick_schema();

// `crc`: crc_of(record) as the executive published it.
void encode_tick(const TickRecord& record, std::uint32_t crc, CdrWriter& out);

struct RecordedTick {
  TickRecord record;      // reserved bytes zero
  std::uint32_t crc = 0;  // as recorded; crc_of(record) when nothing was altered since
};
// False when the message is not a tick. `out` is overwritten.
bool decode_tick(std::span<const std::byte> message, RecordedTick& out);
std::uint32_t crc_of(const TickRecord& record);

}  // namespace takt::monitor

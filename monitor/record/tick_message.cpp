// SPDX-License-Identifier: Apache-2.0
// takt_msgs/msg/Tick: schema text, encoding and decoding, all driven by the tables of tick_schema.
#include <fmt/format.h>

#include <algorithm>
#include <cctype>
#include <iterator>

#include "executive/ipc/crc32c.hpp"
#include "monitor/record/tick_schema.hpp"

namespace takt::monitor {
namespace {

std::string_view ros_type(FieldType type) {
  switch (type) {
    case FieldType::u8:
      return "uint8";
    case FieldType::u16:
      return "uint16";
    case FieldType::u32:
      return "uint32";
    case FieldType::u64:
      return "uint64";
    case FieldType::i64:
      return "int64";
    case FieldType::f32:
      return "float32";
  }
  return "";
}

std::string upper(std::string_view text) {
  std::string result(text);
  std::transform(result.begin(), result.end(), result.begin(),
                 [](unsigned char c) { return static_cast<char>(std::toupper(c)); });
  return result;
}

void put_schema(std::string& text, std::span<const TickField> fields, std::string_view suffix) {
  for (const TickField& field : fields) {
    for (std::size_t value = 0; value < field.values.size(); ++value) {
      text += fmt::format("{} {}_{}={}\n", ros_type(field.type), upper(field.name), upper(field.values[value]), value);
    }
    text += fmt::format("{}{} {}", ros_type(field.type), suffix, field.name);
    const std::string_view role = field.role == FieldRole::input ? "input" : "output";
    text += field.note.empty() ? fmt::format("  # {}\n", role) : fmt::format("  # {}; {}\n", role, field.note);
  }
}

const std::byte* base_of(const TickRecord& record) {
  return bytes_of(record).data();
}

// One sequence per field, one element per bus or joint.
void put_columns(CdrWriter& out, const std::byte* rows, std::size_t row_size, std::size_t row_count,
                 std::span<const TickField> fields) {
  for (const TickField& field : fields) {
    out.put_count(row_count);
    for (std::size_t row = 0; row < row_count; ++row) {
      out.put_raw(rows + row * row_size + field.offset, size_of(field.type));
    }
  }
}

bool get_columns(CdrReader& in, std::byte* rows, std::size_t row_size, std::size_t row_count,
                 std::span<const TickField> fields) {
  for (const TickField& field : fields) {
    const std::size_t count = in.get_count(row_count);
    if (count == 0) continue;  // of a run that has not this field (message_schema.hpp)
    if (count != row_count) return false;
    in.get_column(rows + field.offset, row_size, size_of(field.type), row_count);
  }
  return in.ok();
}

}  // namespace

std::string tick_schema() {
  std::string text = "# One control tick: every input the decision read and every output it produced.\n";
  for (std::size_t index = 0; index < kInterventionCount; ++index) {
    text += fmt::format("uint16 INTERVENTION_{}={}\n", upper(kInterventionNames[index]), 1U << index);
  }
  put_schema(text, header_fields(), "");
  text += "# one entry per bus\n";
  put_schema(text, bus_fields(), "[]");
  text += "# one entry per joint\n";
  put_schema(text, joint_fields(), "[]");
  text += "uint32 crc  # CRC-32C of the record as the executive published it\n";
  return text;
}

std::uint32_t crc_of(const TickRecord& record) {
  return ipc::crc32c(bytes_of(record).first(record.used_bytes()));
}

void encode_tick(const TickRecord& record, std::uint32_t crc, CdrWriter& out) {
  out.clear();
  const std::byte* base = base_of(record);
  for (const TickField& field : header_fields()) out.put_raw(base + field.offset, size_of(field.type));
  put_columns(out, base + offsetof(TickRecordHeader, buses), sizeof(BusHealth), record.header.bus_count, bus_fields());
  put_columns(out, base + sizeof(TickRecordHeader), sizeof(JointRecord), record.header.joint_count, joint_fields());
  out.put(crc);
}

bool decode_tick(std::span<const std::byte> message, RecordedTick& out) {
  out.record = {};
  auto* base = std::as_writable_bytes(std::span(&out.record, 1)).data();
  CdrReader in(message);
  for (const TickField& field : header_fields()) in.get_raw(base + field.offset, size_of(field.type));
  const TickRecordHeader& header = out.record.header;
  if (!in.ok() || header.bus_count > kMaxBuses || header.joint_count > kMaxJoints) return false;
  if (!get_columns(in, base + offsetof(TickRecordHeader, buses), sizeof(BusHealth), header.bus_count, bus_fields())) {
    return false;
  }
  if (!get_columns(in, base + sizeof(TickRecordHeader), sizeof(JointRecord), header.joint_count, joint_fields())) {
    return false;
  }
  out.crc = in.get<std::uint32_t>();
  return in.ok();
}

}  // namespace takt::monitor

// SPDX-License-Identifier: Apache-2.0
#include "lab/artifact/thrift_compact.hpp"

#include <utility>

namespace takt::lab {
namespace {

std::uint64_t zigzag(std::int64_t value) {
  return (static_cast<std::uint64_t>(value) << 1U) ^ static_cast<std::uint64_t>(value >> 63);
}

char byte_of(std::uint64_t value) {
  return static_cast<char>(static_cast<unsigned char>(value));
}

}  // namespace

std::string thrift_varint(std::uint64_t value) {
  std::string bytes;
  for (; value >= 0x80; value >>= 7U) bytes.push_back(byte_of(value | 0x80U));
  bytes.push_back(byte_of(value));
  return bytes;
}

void ThriftWriter::header(int field, ThriftType type) {
  constexpr int kLargestDelta = 15;
  const int delta = field - std::exchange(last_field_.back(), field);
  const auto low = static_cast<unsigned>(type);
  if (delta > 0 && delta <= kLargestDelta) {
    bytes_.push_back(byte_of(static_cast<unsigned>(delta) << 4U | low));
  } else {
    bytes_.push_back(byte_of(low));
    bytes_ += thrift_varint(zigzag(field));
  }
}

void ThriftWriter::i32(int field, std::int32_t value) {
  header(field, ThriftType::i32);
  bytes_ += thrift_varint(zigzag(value));
}

void ThriftWriter::i64(int field, std::int64_t value) {
  header(field, ThriftType::i64);
  bytes_ += thrift_varint(zigzag(value));
}

void ThriftWriter::text(int field, std::string_view value) {
  header(field, ThriftType::binary);
  element(value);
}

void ThriftWriter::begin_struct(int field) {
  header(field, ThriftType::structure);
  last_field_.push_back(0);
}

void ThriftWriter::begin_list(int field, ThriftType of, std::size_t count) {
  constexpr std::size_t kLong = 15;
  header(field, ThriftType::list);
  bytes_.push_back(byte_of((count < kLong ? count : kLong) << 4U | static_cast<unsigned>(of)));
  if (count >= kLong) bytes_ += thrift_varint(count);
}

void ThriftWriter::element(std::int32_t value) {
  bytes_ += thrift_varint(zigzag(value));
}

void ThriftWriter::element(std::string_view value) {
  bytes_ += thrift_varint(value.size());
  bytes_ += value;
}

void ThriftWriter::end_struct() {
  bytes_.push_back('\0');
  last_field_.pop_back();
}

std::string ThriftWriter::finish() {
  end_struct();
  return std::exchange(bytes_, {});
}

}  // namespace takt::lab

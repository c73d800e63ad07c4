// SPDX-License-Identifier: Apache-2.0
// Writes one Thrift struct in the compact protocol, as far as Parquet's page headers and footer need it: i32, i64,
// binary, lists and nested structs. Field ids must rise within a struct; the caller keeps begin and end in pairs.
// Source: github.com/apache/thrift, doc/specs/thrift-compact-protocol.md.
#pragma once

#include <cstdint>
#include <string>
#include <string_view>
#include <vector>

namespace takt::lab {

enum class ThriftType : std::uint8_t { i32 = 5, i64 = 6, binary = 8, list = 9, structure = 12 };

std::string thrift_varint(std::uint64_t value);

class ThriftWriter {
 public:
  void i32(int field, std::int32_t value);
  void i64(int field, std::int64_t value);
  void text(int field, std::string_view value);
  void begin_struct(int field);
  // `count` elements follow: element() for each, or begin_element() ... end_struct().
  void begin_list(int field, ThriftType of, std::size_t count);
  void element(std::int32_t value);
  void element(std::string_view value);
  void begin_element() { last_field_.push_back(0); }
  void end_struct();
  // Ends the outermost struct and hands out its bytes.
  std::string finish();

 private:
  void header(int field, ThriftType type);
  std::string bytes_;
  std::vector<int> last_field_{0};  // of every open struct
};

}  // namespace takt::lab

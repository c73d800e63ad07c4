// SPDX-License-Identifier: Apache-2.0
// What a recorded message's ros2msg text says of its fields, and the same message laid out as another text says: fields
// go by their names, one that the message lacks is zero or empty, one that is not asked for is left out. So a run is
// read by what stands in its own file, whichever version recorded it.
//
// The texts are a stranger's: their size and number of fields are bounded, and no count is believed before as many
// bytes are there. Errors are half a sentence. Thread rule: one thread per object.
#pragma once

#include <cstdint>
#include <expected>
#include <span>
#include <string>
#include <string_view>
#include <vector>

#include "monitor/record/cdr.hpp"

namespace takt::monitor {

struct MessageField {
  std::string type;  // "uint8", "string"
  std::string name;
  bool is_sequence = false;
  std::size_t fixed_count = 1;  // of an array without a count of its own in the message
};

struct MessageConstant {
  std::string name;
  std::uint64_t value = 0;
};

struct MessageSchema {
  std::vector<MessageField> fields;
  std::vector<MessageConstant> constants;
};
std::expected<MessageSchema, std::string> message_schema_of(std::string_view text);

class Relayout {
 public:
  // An unsigned integer may have become wider; any other change of a type is refused, and so is a message that lacks
  // the first field of `to`.
  static std::expected<Relayout, std::string> make(MessageSchema from, MessageSchema to);
  [[nodiscard]] bool is_needed() const { return is_needed_; }
  // Valid until the next call; empty: the message is not as its text says.
  std::span<const std::byte> operator()(std::span<const std::byte> message);

 private:
  static constexpr std::size_t kLacking = ~std::size_t{0};
  struct Value {
    std::size_t count = 0;
    Bytes elements{};  // a text without its final zero
  };
  MessageSchema from_, to_;
  std::vector<std::size_t> source_;  // of each field of `to_`: its place in `from_`
  bool is_needed_ = false;
  std::vector<Value> values_;
  CdrWriter out_;
};

}  // namespace takt::monitor

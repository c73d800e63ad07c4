// SPDX-License-Identifier: Apache-2.0
#include "policy_host/onnx_engine/wire_screen.hpp"

#include <fmt/format.h>
#include <google/protobuf/descriptor.h>

#include <cstdint>
#include <optional>

#include "policy_host/onnx_engine/builder.hpp"

namespace takt::onnx_engine {
namespace {

using google::protobuf::Descriptor;
using google::protobuf::FieldDescriptor;

// Upper bounds, of libonnx's largest message and of a string with its place in a list.
constexpr std::size_t kMessageBytes = 512;
constexpr std::size_t kStringBytes = 64;
constexpr std::size_t kUnknownBytes = 32;
constexpr std::size_t kVarintBytes = 16;  // one by one; a list doubles as it grows
constexpr std::size_t kVarintGrowth = 8;  // of a packed list: a byte each in the file
constexpr int kDeepest = 100;             // as libprotobuf

enum class Wire : std::uint8_t { varint = 0, fixed64 = 1, delimited = 2, fixed32 = 5 };

class WireScreen {
 public:
  bool message(std::span<const std::byte> bytes, const Descriptor& type, int depth) {  // NOLINT(misc-no-recursion)
    if (depth > kDeepest) return false;
    take(kMessageBytes);
    while (!bytes.empty()) {
      const auto tag = varint(bytes);
      if (!tag || *tag >> 3U == 0 || *tag >> 3U > FieldDescriptor::kMaxNumber) return false;
      const FieldDescriptor* const field = type.FindFieldByNumber(static_cast<int>(*tag >> 3U));
      if (!value(bytes, static_cast<Wire>(*tag & 7U), field, depth)) return false;
    }
    return true;
  }

 private:
  bool value(std::span<const std::byte>& bytes, Wire wire, const FieldDescriptor* field,  // NOLINT(misc-no-recursion)
             int depth) {
    switch (wire) {
      case Wire::varint:
        take(field != nullptr ? kVarintBytes : kUnknownBytes);
        return varint(bytes).has_value();
      case Wire::fixed64:
        take(field != nullptr ? 0 : kUnknownBytes);
        return skip(bytes, sizeof(std::uint64_t));
      case Wire::fixed32:
        take(field != nullptr ? 0 : kUnknownBytes);
        return skip(bytes, sizeof(std::uint32_t));
      case Wire::delimited:
        break;
      default:  // groups, which ONNX has none of
        return false;
    }
    const auto size = varint(bytes);
    if (!size || *size > bytes.size()) return false;
    const auto inside = bytes.first(static_cast<std::size_t>(*size));
    bytes = bytes.subspan(inside.size());
    if (field != nullptr && field->type() == FieldDescriptor::TYPE_MESSAGE)
      return message(inside, *field->message_type(), depth + 1);
    take(field != nullptr && field->is_packable() ? packed_bytes(*field, inside.size()) : kStringBytes);
    return true;
  }

  // Beyond what they take in the file.
  static std::size_t packed_bytes(const FieldDescriptor& field, std::size_t size) {
    const bool as_wide =
        field.cpp_type() == FieldDescriptor::CPPTYPE_FLOAT || field.cpp_type() == FieldDescriptor::CPPTYPE_DOUBLE;
    return as_wide ? 0 : kVarintGrowth * size;
  }

  void take(std::size_t bytes) {
    taken_ += bytes;
    if (taken_ > kMostParseBytes)
      throw Refusal(
          fmt::format("its messages would take more than {} MiB besides its weights, more than any network does: is it "
                      "damaged, or made to fill memory?",
                      kMostParseBytes >> 20U));
  }

  static bool skip(std::span<const std::byte>& bytes, std::size_t count) {
    if (bytes.size() < count) return false;
    bytes = bytes.subspan(count);
    return true;
  }

  static std::optional<std::uint64_t> varint(std::span<const std::byte>& bytes) {
    std::uint64_t value = 0;
    for (unsigned shift = 0; shift < 64 && !bytes.empty(); shift += 7) {
      const auto byte = std::to_integer<std::uint64_t>(bytes.front());
      bytes = bytes.subspan(1);
      value |= (byte & 0x7FU) << shift;
      if (byte < 0x80U) return value;
    }
    return std::nullopt;
  }

  std::size_t taken_ = 0;
};

}  // namespace

bool screen_wire(std::span<const std::byte> bytes, const google::protobuf::Descriptor& message) {
  return WireScreen().message(bytes, message, 0);
}

}  // namespace takt::onnx_engine

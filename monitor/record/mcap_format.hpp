// SPDX-License-Identifier: Apache-2.0
// The parts of the MCAP file format that writer and reader share: magic, opcodes, little-endian building blocks.
// Source: the MCAP specification, version 0 of the format (mcap.dev/spec).
#pragma once

#include <array>
#include <cstddef>
#include <cstdint>
#include <cstring>
#include <map>
#include <span>
#include <string>
#include <string_view>

#include "monitor/record/bytes.hpp"

namespace takt::monitor::mcap {

inline constexpr std::array<unsigned char, 8> kMagic{0x89, 'M', 'C', 'A', 'P', '0', '\r', '\n'};

enum class Opcode : std::uint8_t {
  header = 0x01,
  footer = 0x02,
  schema = 0x03,
  channel = 0x04,
  message = 0x05,
  chunk = 0x06,
  message_index = 0x07,
  chunk_index = 0x08,
  attachment = 0x09,
  attachment_index = 0x0A,
  statistics = 0x0B,
  metadata = 0x0C,
  metadata_index = 0x0D,
  summary_offset = 0x0E,
  data_end = 0x0F,
};

inline constexpr std::size_t kRecordHead = 9;  // opcode, then the content's length as uint64

// Appends MCAP primitives to a byte vector.
class Builder {
 public:
  explicit Builder(Bytes& out) : out_(out) {}
  template <class Integer>
  Builder& put(Integer value) {
    return raw(&value, sizeof value);
  }
  Builder& text(std::string_view value);
  Builder& raw(const void* data, std::size_t size);
  Builder& bytes(std::span<const std::byte> data) { return raw(data.data(), data.size()); }
  Builder& map(const std::map<std::string, std::string>& entries);
  // Starts a record; its length is filled in by end().
  Builder& begin(Opcode opcode);
  Builder& end();

 private:
  Bytes& out_;
  std::size_t start_ = 0;
};

// Reads MCAP primitives; once something is missing, ok() is false and values are zero.
class Parser {
 public:
  explicit Parser(std::span<const std::byte> in) : in_(in) {}
  template <class Integer>
  Integer get() {
    Integer value{};
    const auto taken = take(sizeof value);
    if (ok_) std::memcpy(&value, taken.data(), sizeof value);
    return value;
  }
  std::string text();
  std::span<const std::byte> take(std::uint64_t size);
  std::map<std::string, std::string> map();
  [[nodiscard]] std::span<const std::byte> rest() const { return in_; }
  [[nodiscard]] bool ok() const { return ok_; }

 private:
  std::span<const std::byte> in_;
  bool ok_ = true;
};

// CRC-32 (IEEE 802.3), the checksum of MCAP chunks and summaries. `seed` continues an earlier result.
std::uint32_t crc32(std::span<const std::byte> data, std::uint32_t seed = 0);

}  // namespace takt::monitor::mcap

// SPDX-License-Identifier: Apache-2.0
// Little-endian CDR (OMG XCDR version 1, "plain CDR"), as ROS 2 messages are stored in MCAP files.
//
// A message starts with the four encapsulation bytes 00 01 00 00; every primitive is aligned to its own size, counted
// from the byte after them. Strings carry their length including the final zero; sequences their element count.
// Float bits pass through untouched. The reader never reads past its bytes: after the first failure ok() stays false
// and everything it returns is zero. Source: OMG DDSI-RTPS 10.5, CDR in the CORBA specification 15.3.
#pragma once

#include <concepts>
#include <cstddef>
#include <cstdint>
#include <cstring>
#include <span>
#include <string>
#include <string_view>

#include "monitor/record/bytes.hpp"

namespace takt::monitor {

template <class T>
concept CdrScalar = std::integral<T> || std::floating_point<T>;

class CdrWriter {
 public:
  CdrWriter() { clear(); }
  void clear();
  // `size` bytes (1, 2, 4 or 8) at `value`, aligned to `size`.
  void put_raw(const void* value, std::size_t size);
  template <CdrScalar T>
  void put(T value) {
    put_raw(&value, sizeof value);
  }
  void put_string(std::string_view text);
  // Element count, then elements of one byte each.
  void put_octets(std::span<const std::byte> octets);
  void put_count(std::size_t count) { put(static_cast<std::uint32_t>(count)); }
  [[nodiscard]] const Bytes& bytes() const { return bytes_; }

 private:
  Bytes bytes_;
};

class CdrReader {
 public:
  explicit CdrReader(std::span<const std::byte> message);
  [[nodiscard]] bool ok() const { return ok_; }
  // `size` bytes (1, 2, 4 or 8), aligned to `size`.
  void get_raw(void* value, std::size_t size) { get_column(value, 0, size, 1); }
  // `count` values of `size` bytes, in memory `stride` bytes apart.
  void get_column(void* first, std::size_t stride, std::size_t size, std::size_t count);
  template <CdrScalar T>
  T get() {
    T value{};
    get_raw(&value, sizeof value);
    return value;
  }
  std::string get_string();
  std::span<const std::byte> get_octets();
  // A sequence's element count; fails when it exceeds `most`.
  std::size_t get_count(std::size_t most);

 private:
  std::span<const std::byte> take(std::size_t size);
  std::span<const std::byte> message_;
  std::size_t at_ = 4;
  bool ok_ = true;
};

}  // namespace takt::monitor

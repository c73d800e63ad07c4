// SPDX-License-Identifier: Apache-2.0
// Messages of an Xsens MTi on a byte stream, and what MTData2 says in them, as Xsens' MT Low Level Communication
// Protocol Documentation (MT0101P) has it: preamble FA, bus id FF, message id, length (FF: two more bytes hold it),
// data, and a checksum that makes everything behind the preamble sum to 0 modulo 256. Numbers are big-endian.
//
// Pure: bytes and stamps in, messages out. Thread rule: one thread at a time.
#pragma once

#include <cstddef>
#include <cstdint>
#include <expected>
#include <span>
#include <string>
#include <vector>

#include "sensors/imu/mt_sample.hpp"
#include "sensors/wait_start.hpp"

namespace takt::sensors {

inline constexpr std::uint8_t kMtData2 = 0x36;

struct MtMessage {
  std::uint8_t id = 0;
  std::vector<std::uint8_t> data;
  Heard first_byte;
};

struct MtStreamCounts {
  std::uint64_t messages = 0, bad_checksums = 0;
  std::uint64_t skipped = 0;  // bytes that belong to no message
};

// Finds messages among garbage: after a byte that cannot begin one, and after a wrong checksum, it looks on from the
// next byte. At most 2055 bytes, the longest message, are kept between two calls.
class MtStream {
 public:
  std::vector<MtMessage> take(std::span<const std::uint8_t> bytes, Heard received);
  [[nodiscard]] const MtStreamCounts& counts() const { return counts_; }

 private:
  struct Byte {
    std::uint8_t value;
    Heard received;
  };
  void drop(std::size_t bytes);
  std::vector<Byte> waiting_;
  MtStreamCounts counts_;
};

// Values are float32 or float64, the rotation in ENU or NWU; anything else beside them is left alone. An error: what
// the part has to be told (one sentence), or that the message is none.
std::expected<MtSample, std::string> parse_mtdata2(std::span<const std::uint8_t> data);

}  // namespace takt::sensors

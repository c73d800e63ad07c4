// Messages of an Xsens MTi on a byte stream, and what MTData2 says in them, as Xsens' MT Low Level Communication
// Protocol Documentation (MT0101P) has it: preamble FA, bus id FF, message id, length (FF: two more bytes hold it),
// data, and a checksum that makes everything behind the preamble sum to 0 modulo 256. Numbers are big-endian.
//
// Pure: bytes and stamps in, messages out. Thread rule: one thread at a time.
#pragma once

#include <array>
#include <cstddef>
#include <cstdint>
#include <expected>
#include <span>
#include <string>
#include <vector>

#include "executive/contract/mono_time.hpp"

namespace takt::sensors {

inline constexpr std::uint8_t kMtData2 = 0x36;

struct MtMessage {
  std::uint8_t id = 0;
  std::vector<std::uint8_t> data;
  MonoTime first_byte_at;  // when its first byte was received
};

struct MtStreamCounts {
  std::uint64_t messages = 0, bad_checksums = 0;
  std::uint64_t skipped = 0;  // bytes that belong to no message
};

// Finds messages among garbage: after a byte that cannot begin one, and after a wrong checksum, it looks on from the
// next byte. At most 2055 bytes, the longest message, are kept between two calls.
class MtStream {
 public:
  std::vector<MtMessage> take(std::span<const std::uint8_t> bytes, MonoTime received);
  [[nodiscard]] const MtStreamCounts& counts() const { return counts_; }

 private:
  struct Byte {
    std::uint8_t value;
    MonoTime received;
  };
  void drop(std::size_t bytes);
  std::vector<Byte> waiting_;
  MtStreamCounts counts_;
};

// One MTData2 message; frames and units are Xsens': sensor frame S, local frame L with z up.
struct MtSample {
  std::uint16_t counter = 0;                 // PacketCounter: one more with every message, modulo 65536
  std::uint32_t ticks = 0;                   // SampleTimeFine: the part's own time, 0.1 ms
  std::array<double, 4> rotation{};          // S in L, w x y z
  std::array<double, 3> angular_velocity{};  // rad/s, in S
  std::array<double, 3> acceleration{};      // m/s^2, in S; specific force
};

// Values are float32 or float64, the rotation in ENU or NWU; anything else beside them is left alone. An error: what
// the part has to be told (one sentence), or that the message is none.
std::expected<MtSample, std::string> parse_mtdata2(std::span<const std::uint8_t> data);

}  // namespace takt::sensors

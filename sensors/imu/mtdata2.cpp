// SPDX-License-Identifier: Apache-2.0
#include "sensors/imu/mtdata2.hpp"

#include <bit>
#include <optional>
#include <string_view>
#include <utility>

namespace takt::sensors {
namespace {

constexpr std::uint8_t kPreamble = 0xFA, kBusId = 0xFF, kExtended = 0xFF;
constexpr std::size_t kLongestData = 2048;

// Data identifiers; of those with numbers the last four bits say how they are written.
constexpr unsigned kPacketCounter = 0x1020, kSampleTimeFine = 0x1060;
constexpr unsigned kQuaternion = 0x2010, kAcceleration = 0x4020, kRateOfTurn = 0x8020;
constexpr unsigned kPrecision = 0x3, kFloat32 = 0x0, kFloat64 = 0x3;
constexpr unsigned kCoordinates = 0xC, kNorthEastDown = 0x4;

std::uint64_t big_endian(std::span<const std::uint8_t> bytes) {
  std::uint64_t value = 0;
  for (const std::uint8_t byte : bytes) value = value << 8U | byte;
  return value;
}

std::string missing(std::string_view what) {
  return "the MTi does not send " + std::string(what) + ": switch it on in MT Manager's output configuration";
}

template <std::size_t Count>
std::expected<std::array<double, Count>, std::string> numbers(unsigned id, std::span<const std::uint8_t> bytes) {
  const unsigned precision = id & kPrecision;
  if (precision != kFloat32 && precision != kFloat64)
    return std::unexpected("the MTi sends fixed-point numbers: choose floating point in MT Manager");
  const std::size_t width = precision == kFloat32 ? 4 : 8;
  if (bytes.size() != Count * width) return std::unexpected("an item of MTData2 has another length than its numbers");
  std::array<double, Count> values{};
  for (std::size_t i = 0; i < Count; ++i) {
    const std::uint64_t raw = big_endian(bytes.subspan(i * width, width));
    values[i] =
        precision == kFloat32 ? std::bit_cast<float>(static_cast<std::uint32_t>(raw)) : std::bit_cast<double>(raw);
  }
  return values;
}

struct Found {
  std::optional<std::uint64_t> counter, ticks;
  std::optional<std::array<double, 4>> rotation;
  std::optional<std::array<double, 3>> angular_velocity, acceleration;
};

// Empty: taken, or nothing of ours.
template <std::size_t Count>
std::string take_numbers(unsigned id, std::span<const std::uint8_t> bytes,
                         std::optional<std::array<double, Count>>& into) {
  auto values = numbers<Count>(id, bytes);
  if (!values) return std::move(values.error());
  into = *values;
  return {};
}

std::string take_item(unsigned id, std::span<const std::uint8_t> bytes, Found& found) {
  if (id == kPacketCounter && bytes.size() == 2) found.counter = big_endian(bytes);
  if (id == kSampleTimeFine && bytes.size() == 4) found.ticks = big_endian(bytes);
  const unsigned kind = id & ~0xFU;
  if (kind == kAcceleration) return take_numbers(id, bytes, found.acceleration);
  if (kind == kRateOfTurn) return take_numbers(id, bytes, found.angular_velocity);
  if (kind != kQuaternion) return {};
  if ((id & kCoordinates) == kNorthEastDown)
    return "the MTi's z axis points down (NED): choose ENU or NWU in MT Manager";
  return take_numbers(id, bytes, found.rotation);
}

// Of the message that begins at a byte; whole 0: none begins there.
struct Extent {
  std::size_t header = 0, data = 0, whole = 0;
};

}  // namespace

std::vector<MtMessage> MtStream::take(std::span<const std::uint8_t> bytes, Heard received) {
  for (const std::uint8_t byte : bytes) waiting_.push_back({byte, received});
  const auto at = [this](std::size_t i) { return waiting_[i].value; };
  const auto extent = [&]() -> std::optional<Extent> {
    if (at(0) != kPreamble || (waiting_.size() > 1 && at(1) != kBusId)) return Extent{};
    if (waiting_.size() < 4 || (at(3) == kExtended && waiting_.size() < 6)) return std::nullopt;
    const bool is_extended = at(3) == kExtended;
    const std::size_t data = is_extended ? static_cast<std::size_t>(at(4) << 8U | at(5)) : at(3);
    if (data > kLongestData) return Extent{};
    const std::size_t header = is_extended ? 6 : 4;
    return Extent{header, data, header + data + 1};
  };
  std::vector<MtMessage> messages;
  while (!waiting_.empty()) {
    const auto one = extent();
    if (!one || one->whole > waiting_.size()) break;
    std::uint8_t sum = 0;
    for (std::size_t i = 1; i < one->whole; ++i) sum = static_cast<std::uint8_t>(sum + at(i));
    if (one->whole == 0 || sum != 0) {
      if (one->whole != 0) ++counts_.bad_checksums;
      ++counts_.skipped;
      drop(1);
      continue;
    }
    MtMessage& message = messages.emplace_back(MtMessage{at(2), {}, waiting_[0].received});
    for (std::size_t i = 0; i < one->data; ++i) message.data.push_back(at(one->header + i));
    ++counts_.messages;
    drop(one->whole);
  }
  return messages;
}

void MtStream::drop(std::size_t bytes) {
  waiting_.erase(waiting_.begin(), waiting_.begin() + static_cast<std::ptrdiff_t>(bytes));
}

std::expected<MtSample, std::string> parse_mtdata2(std::span<const std::uint8_t> data) {
  Found found;
  while (!data.empty()) {
    if (data.size() < 3 || data.size() < 3U + data[2]) return std::unexpected("an item of MTData2 is cut off");
    const auto id = static_cast<unsigned>(big_endian(data.first(2)));
    if (std::string why = take_item(id, data.subspan(3, data[2]), found); !why.empty())
      return std::unexpected(std::move(why));
    data = data.subspan(3U + data[2]);
  }
  if (!found.counter) return std::unexpected(missing("Packet Counter"));
  if (!found.ticks) return std::unexpected(missing("Sample Time Fine"));
  if (!found.rotation) return std::unexpected(missing("Quaternion"));
  if (!found.angular_velocity) return std::unexpected(missing("Rate of Turn"));
  if (!found.acceleration) return std::unexpected(missing("Acceleration"));
  return MtSample{static_cast<std::uint16_t>(*found.counter), static_cast<std::uint32_t>(*found.ticks), *found.rotation,
                  *found.angular_velocity, *found.acceleration};
}

}  // namespace takt::sensors

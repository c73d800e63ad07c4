// SPDX-License-Identifier: Apache-2.0
// Samples of an Xsens MTi on a CAN bus, as Xsens' MT CAN Protocol Documentation (MT1604P) has them: a frame for each
// quantity, numbers big-endian, ids set in MT Manager. A sample is Group Counter, Quaternion, Rate of Turn and
// Acceleration; the counter has the lowest id, so that it goes first and begins the group.
//
// A group that lacks a frame is no sample. Its Sample Time is not read: whether it counts microseconds or tenths of a
// millisecond, Xsens' document and people's decoders disagree. Other frames are left alone.
// Pure: frames in, samples out. Thread rule: one thread at a time.
#pragma once

#include <array>
#include <bitset>
#include <cstdint>
#include <expected>
#include <optional>
#include <string>
#include <vector>

#include "config/drive_ids.hpp"
#include "drivers/bus/can_bus.hpp"
#include "executive/contract/mono_time.hpp"
#include "sensors/imu/mt_sample.hpp"

namespace takt::sensors {

// Group Counter, Quaternion, Rate of Turn, Acceleration: each one id.
using MtCanIds = std::array<config::IdPattern, 4>;

// "0x006,0x021,0x032,0x034": rising, 11 bits each, or 29 where it has more than three digits. An error: one sentence.
std::expected<MtCanIds, std::string> parse_mt_can_ids(const std::string& text);
std::string text_of(const config::IdPattern& id);

struct MtCanSample {
  MtSample sample;
  MonoTime first_frame_at;  // when the oldest frame of the group was received
};

class MtCanGroups {
 public:
  explicit MtCanGroups(const MtCanIds& ids) : ids_(ids) {}

  std::optional<MtCanSample> take(const drivers::ReceivedFrame& received);
  [[nodiscard]] std::uint64_t incomplete() const { return incomplete_; }
  // Why no sample came of the frames so far.
  [[nodiscard]] std::string why_none() const;

 private:
  static constexpr std::size_t kCounter = 0, kRotation = 1, kRate = 2, kAcceleration = 3;
  void begin(const drivers::ReceivedFrame& counter);
  void fill(std::size_t quantity, const drivers::CanFrame& frame);

  MtCanIds ids_;
  std::optional<MtCanSample> group_;
  std::bitset<4> in_group_, seen_;
  std::uint64_t incomplete_ = 0;
};

// Which way is down? On a CAN bus the part does not say in which world it reckons, and one whose z axis points down
// would call a standing robot overturned. So nothing is believed before its accelerations have pointed upwards on
// average: at rest, or moving as robots do.
class GravityCheck {
 public:
  // True from the sample on that settles it.
  bool take(const MtSample& sample);
  // Why it is not settled; empty: too few samples so far.
  [[nodiscard]] const std::string& doubt() const { return doubt_; }

 private:
  static constexpr int kSamples = 100;
  static constexpr double kClear = 5;  // m/s^2, half of gravity
  bool settled_ = false;
  int samples_ = 0;
  double sum_ = 0;  // m/s^2, of specific forces along the world's z
  std::string doubt_;
};

}  // namespace takt::sensors

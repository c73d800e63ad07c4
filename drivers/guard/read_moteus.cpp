// SPDX-License-Identifier: Apache-2.0
// Sources: mjbots/mjlib mjlib/multiplex/format.h (subframes: write 00, read 10, no-op 50; type in bits 3..2, count in
// bits 1..0 or in the byte after), mjbots/moteus docs/protocol/registers.md (registers, steps of the integer types).
#include <array>
#include <cmath>
#include <limits>
#include <numbers>

#include "drivers/guard/decoders.hpp"
#include "drivers/guard/wire_bytes.hpp"

namespace takt::drivers::guard {
namespace {

constexpr std::uint8_t kNoOp = 0x50, kWrite = 0x00, kRead = 0x10;
constexpr float kNaN = std::numeric_limits<float>::quiet_NaN();

// The registers that we write, from the first on; everything else is unknown.
struct Written {
  float mode = -1;
  std::array<float, 6> command{kNaN, 0, 0, 1, 1, kNaN};  // 020..025, the firmware's values for what is not written
  float watchdog = 0;
  std::array<float, 2> trajectory{kNaN, kNaN};  // 028..029: velocity and acceleration limits
  bool is_known = true;
  bool mode_was_first = true;
};

float* place_of(Written& written, std::uint32_t reg) noexcept {
  if (reg == 0x000) return &written.mode;
  if (reg >= 0x020 && reg <= 0x025) return &written.command[reg - 0x020];
  if (reg == 0x027) return &written.watchdog;
  if (reg == 0x028 || reg == 0x029) return &written.trajectory[reg - 0x028];
  return nullptr;
}

// As we write them: floats, but for mode and trajectory limits, whose sign alone matters.
float value_at(const std::uint8_t* at, unsigned type) noexcept {
  if (type == 3) return little_float(at);
  return at[0] == 0x80 ? kNaN : static_cast<float>(static_cast<std::int8_t>(at[0]));
}

bool is_plain(std::uint32_t reg) noexcept {
  return reg == 0x000 || reg == 0x028 || reg == 0x029;
}

class Subframes {
 public:
  explicit Subframes(const CanFrame& frame) noexcept : at_(frame.data), end_(frame.data + frame.length) {}

  Written read() noexcept {
    Written written;
    while (at_ != end_ && written.is_known) {
      const std::uint8_t head = *at_++;
      if (head != kNoOp) written.is_known = take(head, written);
    }
    return written;
  }

 private:
  bool take(std::uint8_t head, Written& written) noexcept {
    std::size_t count = head & 3U;
    if (count == 0) {
      if (at_ == end_) return false;
      count = *at_++;
    }
    if (at_ == end_ || count == 0 || count > 16) return false;
    std::uint32_t first = *at_++;
    if (first > 0x7F) {
      if (at_ == end_ || *at_ > 0x7F) return false;
      first = (first & 0x7FU) | std::uint32_t{*at_++} << 7U;
    }
    if ((head & 0xF0U) == kRead) return true;
    return (head & 0xF0U) == kWrite && take_values(head >> 2U & 3U, first, count, written);
  }

  bool take_values(unsigned type, std::uint32_t first, std::size_t count, Written& written) noexcept {
    const std::size_t size = type == 3 ? 4 : 1;
    if ((type != 0 && type != 3) || static_cast<std::size_t>(end_ - at_) < size * count) return false;
    for (std::size_t i = 0; i < count; ++i, at_ += size) {
      const auto reg = static_cast<std::uint32_t>(first + i);
      float* const place = place_of(written, reg);
      if (place == nullptr || (type == 0 && !is_plain(reg))) return false;
      if (reg != 0x000 && written.mode < 0) written.mode_was_first = false;
      *place = value_at(at_, type);
    }
    return true;
  }

  const std::uint8_t* at_;
  const std::uint8_t* end_;
};

bool limits_a_trajectory(float limit) noexcept {
  return limit >= 0;  // negative and NaN: no limit
}

Duration duration_of(float seconds) noexcept {
  constexpr float kFarTooLong = 1e6F;
  // NaN switches the watchdog off, 0 means the drive's own setting: neither is ours to say.
  if (!(seconds > 0 && seconds < kFarTooLong)) return Duration{std::numeric_limits<std::int64_t>::max()};
  return {static_cast<std::int64_t>(static_cast<double>(seconds) * 1e9)};
}

Demand read_position_mode(const JointFacts& facts, const Written& written) noexcept {
  constexpr float kRadPerTurn = 2 * std::numbers::pi_v<float>;
  const auto& [position, velocity, torque, kp, kd, most] = written.command;
  if (limits_a_trajectory(written.trajectory[0]) || limits_a_trajectory(written.trajectory[1])) return {};
  // The firmware holds the kd scale down to the kp scale.
  const float kd_scale = kd < kp ? kd : kp;
  return {.kind = Demand::Kind::drive,
          .motion = to_joint(facts, {position * kRadPerTurn, velocity * kRadPerTurn, kp * facts.servo_kp,
                                     kd_scale * facts.servo_kd, torque}),
          .torque_most = most,
          .valid_for = duration_of(written.watchdog)};
}

}  // namespace

Demand read_moteus(const JointFacts& facts, const CanFrame& frame) noexcept {
  constexpr std::uint32_t kReplyWanted = 0x8000;
  if (!frame.extended || !frame.fd || frame.remote || frame.error || frame.length > sizeof frame.data) return {};
  if (frame.id != (kReplyWanted | facts.id)) return {};
  const Written written = Subframes(frame).read();
  if (!written.is_known || !written.mode_was_first) return {};
  if (written.mode == 10) return read_position_mode(facts, written);
  if (written.mode == 0) return of_kind(Demand::Kind::disable);
  return of_kind(written.mode == -1 ? Demand::Kind::aside : Demand::Kind::unknown);
}

}  // namespace takt::drivers::guard

// SPDX-License-Identifier: Apache-2.0
#include "simulation/mit_device.hpp"

#include <algorithm>
#include <array>
#include <cmath>
#include <numbers>

namespace takt::simulation {
namespace {

// Eight bytes, the first one the most significant.
std::uint64_t word_of(const std::uint8_t* data) {
  std::uint64_t word = 0;
  for (unsigned i = 0; i < 8; ++i) word |= std::uint64_t{data[i]} << (56 - 8 * i);
  return word;
}

// Bits [from, from + count), counted from the most significant one.
std::uint64_t bits(std::uint64_t word, unsigned from, unsigned count) {
  return word << from >> (64 - count);
}

double spread(std::uint64_t code, unsigned count, double low, double high) {
  return low + (high - low) * static_cast<double>(code) / (std::exp2(count) - 1);
}

// As the firmware: saturating, then cut off.
std::uint64_t squeeze(double value, unsigned count, double limit) {
  const double share = (std::clamp(value, -limit, limit) + limit) / (2 * limit);
  return static_cast<std::uint64_t>(share * (std::exp2(count) - 1));
}

std::uint8_t whole_degrees(double celsius) {
  return static_cast<std::uint8_t>(std::clamp(celsius, 0.0, 255.0));
}

}  // namespace

MitDevice::MitDevice(const config::Drive& drive, Duration watchdog)
    : id_(drive.id),
      reply_id_(drive.reply_id),
      damiao_(drive.variant == "damiao"),
      robstride_(drive.variant == "robstride"),
      fd_(drive.fd_bitrate != 0),
      kp_range_(drive.kp_range),
      kd_range_(drive.kd_range),
      torque_range_(drive.torque_range),
      worth_(drive.position_after_power_up),
      place_step_(worth_ == config::PositionAfterPowerUp::one_of_several
                      ? 2 * std::numbers::pi / drive.places_per_turn * drive.gear_ratio
                      : 2 * std::numbers::pi),
      registers_(drive, watchdog) {}

// CAN FD is the classic frame in another form, asked and answered in it.
bool MitDevice::is_for_us(const drivers::CanFrame& frame) const {
  const bool known = frame.id == id_ || (damiao_ && frame.id == DamiaoRegisterFile::kBusId);
  return known && !frame.extended && frame.fd == fd_ && !frame.remote && !frame.error && frame.length == 8;
}

drivers::CanFrame& MitDevice::reply(Frames& out, std::uint8_t length) const {
  drivers::CanFrame& frame = out.emplace_back();
  frame.id = reply_id_;
  frame.fd = frame.bit_rate_switch = fd_;
  frame.length = length;
  return frame;
}

void MitDevice::receive(const drivers::CanFrame& frame, MonoTime now, Frames& out) {
  if (!is_for_us(frame)) return;
  if (state_ == DeviceState::booting) return;
  if (damiao_ && frame.id == DamiaoRegisterFile::kBusId) answer_register(frame, out);
  if (frame.id != id_) return;
  report(out);
  obey(frame, now);
}

void MitDevice::answer_register(const drivers::CanFrame& frame, Frames& out) {
  if ((frame.data[0] | frame.data[1] << 8) != static_cast<int>(id_)) return;
  if (frame.data[2] == DamiaoRegisterFile::kRefresh) return report(out);
  std::array<std::uint8_t, 8> answer;
  const bool enabled = state_ == DeviceState::enabled;
  if (registers_.serve(std::span(frame.data).first<8>(), enabled, answer))
    std::ranges::copy(answer, reply(out, 8).data);
}

bool MitDevice::obeys_motion() const {
  return !damiao_ || registers_.is_in_mit_mode();
}

bool MitDevice::is_silent_for_too_long(MonoTime now) const {
  const Duration allowed = registers_.watchdog();
  return allowed.ns != 0 && now - commanded_at_ > allowed;
}

void MitDevice::obey(const drivers::CanFrame& frame, MonoTime now) {
  constexpr std::uint64_t kSevenFf = 0xFF'FFFF'FFFF'FFFF;
  const std::uint64_t word = word_of(frame.data);
  const std::uint8_t last = frame.data[7];
  if (bits(word, 0, 56) == kSevenFf && last >= 0xFB && last <= 0xFE) {
    obey_special(last, now);
    return;
  }
  constexpr std::uint64_t kSixFf = kSevenFf >> 8U;
  if (robstride_ && bits(word, 0, 48) == kSixFf) return;  // another mode, protocol or number
  if (!obeys_motion()) return;
  command_ = unpack(word);
  commanded_at_ = now;
}

void MitDevice::obey_special(std::uint8_t code, MonoTime now) {
  switch (code) {
    case 0xFB:
      if (damiao_ && (state_ == DeviceState::error || state_ == DeviceState::lost)) state_ = DeviceState::disabled;
      break;
    case 0xFC:
      if (state_ != DeviceState::disabled) break;
      state_ = DeviceState::enabled;
      command_ = {};
      commanded_at_ = now;
      break;
    case 0xFD:
      if (state_ == DeviceState::enabled || (state_ == DeviceState::lost && !damiao_)) state_ = DeviceState::disabled;
      break;
    case 0xFE:
      zero_ += reading_.position;
      reading_.position = 0;
      break;
    default:
      break;
  }
}

MitDevice::Command MitDevice::unpack(std::uint64_t word) const {
  const MitSpans& spans = registers_.spans();
  return {.p = spread(bits(word, 0, 16), 16, -spans.position, spans.position),
          .v = spread(bits(word, 16, 12), 12, -spans.velocity, spans.velocity),
          .kp = spread(bits(word, 28, 12), 12, 0, kp_range_),
          .kd = spread(bits(word, 40, 12), 12, 0, kd_range_),
          .t = spread(bits(word, 52, 12), 12, -spans.torque, spans.torque)};
}

double MitDevice::update(MotorReading reading, MonoTime now, Duration step, Frames& /*out*/) {
  if (!knows_place_) forget_place(reading.position);
  reading_ = {reading.position - zero_, reading.velocity};
  if (state_ == DeviceState::booting && now >= booted_at_) state_ = DeviceState::disabled;
  if (state_ == DeviceState::enabled && is_silent_for_too_long(now)) state_ = DeviceState::lost;
  double wanted = 0;
  switch (state_) {
    case DeviceState::enabled:
      wanted =
          command_.kp * (command_.p - reading_.position) + command_.kd * (command_.v - reading_.velocity) + command_.t;
      break;
    case DeviceState::lost:
      wanted = -kLostDamping * reading_.velocity;
      break;
    case DeviceState::booting:
    case DeviceState::disabled:
    case DeviceState::error:
      break;
  }
  torque_ = std::clamp(wanted, -torque_range_, torque_range_);
  winding_.update(torque_, torque_range_, step);
  return torque_;
}

// After power-on: the nearest of the places that its encoder cannot tell apart, or none but where it stands.
void MitDevice::forget_place(double position) {
  knows_place_ = true;
  switch (worth_) {
    case config::PositionAfterPowerUp::absolute:
      break;
    case config::PositionAfterPowerUp::unknown:
      zero_ = position;
      break;
    case config::PositionAfterPowerUp::one_of_several:
    case config::PositionAfterPowerUp::within_a_turn:
      zero_ += place_step_ * std::round((position - zero_) / place_step_);
      break;
  }
}

bool MitDevice::inject(DeviceFault fault) {
  const auto code = [&]() -> std::uint8_t {
    switch (fault) {
      case DeviceFault::over_temperature:
        return damiao_ ? 0xB : 1;
      case DeviceFault::over_current:
        return damiao_ ? 0xA : 2;
      case DeviceFault::over_voltage:
        return damiao_ ? 0x8 : 3;
      case DeviceFault::under_voltage:
        return damiao_ ? 0x9 : 4;
      case DeviceFault::encoder:
        return damiao_ ? 0 : 5;
      case DeviceFault::overload:
        return damiao_ ? 0xE : 0;
    }
    return 0;
  }();
  if (code == 0) return false;
  state_ = DeviceState::error;
  error_ = code;
  return true;
}

void MitDevice::power_cycle(MonoTime now) {
  state_ = DeviceState::booting;
  booted_at_ = now + kBootTime;
  registers_.restart();
  knows_place_ = false;
  command_ = {};
}

std::uint8_t MitDevice::status() const {
  switch (state_) {
    case DeviceState::booting:
    case DeviceState::disabled:
      return 0x0;
    case DeviceState::enabled:
      return 0x1;
    case DeviceState::lost:
      return 0xD;
    case DeviceState::error:
      return error_;
  }
  return 0x0;
}

void MitDevice::report(Frames& out) const {
  const MitSpans& spans = registers_.spans();
  const Telling said = tell(reading_, torque_);
  const std::uint64_t fields = squeeze(said.position, 16, spans.position) << 24U |
                               squeeze(said.velocity, 12, spans.velocity) << 12U |
                               squeeze(said.torque, 12, spans.torque);
  drivers::CanFrame& frame = reply(out, damiao_ || robstride_ ? 8 : 6);
  const std::uint32_t first = damiao_ ? (id_ & 0xFU) | std::uint32_t{status()} << 4U : id_;
  frame.data[0] = static_cast<std::uint8_t>(first);
  for (unsigned i = 0; i < 5; ++i) frame.data[1 + i] = static_cast<std::uint8_t>(fields >> (32 - 8 * i) & 0xFFU);
  add_temperatures(frame);
}

void MitDevice::add_temperatures(drivers::CanFrame& frame) const {
  if (damiao_) {
    frame.data[6] = whole_degrees(winding_.stage_C());
    frame.data[7] = whole_degrees(winding_.winding_C());
  }
  if (robstride_) {
    const auto tenths = static_cast<std::uint32_t>(std::clamp(10 * winding_.winding_C(), 0.0, 2000.0));
    frame.data[6] = static_cast<std::uint8_t>(tenths >> 8U);
    frame.data[7] = static_cast<std::uint8_t>(tenths & 0xFFU);
  }
}

}  // namespace takt::simulation

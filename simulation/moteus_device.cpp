// SPDX-License-Identifier: Apache-2.0
#include "simulation/moteus_device.hpp"

#include <algorithm>
#include <array>
#include <cstdio>
#include <cstring>
#include <numbers>
#include <string>

namespace takt::simulation {
namespace {

constexpr double kRev = 2 * std::numbers::pi;
constexpr std::array<unsigned, 4> kSize{1, 2, 4, 4};  // int8, int16, int32, float
constexpr unsigned kFloat = 3;

// Worth of one step of int8, int16, int32, by register (registers.md, "Mappings").
double step_of(unsigned reg, unsigned type) {
  constexpr std::array kPosition{0.01, 0.0001, 0.00001}, kVelocity{0.1, 0.00025, 0.00001}, kTorque{0.5, 0.01, 0.001},
      kVoltage{0.5, 0.1, 0.001}, kTemperature{1.0, 0.1, 0.001}, kTime{0.01, 0.001, 0.000001},
      kScale{1.0 / 127, 1.0 / 32767, 1.0 / 2147483647};
  switch (reg) {
    case 0x001:
    case 0x020:
      return kPosition[type];
    case 0x002:
    case 0x021:
      return kVelocity[type];
    case 0x003:
    case 0x022:
    case 0x025:
      return kTorque[type];
    case 0x00A:
    case 0x00E:
      return kTemperature[type];
    case 0x00D:
      return kVoltage[type];
    case 0x023:
    case 0x024:
      return kScale[type];
    case 0x027:
      return kTime[type];
    default:
      return 1;
  }
}

}  // namespace

// Reads past the end give nothing, for good.
class MoteusDevice::Bytes {
 public:
  explicit Bytes(const drivers::CanFrame& frame) : frame_(frame) {}
  std::optional<std::uint8_t> byte() { return at_ < frame_.length ? std::optional(frame_.data[at_++]) : std::nullopt; }
  std::optional<unsigned> varuint() {
    unsigned value = 0;
    for (unsigned shift = 0; shift < 28; shift += 7) {
      const auto next = byte();
      if (!next) return std::nullopt;
      value |= (*next & 0x7FU) << shift;
      if (*next < 0x80) return value;
    }
    return std::nullopt;
  }
  std::optional<double> value(unsigned reg, unsigned type) {
    std::uint32_t raw = 0;
    for (unsigned i = 0; i < kSize[type]; ++i) {
      const auto next = byte();
      if (!next) return std::nullopt;
      raw |= std::uint32_t{*next} << 8 * i;
    }
    if (type == kFloat) {
      float number = 0;
      std::memcpy(&number, &raw, sizeof number);
      return double{number};
    }
    const unsigned unused = 32 - 8 * kSize[type];
    const std::int32_t number = static_cast<std::int32_t>(raw << unused) >> unused;
    const std::int32_t lowest = static_cast<std::int32_t>(0x8000'0000U) >> unused;
    return number == lowest ? NAN : number * step_of(reg, type);
  }

 private:
  const drivers::CanFrame& frame_;
  unsigned at_ = 0;
};

void MoteusDevice::receive(const drivers::CanFrame& frame, MonoTime now, Frames& out) {
  const unsigned destination = frame.id & 0xFFU, source = frame.id >> 8U;
  if (frame.remote || frame.error || destination != drive_.id || source > 0xFF) return;
  if (state_ == DeviceState::booting) return;
  Bytes bytes(frame);
  drivers::CanFrame reply;
  bool mode_written = false;
  while (obey(bytes, reply, mode_written)) {
  }
  if (mode_written) commanded_at_ = now;
  if ((source & 0x80U) == 0 || reply.length == 0) return;
  reply.id = drive_.id << 8U | (source & 0x7FU);
  reply.extended = reply.id > 0x7FF;
  reply.fd = reply.bit_rate_switch = true;
  constexpr std::array kLegal{12, 16, 20, 24, 32, 48, 64};
  const int padded = reply.length <= 8 ? reply.length : *std::ranges::lower_bound(kLegal, int{reply.length});
  while (reply.length < padded) reply.data[reply.length++] = 0x50;
  out.push_back(reply);
}

// One subframe. False: the end, or invalid.
bool MoteusDevice::obey(Bytes& bytes, drivers::CanFrame& reply, bool& mode_written) {
  const auto head = bytes.byte();
  if (!head) return false;
  if (*head == 0x50) return true;
  if (*head >= 0x20) return false;
  const unsigned type = *head >> 2U & 3U;
  const auto count = (*head & 3U) != 0 ? std::optional(*head & 3U) : bytes.varuint();
  const auto first = bytes.varuint();
  if (!count || !first) return false;
  if ((*head & 0x10U) != 0) {
    answer(type, *first, *count, reply);
    return true;
  }
  for (unsigned i = 0; i < *count; ++i) {
    const auto value = bytes.value(*first + i, type);
    if (!value) return false;
    write(*first + i, *value, mode_written);
  }
  return true;
}

void MoteusDevice::write(unsigned reg, double value, bool& mode_written) {
  if (reg == 0x000 && std::isfinite(value)) {
    mode_written = true;
    write_mode(static_cast<int>(value));
    return;
  }
  if (reg == 0x131 && std::isfinite(value)) {
    zero_ = reading_.position - value * kRev;
    home_state_ = 2;
  }
  if (!mode_written) return;
  switch (reg) {
    case 0x020:
      command_.position = std::isnan(value) ? position() / kRev : value;
      break;
    case 0x021:
      command_.velocity = std::isnan(value) ? 0 : value;
      break;
    case 0x022:
      command_.torque = value;
      break;
    case 0x023:
      command_.kp_scale = value;
      break;
    case 0x024:
      command_.kd_scale = value;
      break;
    case 0x025:
      command_.max_torque = value;
      break;
    case 0x027:
      command_.watchdog_s = value;
      break;
    default:
      break;
  }
}

void MoteusDevice::write_mode(int mode) {
  command_ = {};
  if (mode == 0) {
    state_ = DeviceState::disabled;
    fault_ = 0;
  }
  if (mode == 10 && state_ == DeviceState::disabled) state_ = DeviceState::enabled;
}

// Of 24 hexadecimal digits the last eight are place 0.
double MoteusDevice::serial_word(unsigned place) const {
  std::string digits = drive_.identity;
  std::erase(digits, ':');
  if (digits.size() != 24) return place == 0 ? 4000.0 + drive_.id : 0x11;
  return static_cast<std::int32_t>(std::stoul(digits.substr(16 - 8 * place, 8), nullptr, 16));
}

double MoteusDevice::read(unsigned reg) const {
  if (reg >= 0x120 && reg <= 0x122) return serial_word(reg - 0x120);
  switch (reg) {
    case 0x100:
      return 0x11;
    case 0x101: {
      unsigned major = 0, minor = 3, micro = 8;
      std::sscanf(drive_.firmware.c_str(), "%u.%u.%u", &major, &minor, &micro);
      return major * 0x10000 + minor * 0x100 + micro;
    }
    case 0x000:
      return mode();
    case 0x001:
      return said().position / kRev;
    case 0x002:
      return said().velocity / kRev;
    case 0x003:
      return said().torque;
    case 0x00A:
      return winding_.winding_C();
    case 0x00C:
      return home_state_;
    case 0x00D:
      return kBusVoltage_V;
    case 0x00E:
      return winding_.stage_C();
    case 0x00F:
      return fault_;
    default:
      return 0;
  }
}

void MoteusDevice::answer(unsigned type, unsigned first, unsigned count, drivers::CanFrame& reply) const {
  const unsigned needed = 2 + (count > 3 ? 1U : 0U) + (first > 0x7F ? 1U : 0U) + count * kSize[type];
  if (count == 0 || count > 64 || first > 0x3FFF || reply.length + needed > 64) return;
  const auto put = [&reply](unsigned byte) { reply.data[reply.length++] = static_cast<std::uint8_t>(byte & 0xFFU); };
  put(0x20U | type << 2U | (count > 3 ? 0U : count));
  if (count > 3) put(count);
  if (first > 0x7F) put(0x80U | (first & 0x7FU));
  put(first > 0x7F ? first >> 7U : first);
  for (unsigned reg = first; reg < first + count; ++reg) {
    std::uint32_t raw = 0;
    if (type == kFloat) {
      const auto number = static_cast<float>(read(reg));
      std::memcpy(&raw, &number, sizeof raw);
    } else {
      const double most = std::exp2(8 * kSize[type] - 1) - 1;
      raw = static_cast<std::uint32_t>(
          static_cast<std::int32_t>(std::clamp(std::round(read(reg) / step_of(reg, type)), -most, most)));
    }
    for (unsigned i = 0; i < kSize[type]; ++i) put(raw >> 8 * i);
  }
}

double MoteusDevice::law() const {
  const double p = command_.position * kRev, v = command_.velocity * kRev;
  const double kd_scale = std::min(command_.kd_scale, command_.kp_scale);
  const double torque = command_.kp_scale * drive_.servo_kp * (p - position()) +
                        kd_scale * drive_.servo_kd * (v - reading_.velocity) + command_.torque;
  const double most = std::isfinite(command_.max_torque) ? std::max(command_.max_torque, 0.0) : drive_.torque_range;
  return std::isfinite(torque) ? std::clamp(torque, -most, most) : 0;
}

double MoteusDevice::update(MotorReading reading, MonoTime now, Duration step, Frames& /*out*/) {
  reading_ = reading;
  if (state_ == DeviceState::booting && now >= booted_at_) state_ = DeviceState::disabled;
  const double limit_s = command_.watchdog_s == 0 ? default_watchdog_.seconds() : command_.watchdog_s;
  // In the register's own precision, which has no exact hundredth.
  const bool expired = static_cast<float>((now - commanded_at_).seconds()) > static_cast<float>(limit_s);
  if (state_ == DeviceState::enabled && expired) state_ = DeviceState::lost;
  double wanted = 0;
  switch (state_) {
    case DeviceState::enabled:
      wanted = law();
      command_.position += command_.velocity * step.seconds();
      break;
    case DeviceState::lost:
      wanted = -kLostDamping * reading_.velocity;
      break;
    case DeviceState::booting:
    case DeviceState::disabled:
    case DeviceState::error:
      break;
  }
  torque_ = std::clamp(wanted, -drive_.torque_range, drive_.torque_range);
  winding_.update(torque_, drive_.torque_range, step);
  return torque_;
}

int MoteusDevice::mode() const {
  switch (state_) {
    case DeviceState::booting:
    case DeviceState::disabled:
      return 0;
    case DeviceState::enabled:
      return 10;
    case DeviceState::lost:
      return 11;
    case DeviceState::error:
      return 1;
  }
  return 0;
}

bool MoteusDevice::inject(DeviceFault fault) {
  const int code = [fault] {
    switch (fault) {
      case DeviceFault::over_temperature:
        return 38;
      case DeviceFault::over_current:
        return 33;
      case DeviceFault::over_voltage:
        return 34;
      case DeviceFault::under_voltage:
        return 40;
      case DeviceFault::encoder:
        return 35;
      case DeviceFault::overload:
        return 0;
    }
    return 0;
  }();
  if (code == 0) return false;
  fault_ = code;
  state_ = DeviceState::error;
  return true;
}

void MoteusDevice::power_cycle(MonoTime now) {
  *this = MoteusDevice(drive_, default_watchdog_, home_state_at_power_on_);
  state_ = DeviceState::booting;
  booted_at_ = now + kBootTime;
}

}  // namespace takt::simulation

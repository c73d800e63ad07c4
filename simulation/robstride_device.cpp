// SPDX-License-Identifier: Apache-2.0
#include "simulation/robstride_device.hpp"

#include <algorithm>
#include <bit>
#include <cmath>
#include <numbers>
#include <string>

namespace takt::simulation {
namespace {

enum Type : unsigned {
  kGetId = 0,
  kMotion = 1,
  kFeedback = 2,
  kEnable = 3,
  kStop = 4,
  kSetZero = 6,
  kRead = 17,
  kWrite = 18,
  kFaultReport = 21,
  kSave = 22
};

enum Parameter : std::uint16_t {
  kStoredTimeout = 0x200C,  // CyberGear
  kRunMode = 0x7005,
  kIqRef = 0x7006,
  kSpeedRef = 0x700A,
  kLimitTorque = 0x700B,
  kLocationRef = 0x7016,
  kLimitSpeed = 0x7017,
  kLimitCurrent = 0x7018,
  kMechanicalPosition = 0x7019,
  kMechanicalVelocity = 0x701B,
  kBusVoltage = 0x701C,
  kCanTimeout = 0x7028,  // RobStride, as the next one
  kZeroState = 0x7029
};

constexpr std::int64_t kTimeoutUnit_ns = 50'000;

// Bits of feedback.
constexpr std::uint8_t kUnderVoltage = 1, kOverCurrent = 2, kOverTemperature = 4, kMagneticEncoder = 8;

std::uint32_t bits_of(double value) {
  return std::bit_cast<std::uint32_t>(static_cast<float>(value));
}

double spread(unsigned code, double low, double high) {
  return low + (high - low) * code / 65535.0;
}

// As the firmware: saturating, then cut off.
unsigned squeeze(double value, double limit) {
  return static_cast<unsigned>((std::clamp(value, -limit, limit) + limit) / (2 * limit) * 65535);
}

unsigned pair(const std::uint8_t* data) {
  return unsigned{data[0]} * 256 + data[1];
}

void put_pair(std::uint8_t* data, unsigned value) {
  data[0] = static_cast<std::uint8_t>(value / 256 % 256);
  data[1] = static_cast<std::uint8_t>(value % 256);
}

void put_low_first(std::uint8_t* data, std::uint64_t value, int bytes) {
  for (int i = 0; i < bytes; ++i, value /= 256) data[i] = static_cast<std::uint8_t>(value % 256);
}

drivers::CanFrame make_frame(unsigned type, unsigned data, unsigned target) {
  drivers::CanFrame frame;
  frame.id = ((type * 0x10000 + data) * 0x100) + target;
  frame.extended = true;
  frame.length = 8;
  return frame;
}

}  // namespace

RobstrideDevice::RobstrideDevice(const config::Drive& drive, Duration watchdog)
    : drive_(drive),
      watchdog_(watchdog),
      host_(drive.host_id),
      saved_zero_state_(drive.position_after_power_up == config::PositionAfterPowerUp::absolute ? 1 : 0) {
  start_up();
}

void RobstrideDevice::start_up() {
  written_ = {{kRunMode, 0},
              {kIqRef, 0},
              {kSpeedRef, 0},
              {kLimitTorque, bits_of(drive_.torque_range)},
              {kLocationRef, 0},
              {kLimitSpeed, bits_of(2)},
              {kLimitCurrent, bits_of(23)}};
  if (is_cybergear())
    written_[kStoredTimeout] = static_cast<std::uint32_t>(watchdog_.ns / kTimeoutUnit_ns);
  else
    written_.insert({{kCanTimeout, 0}, {kZeroState, saved_zero_state_}});
  zero_ = saved_zero_;
  knows_place_ = false;
  faults_ = 0;
  report_due_ = false;
  command_ = {};
}

void RobstrideDevice::receive(const drivers::CanFrame& frame, MonoTime now, Frames& out) {
  const bool is_classic_data = frame.extended && !frame.fd && !frame.remote && !frame.error && frame.length == 8;
  if (!is_classic_data || frame.id % 0x100 != drive_.id || state_ == DeviceState::booting) return;
  const unsigned type = frame.id / 0x100'0000;
  const unsigned host = frame.id / 0x100 % 0x100;
  const auto index = static_cast<std::uint16_t>(frame.data[0] + 256 * frame.data[1]);
  if (type != kMotion) host_ = host;
  switch (type) {
    case kGetId:
      return out.push_back(identity());
    case kRead:
      if (const auto value = parameter(index))
        out.push_back(answer(index, *value));
      else if (!is_cybergear())
        out.push_back(refusal(index));
      return;
    case kMotion:
      move(frame, now);
      break;
    case kEnable:
      enable(now);
      break;
    case kStop:
      stop(frame.data[0] == 1);
      break;
    case kSetZero:
      if (frame.data[0] == 1) set_zero();
      break;
    case kWrite:
      write(frame);
      break;
    case kSave:
      save(frame);
      break;
    default:
      return;
  }
  out.push_back(feedback());
}

void RobstrideDevice::move(const drivers::CanFrame& frame, MonoTime now) {
  command_ = {.p = spread(pair(frame.data), -drive_.position_range, drive_.position_range),
              .v = spread(pair(frame.data + 2), -drive_.velocity_range, drive_.velocity_range),
              .kp = spread(pair(frame.data + 4), 0, drive_.kp_range),
              .kd = spread(pair(frame.data + 6), 0, drive_.kd_range),
              .t = spread(frame.id / 0x100 % 0x10000, -drive_.torque_range, drive_.torque_range)};
  commanded_at_ = now;
}

void RobstrideDevice::enable(MonoTime now) {
  if (state_ != DeviceState::disabled && state_ != DeviceState::lost) return;
  state_ = DeviceState::enabled;
  command_ = {};
  commanded_at_ = now;
}

void RobstrideDevice::stop(bool clear_faults) {
  if (clear_faults) faults_ = 0;
  state_ = faults_ == 0 ? DeviceState::disabled : DeviceState::error;
}

void RobstrideDevice::set_zero() {
  zero_ += reading_.position;
  reading_.position = 0;
}

void RobstrideDevice::write(const drivers::CanFrame& frame) {
  const auto found = written_.find(static_cast<std::uint16_t>(frame.data[0] + 256 * frame.data[1]));
  if (found == written_.end()) return;
  std::uint32_t value = 0;
  for (int i = 7; i >= 4; --i) value = value * 256 + frame.data[i];
  const bool is_byte = found->first == kRunMode || found->first == kZeroState;
  found->second = is_byte ? value % 256 : value;
}

void RobstrideDevice::save(const drivers::CanFrame& frame) {
  for (std::uint8_t i = 0; i < 8; ++i)
    if (frame.data[i] != i + 1) return;
  if (is_cybergear()) return;
  saved_zero_ = zero_;
  saved_zero_state_ = written_.at(kZeroState);
}

void RobstrideDevice::forget_place(double position) {
  constexpr double kWholeTurn = 2 * std::numbers::pi;
  knows_place_ = true;
  const double turns = (position - zero_) / kWholeTurn;
  const bool counts_from_zero = !is_cybergear() && written_.at(kZeroState) == 0;
  const double places = drive_.places_per_turn / drive_.gear_ratio;
  switch (drive_.position_after_power_up) {
    case config::PositionAfterPowerUp::absolute:
      break;
    case config::PositionAfterPowerUp::unknown:
      zero_ = position;
      break;
    case config::PositionAfterPowerUp::one_of_several:
      zero_ += kWholeTurn / places * std::round(turns * places);
      break;
    case config::PositionAfterPowerUp::within_a_turn:
      zero_ += kWholeTurn * (counts_from_zero ? std::floor(turns) : std::round(turns));
      break;
  }
}

std::optional<std::uint32_t> RobstrideDevice::parameter(std::uint16_t index) const {
  if (const auto found = written_.find(index); found != written_.end()) return found->second;
  if (index == kMechanicalPosition) return bits_of(tell(reading_, torque_).position);
  if (index == kMechanicalVelocity) return bits_of(tell(reading_, torque_).velocity);
  if (index == kBusVoltage) return bits_of(kBusVoltage_V);
  return std::nullopt;
}

bool RobstrideDevice::is_silent_for_too_long(MonoTime now) const {
  const std::int64_t allowed = written_.at(is_cybergear() ? kStoredTimeout : kCanTimeout) * kTimeoutUnit_ns;
  return allowed != 0 && (now - commanded_at_).ns > allowed;
}

double RobstrideDevice::update(MotorReading reading, MonoTime now, Duration step, Frames& out) {
  if (!knows_place_) forget_place(reading.position);
  reading_ = {reading.position - zero_, reading.velocity};
  if (state_ == DeviceState::booting && now >= booted_at_) state_ = DeviceState::disabled;
  if (state_ == DeviceState::enabled && is_silent_for_too_long(now)) state_ = DeviceState::lost;
  if (report_due_ && state_ != DeviceState::booting) out.push_back(fault_report());
  report_due_ = false;
  const double limit = std::min(drive_.torque_range, std::abs(double{std::bit_cast<float>(written_.at(kLimitTorque))}));
  torque_ = std::clamp(wanted_torque(), -limit, limit);
  winding_.update(torque_, drive_.torque_range, step);
  return torque_;
}

double RobstrideDevice::wanted_torque() const {
  switch (state_) {
    case DeviceState::enabled:
      if (written_.at(kRunMode) != 0) return 0;
      return command_.kp * (command_.p - reading_.position) + command_.kd * (command_.v - reading_.velocity) +
             command_.t;
    case DeviceState::lost:
      return -kLostDamping * reading_.velocity;
    case DeviceState::booting:
    case DeviceState::disabled:
    case DeviceState::error:
      break;
  }
  return 0;
}

bool RobstrideDevice::inject(DeviceFault fault) {
  const auto bit = [fault]() -> std::uint8_t {
    switch (fault) {
      case DeviceFault::under_voltage:
        return kUnderVoltage;
      case DeviceFault::over_current:
        return kOverCurrent;
      case DeviceFault::over_temperature:
        return kOverTemperature;
      case DeviceFault::encoder:
        return kMagneticEncoder;
      case DeviceFault::over_voltage:
      case DeviceFault::overload:
        return 0;
    }
    return 0;
  }();
  if (bit == 0 || state_ == DeviceState::booting) return false;
  faults_ |= bit;
  state_ = DeviceState::error;
  report_due_ = true;
  return true;
}

void RobstrideDevice::power_cycle(MonoTime now) {
  start_up();
  state_ = DeviceState::booting;
  booted_at_ = now + kBootTime;
}

drivers::CanFrame RobstrideDevice::feedback() const {
  const unsigned mode = state_ == DeviceState::enabled ? 2 : 0;
  drivers::CanFrame frame = make_frame(kFeedback, mode * 0x4000 + faults_ * 0x100U + drive_.id, host_);
  const Telling said = tell(reading_, torque_);
  put_pair(frame.data, squeeze(said.position, drive_.position_range));
  put_pair(frame.data + 2, squeeze(said.velocity, drive_.velocity_range));
  put_pair(frame.data + 4, squeeze(said.torque, drive_.torque_range));
  put_pair(frame.data + 6, static_cast<unsigned>(std::clamp(winding_.winding_C() * 10, 0.0, 32767.0)));
  return frame;
}

drivers::CanFrame RobstrideDevice::identity() const {
  drivers::CanFrame frame = make_frame(kGetId, drive_.id, 0xFE);
  std::string digits = drive_.identity;
  std::erase(digits, ':');
  if (digits.size() == 16)
    for (std::size_t i = 0; i < 8; ++i)
      frame.data[i] = static_cast<std::uint8_t>(std::stoul(digits.substr(2 * i, 2), nullptr, 16));
  else
    put_low_first(frame.data, 0x5441'4B54'0000'0000 + drive_.id, 8);
  return frame;
}

drivers::CanFrame RobstrideDevice::answer(std::uint16_t index, std::uint32_t value) const {
  drivers::CanFrame frame = make_frame(kRead, drive_.id, host_);
  put_low_first(frame.data, index, 2);
  put_low_first(frame.data + 4, value, 4);
  return frame;
}

drivers::CanFrame RobstrideDevice::refusal(std::uint16_t index) const {
  drivers::CanFrame frame = answer(index, 0);
  frame.id += 0x1'0000;
  return frame;
}

drivers::CanFrame RobstrideDevice::fault_report() const {
  // Bits of the report, which differ from feedback's: 0 hot motor, 2 under-voltage, 7 encoder, 16 current of phase A.
  std::uint64_t word = 0;
  if ((faults_ & kOverTemperature) != 0) word += 1U << 0U;
  if ((faults_ & kUnderVoltage) != 0) word += 1U << 2U;
  if ((faults_ & kMagneticEncoder) != 0) word += 1U << 7U;
  if ((faults_ & kOverCurrent) != 0) word += 1U << 16U;
  drivers::CanFrame frame = make_frame(kFaultReport, drive_.id, host_);
  put_low_first(frame.data, word, 8);
  return frame;
}

}  // namespace takt::simulation

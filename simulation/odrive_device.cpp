// SPDX-License-Identifier: Apache-2.0
#include "simulation/odrive_device.hpp"

#include <bit>
#include <cmath>
#include <cstdio>
#include <numbers>

namespace takt::simulation {
namespace {

constexpr double kTurn = 2 * std::numbers::pi;
constexpr std::uint32_t kMissingEstimate = 0x8, kBusOverVoltage = 0x100, kBusUnderVoltage = 0x200,
                        kCurrentLimit = 0x1000, kMotorOverTemperature = 0x2000, kWatchdogExpired = 0x0100'0000,
                        kEstopRequested = 0x0200'0000;
constexpr double kAmpere_per_Nm = 0.1;  // at the supply, of no consequence

// Eight bytes as one number, first byte lowest.
std::uint64_t word_of(const drivers::CanFrame& frame) {
  std::uint64_t word = 0;
  for (unsigned i = 0; i < 8 && i < frame.length; ++i) word |= std::uint64_t{frame.data[i]} << 8 * i;
  return word;
}

std::uint32_t low(std::uint64_t word) {
  return static_cast<std::uint32_t>(word & 0xFFFF'FFFFU);
}

std::uint64_t two(std::uint32_t first, std::uint32_t second) {
  return std::uint64_t{second} << 32U | first;
}

std::uint64_t two_floats(double first, double second) {
  return two(std::bit_cast<std::uint32_t>(static_cast<float>(first)),
             std::bit_cast<std::uint32_t>(static_cast<float>(second)));
}

}  // namespace

bool OdriveDevice::Clockwork::strikes(MonoTime now) {
  if (next.is_set() && now < next) return false;
  next = (next.is_set() ? next : now) + every;
  return true;
}

void OdriveDevice::receive(const drivers::CanFrame& frame, MonoTime now, Frames& out) {
  if (frame.extended || frame.fd || frame.id >> 5U != drive_.id || state_ == DeviceState::booting) return;
  if (!frame.remote) return obey(frame.id & 0x1FU, frame, now);
  if ((frame.id & 0x1FU) == 0) tell_version(out);
}

// Protocol 2; hardware 4.4, variant 58; firmware as the robot file wants it, else 0.6.10; released.
void OdriveDevice::tell_version(Frames& out) const {
  unsigned major = 0, minor = 6, revision = 10;
  std::sscanf(drive_.firmware.c_str(), "%u.%u.%u", &major, &minor, &revision);
  const std::uint32_t hardware = 2 | 4U << 8U | 4U << 16U | 58U << 24U;
  say(0x00, two(hardware, major | minor << 8U | revision << 16U), out);
}

void OdriveDevice::obey(std::uint32_t command, const drivers::CanFrame& frame, MonoTime now) {
  const std::uint64_t word = word_of(frame);
  switch (command) {
    case 0x02:
      fail(kEstopRequested, DeviceState::error);
      break;
    case 0x07:
      if (frame.length >= 4) request_state(low(word), now);
      break;
    case 0x0B:
      if (frame.length < 8) break;
      control_mode_ = low(word);
      input_mode_ = low(word >> 32U);
      break;
    case 0x0E:
      if (frame.length < 4) break;
      input_torque_ = std::bit_cast<float>(low(word));
      commanded_at_ = now;
      break;
    case 0x18:
      active_errors_ = disarm_reason_ = 0;
      if (state_ == DeviceState::error || state_ == DeviceState::lost) state_ = DeviceState::disabled;
      break;
    case 0x19:
      if (frame.length == 8 && origin_) set_position(double{std::bit_cast<float>(low(word))} * kTurn);
      break;
    default:
      break;
  }
}

void OdriveDevice::set_position(double here) {
  if (!std::isfinite(here)) return;
  origin_ = *origin_ + reading_.position - here;
  reading_.position = here;
}

void OdriveDevice::request_state(std::uint32_t state, MonoTime now) {
  if (state == 1 && state_ == DeviceState::enabled) {
    state_ = DeviceState::disabled;
    input_torque_ = 0;
  }
  if (state == 8 && state_ == DeviceState::disabled && active_errors_ == 0) {
    state_ = DeviceState::enabled;
    commanded_at_ = now;
  }
}

void OdriveDevice::fail(std::uint32_t error, DeviceState state) {
  active_errors_ |= error;
  disarm_reason_ = error;
  state_ = state;
  input_torque_ = 0;
}

double OdriveDevice::update(MotorReading reading, MonoTime now, Duration step, Frames& out) {
  if (!origin_)
    origin_ = drive_.position_after_power_up == config::PositionAfterPowerUp::unknown ? reading.position : 0;
  reading_ = {reading.position - *origin_, reading.velocity};
  if (state_ == DeviceState::booting && now >= booted_at_) state_ = DeviceState::disabled;
  if (state_ == DeviceState::enabled && now - commanded_at_ > watchdog_) fail(kWatchdogExpired, DeviceState::lost);
  double wanted = 0;
  switch (state_) {
    case DeviceState::enabled:
      if (control_mode_ == 1 && input_mode_ == 1 && std::isfinite(input_torque_)) wanted = double{input_torque_};
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
  if (state_ != DeviceState::booting) broadcast(now, out);
  return torque_;
}

void OdriveDevice::broadcast(MonoTime now, Frames& out) {
  const Telling said = tell(reading_, torque_);
  if (often_.strikes(now)) {
    const std::uint32_t axis_state = state_ == DeviceState::enabled ? 8 : 1;
    say(0x01, two(active_errors_, axis_state), out);
    say(0x1C, two_floats(static_cast<double>(input_torque_), said.torque), out);
  }
  if (estimates_.strikes(now)) say(0x09, two_floats(said.position / kTurn, said.velocity / kTurn), out);
  if (seldom_.strikes(now)) {
    say(0x15, two_floats(winding_.stage_C(), winding_.winding_C()), out);
    say(0x03, two(active_errors_, disarm_reason_), out);
    say(0x17, two_floats(kBusVoltage_V, std::abs(torque_) * kAmpere_per_Nm), out);
  }
}

void OdriveDevice::say(std::uint32_t command, std::uint64_t low_to_high, Frames& out) const {
  drivers::CanFrame frame;
  frame.id = drive_.id << 5U | command;
  frame.length = 8;
  for (unsigned i = 0; i < 8; ++i) frame.data[i] = static_cast<std::uint8_t>(low_to_high >> 8 * i & 0xFFU);
  out.push_back(frame);
}

bool OdriveDevice::inject(DeviceFault fault) {
  const auto error = [fault]() -> std::uint32_t {
    switch (fault) {
      case DeviceFault::over_temperature:
        return kMotorOverTemperature;
      case DeviceFault::over_current:
        return kCurrentLimit;
      case DeviceFault::over_voltage:
        return kBusOverVoltage;
      case DeviceFault::under_voltage:
        return kBusUnderVoltage;
      case DeviceFault::encoder:
        return kMissingEstimate;
      case DeviceFault::overload:
        return 0;
    }
    return 0;
  }();
  if (error == 0) return false;
  fail(error, DeviceState::error);
  return true;
}

void OdriveDevice::power_cycle(MonoTime now) {
  *this = OdriveDevice(drive_, watchdog_);
  state_ = DeviceState::booting;
  booted_at_ = now + kBootTime;
}

}  // namespace takt::simulation

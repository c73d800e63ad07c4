// SPDX-License-Identifier: Apache-2.0
#include "simulation/cia402_device.hpp"

#include <algorithm>
#include <cmath>
#include <numbers>

namespace takt::simulation {
namespace {

// Velocity loop: full torque at this joint-side error, and integrating; position loop around it, slower.
constexpr double kFullTorqueError = 2;              // rad/s
constexpr double kPosition = 8, kIntegral = 8;      // 1/s
constexpr std::uint8_t kCommunicationError = 0x11;  // bits of object 1001
constexpr std::uint8_t kMotionError = 0x21;         // likewise

std::uint32_t little_endian(const std::uint8_t* data, unsigned bytes) {
  std::uint32_t value = 0;
  for (unsigned i = bytes; i > 0; --i) value = value << 8U | data[i - 1];
  return value;
}

void append(drivers::CanFrame& frame, std::uint32_t value, unsigned bytes) {
  for (; bytes > 0; --bytes, value >>= 8U) frame.data[frame.length++] = static_cast<std::uint8_t>(value & 0xFFU);
}

// Negative numbers wrap, as a counter in the drive does.
std::uint32_t whole(double value) {
  return static_cast<std::uint32_t>(static_cast<std::int64_t>(std::llround(value)));
}

template <typename Integer>
double signed_value(const Cia402Objects& objects, std::uint16_t index) {
  return static_cast<Integer>(objects.value(index));
}

struct ErrorCode {
  std::uint16_t code;
  std::uint8_t error_register;
};

}  // namespace

Cia402Device::Cia402Device(const config::Drive& drive, Duration watchdog)
    : Cia402Device(drive, watchdog, profile_of(drive)) {}

Cia402Device::Cia402Device(const config::Drive& drive, Duration watchdog, const Cia402Profile& profile)
    : drive_(drive),
      profile_(profile),
      objects_(drive, static_cast<std::uint16_t>(std::clamp<std::int64_t>(watchdog.ns / 1'000'000, 0, 0xFFFF)),
               profile) {}

void Cia402Device::receive(const drivers::CanFrame& frame, MonoTime now, Frames& out) {
  if (nmt_ == Nmt::booting || frame.extended || frame.fd || frame.remote || frame.error) return;
  const bool operational = nmt_ == Nmt::operational;
  if (frame.id == 0x000)
    obey_nmt(frame, now);
  else if (frame.id == 0x080 && operational)
    synchronise(out);
  else if (frame.id == 0x600 + drive_.id && nmt_ != Nmt::stopped)
    serve_sdo(frame, out);
  else if (frame.id > 0x700 && frame.id < 0x780)
    hear_heartbeat(frame, now);
  else if (operational && objects_.pdo_exists(0x1400) && frame.id == objects_.pdo_id(0x1400))
    take_rpdo(frame, now, out);
}

void Cia402Device::obey_nmt(const drivers::CanFrame& frame, MonoTime now) {
  if (frame.length != 2 || (frame.data[1] != 0 && frame.data[1] != drive_.id)) return;
  switch (frame.data[0]) {
    case 1:
      if (nmt_ != Nmt::operational) commanded_at_.reset();
      nmt_ = Nmt::operational;
      break;
    case 2:
      leave_operational(Nmt::stopped);
      break;
    case 128:
      leave_operational(Nmt::pre_operational);
      break;
    case 129:
      power_cycle(now);
      break;
    case 130:
      leave_operational(Nmt::booting);
      objects_.reset_communication();
      booted_at_ = now + kBootTime;
      break;
    default:
      break;
  }
}

void Cia402Device::leave_operational(Nmt next) {
  if (nmt_ == Nmt::operational && power_.enabled()) trip(0x8100, kCommunicationError, true);
  nmt_ = next;
  pending_rpdo_.reset();
}

void Cia402Device::serve_sdo(const drivers::CanFrame& frame, Frames& out) {
  if (frame.length != 8 || frame.data[0] == 0x80) return;
  const auto index = static_cast<std::uint16_t>(little_endian(frame.data + 1, 2));
  const std::uint8_t sub = frame.data[3];
  if ((frame.data[0] & 0xEFU) == 0x60) return out.push_back(next_segment(frame.data[0]));
  segments_.reset();
  if (frame.data[0] == 0x40 && index == 0x100A && !profile_.software.empty()) return out.push_back(start_text(sub));
  SdoAbort why = SdoAbort::unknown_command;
  std::uint8_t answer = 0x60;
  std::uint32_t value = 0;
  switch (frame.data[0]) {
    case 0x40:
      why = objects_.why_not_readable(index, sub);
      refresh_objects();
      if (why != SdoAbort::none) break;
      value = objects_.value(index, sub);
      answer = static_cast<std::uint8_t>(0x4F - 4 * (objects_.at(index, sub).bytes - 1));
      break;
    case 0x22:  // a write that does not tell its size
      why = objects_.write(index, sub, little_endian(frame.data + 4, 4), 0, nmt_ == Nmt::operational);
      break;
    case 0x23:
    case 0x27:
    case 0x2B:
    case 0x2F: {
      const unsigned bytes = 4U - (frame.data[0] >> 2U & 3U);
      why = objects_.write(index, sub, little_endian(frame.data + 4, bytes), bytes, nmt_ == Nmt::operational);
      break;
    }
    default:
      break;
  }
  show_mode();
  if (why != SdoAbort::none) {
    answer = 0x80;
    value = static_cast<std::uint32_t>(why);
  }
  out.push_back(sdo_answer(answer, index, sub, value));
}

drivers::CanFrame Cia402Device::sdo_answer(std::uint8_t command, std::uint16_t index, std::uint8_t sub,
                                           std::uint32_t value) const {
  drivers::CanFrame reply;
  reply.id = 0x580 + drive_.id;
  append(reply, command, 1);
  append(reply, index, 2);
  append(reply, sub, 1);
  append(reply, value, 4);
  return reply;
}

// Its size; whatever that is, in segments.
drivers::CanFrame Cia402Device::start_text(std::uint8_t sub) {
  if (sub != 0) return sdo_answer(0x80, 0x100A, sub, static_cast<std::uint32_t>(SdoAbort::no_such_sub_index));
  segments_ = 0;
  return sdo_answer(0x41, 0x100A, 0, static_cast<std::uint32_t>(profile_.software.size()));
}

drivers::CanFrame Cia402Device::next_segment(std::uint8_t command) {
  constexpr std::uint32_t kToggle = 0x0503'0000, kUnknownCommand = 0x0504'0001;
  if (!segments_) return sdo_answer(0x80, 0, 0, kUnknownCommand);
  const bool toggle = (command & 0x10U) != 0;
  if (toggle != (*segments_ % 2 != 0)) {
    segments_.reset();
    return sdo_answer(0x80, 0x100A, 0, kToggle);
  }
  const std::string_view rest = profile_.software.substr(7 * *segments_);
  const std::string_view letters = rest.substr(0, 7);
  const bool last = rest.size() <= 7;
  drivers::CanFrame reply;
  reply.id = 0x580 + drive_.id;
  append(reply, static_cast<std::uint32_t>((toggle ? 0x10 : 0) | (7 - static_cast<int>(letters.size())) << 1 | last),
         1);
  for (const char letter : letters) append(reply, static_cast<std::uint8_t>(letter), 1);
  reply.length = 8;
  ++*segments_;
  if (last) segments_.reset();
  return reply;
}

void Cia402Device::show_mode() {
  if (profile_.shows_mode) objects_.set(0x6061, objects_.value(0x6060));
}

void Cia402Device::hear_heartbeat(const drivers::CanFrame& frame, MonoTime now) {
  if (!objects_.has(0x1016, 1) || frame.length != 1) return;
  const std::uint32_t watched = objects_.value(0x1016, 1);
  if (frame.id == 0x700 + (watched >> 16 & 0x7F) && (watched & 0xFFFF) != 0) host_heard_at_ = now;
}

void Cia402Device::watch_heartbeat(MonoTime now) {
  if (!host_heard_at_ || now - *host_heard_at_ <= milliseconds(objects_.value(0x1016, 1) & 0xFFFF)) return;
  host_heard_at_.reset();
  if (objects_.value(0x6007) != 0) trip(0x8130, kCommunicationError, true);
}

void Cia402Device::take_rpdo(const drivers::CanFrame& frame, MonoTime now, Frames& out) {
  unsigned bytes = 0;
  for (const MappedObject& object : objects_.pdo_map(0x1400)) bytes += object.bytes;
  if (frame.length < bytes) return trip(0x8210, kCommunicationError, false);
  commanded_at_ = now;
  if (objects_.value(0x1400, 2) <= 240)
    pending_rpdo_ = frame;
  else
    take_over(frame, out);
}

void Cia402Device::take_over(const drivers::CanFrame& rpdo, Frames& out) {
  const std::uint8_t* data = rpdo.data;
  for (const MappedObject& object : objects_.pdo_map(0x1400)) {
    const std::uint32_t value = little_endian(data, object.bytes);
    data += object.bytes;
    // A value that the object does not take stays out; a PDO has no answer to say so.
    objects_.write(object.index, object.sub, value, object.bytes, true);
  }
  show_mode();
  const bool was_faulty = power_.faulty(), was_enabled = power_.enabled();
  power_.obey(static_cast<std::uint16_t>(objects_.value(0x6040)));
  if (!was_enabled && power_.enabled()) velocity_integral_ = 0;
  if (!was_faulty || power_.faulty()) return;
  lost_ = false;
  note_error(0, 0);  // "no error" is an emergency message too
  say_emergencies(out);
}

void Cia402Device::synchronise(Frames& out) {
  const std::uint32_t type = objects_.value(0x1800, 2);
  if (objects_.pdo_exists(0x1800) && type >= 1 && type <= 240) {
    refresh_objects();
    drivers::CanFrame tpdo;
    tpdo.id = objects_.pdo_id(0x1800);
    for (const MappedObject& object : objects_.pdo_map(0x1800))
      append(tpdo, objects_.value(object.index, object.sub), object.bytes);
    out.push_back(tpdo);
  }
  if (!pending_rpdo_) return;
  const drivers::CanFrame rpdo = *pending_rpdo_;
  pending_rpdo_.reset();
  take_over(rpdo, out);
}

void Cia402Device::trip(std::uint16_t code, std::uint8_t error_register, bool lost) {
  note_error(code, error_register);
  power_.trip();
  lost_ = lost;
}

void Cia402Device::note_error(std::uint16_t code, std::uint8_t error_register) {
  drivers::CanFrame emergency;
  emergency.id = 0x080 + drive_.id;
  append(emergency, code, 2);
  append(emergency, error_register, 1);
  emergency.length = 8;
  emergencies_.push_back(emergency);
  objects_.set(0x603F, code);
  objects_.set(0x1001, error_register);
}

double Cia402Device::update(MotorReading reading, MonoTime now, Duration step, Frames& out) {
  if (!origin_)
    origin_ = drive_.position_after_power_up == config::PositionAfterPowerUp::unknown ? reading.position : 0;
  reading_ = {reading.position - *origin_, reading.velocity};
  if (nmt_ == Nmt::booting && now >= booted_at_) {
    nmt_ = Nmt::pre_operational;
    heartbeat_at_ = now;
    out.push_back(heartbeat(0));
  }
  power_.settle();
  watch_commands(now);
  watch_heartbeat(now);
  watch_following(now);
  say_emergencies(out);
  say_heartbeat(now, out);
  const double wanted = wanted_torque(step), most = most_torque();
  limited_ = power_.enabled() && std::abs(wanted) > most;
  torque_ = std::clamp(wanted, -most, most);
  return torque_;
}

double Cia402Device::most_torque() const {
  if (!objects_.has(0x6072)) return drive_.torque_range;
  return std::min(drive_.torque_range, objects_.value(0x6072) / 1000.0 * drive_.rated_torque);
}

void Cia402Device::watch_commands(MonoTime now) {
  const Duration deadline = milliseconds(objects_.has(0x1400, 5) ? objects_.value(0x1400, 5) : 0);
  if (!power_.enabled() || !commanded_at_ || deadline.ns == 0) return;
  if (now - *commanded_at_ > deadline) trip(0x8250, kCommunicationError, true);
}

// Object 6065: how far from its target a drive in position mode may be, in counts, and 6066 for how long, in ms.
void Cia402Device::watch_following(MonoTime now) {
  constexpr std::uint32_t kPositionMode = 8, kUnwatched = 0xFFFF'FFFF;
  const std::uint32_t window = objects_.has(0x6065) ? objects_.value(0x6065) : kUnwatched;
  const double rad_per_count = 2 * std::numbers::pi / drive_.counts_per_turn;
  const double target = static_cast<std::int32_t>(objects_.value(0x607A)) * rad_per_count;
  const bool follows = !power_.enabled() || objects_.value(0x6061) != kPositionMode || window == kUnwatched ||
                       std::abs(target - reading_.position) <= window * rad_per_count;
  if (follows) return behind_since_.reset();
  if (!behind_since_) behind_since_ = now;
  if (now - *behind_since_ >= milliseconds(objects_.value(0x6066))) trip(0x8611, kMotionError, false);
}

void Cia402Device::say_emergencies(Frames& out) {
  if (nmt_ != Nmt::operational && nmt_ != Nmt::pre_operational) return;
  out.insert(out.end(), emergencies_.begin(), emergencies_.end());
  emergencies_.clear();
}

void Cia402Device::say_heartbeat(MonoTime now, Frames& out) {
  const Duration period = milliseconds(objects_.value(0x1017));
  if (nmt_ == Nmt::booting || period.ns == 0 || now - heartbeat_at_ < period) return;
  heartbeat_at_ = now;
  switch (nmt_) {
    case Nmt::booting:
      break;
    case Nmt::pre_operational:
      out.push_back(heartbeat(127));
      break;
    case Nmt::operational:
      out.push_back(heartbeat(5));
      break;
    case Nmt::stopped:
      out.push_back(heartbeat(4));
      break;
  }
}

drivers::CanFrame Cia402Device::heartbeat(std::uint8_t state) const {
  drivers::CanFrame frame;
  frame.id = 0x700 + drive_.id;
  append(frame, state, 1);
  return frame;
}

void Cia402Device::refresh_objects() {
  const double counts_per_rad = drive_.counts_per_turn / (2 * std::numbers::pi);
  constexpr std::uint32_t kLimited = 0x0800, kFollows = 0x1000;
  const std::uint32_t word = power_.statusword() | (limited_ ? kLimited : 0U);
  objects_.set(0x6041, profile_.follows ? word : word & ~kFollows);
  const Telling said = tell(reading_, torque_);
  objects_.set(0x6064, whole(said.position * counts_per_rad));
  const double speed_counts =
      profile_.speed_counts > 0 ? profile_.speed_counts / (2 * std::numbers::pi) : counts_per_rad;
  objects_.set(0x606C, whole(said.velocity * speed_counts));
  objects_.set(0x6077, whole(said.torque / drive_.rated_torque * 1000) & 0xFFFFU);
}

double Cia402Device::wanted_torque(Duration step) {
  if (!power_.enabled()) return lost_ ? -kLostDamping * reading_.velocity : 0;
  const double rad_per_count = 2 * std::numbers::pi / drive_.counts_per_turn;
  const double rad_per_speed_count =
      profile_.speed_counts > 0 ? 2 * std::numbers::pi / profile_.speed_counts : rad_per_count;
  switch (objects_.value(0x6061)) {
    case 8: {
      const double target = signed_value<std::int32_t>(objects_, 0x607A) * rad_per_count;
      return torque_for_velocity(kPosition * (target - reading_.position), step);
    }
    case 9:
      return torque_for_velocity(signed_value<std::int32_t>(objects_, 0x60FF) * rad_per_speed_count, step);
    case 10:
      return signed_value<std::int16_t>(objects_, 0x6071) / 1000 * drive_.rated_torque;
    default:
      return 0;
  }
}

double Cia402Device::torque_for_velocity(double velocity, Duration step) {
  const double gain = drive_.torque_range / (kFullTorqueError * drive_.gear_ratio);
  const double error = velocity - reading_.velocity;
  const double torque = gain * error + velocity_integral_;
  // Saturated, the integral waits: it would only overshoot.
  if (std::abs(torque) < drive_.torque_range) velocity_integral_ += kIntegral * gain * error * step.seconds();
  return torque;
}

DeviceState Cia402Device::state() const {
  if (nmt_ == Nmt::booting) return DeviceState::booting;
  if (power_.faulty()) return lost_ ? DeviceState::lost : DeviceState::error;
  return power_.enabled() ? DeviceState::enabled : DeviceState::disabled;
}

bool Cia402Device::inject(DeviceFault fault) {
  const auto error = [fault]() -> ErrorCode {
    switch (fault) {
      case DeviceFault::over_temperature:
        return {0x4310, 0x09};
      case DeviceFault::over_current:
        return {0x2310, 0x03};
      case DeviceFault::over_voltage:
        return {0x3110, 0x05};
      case DeviceFault::under_voltage:
        return {0x3120, 0x05};
      case DeviceFault::encoder:
        return {0x7305, 0x21};
      case DeviceFault::overload:
        return {0x2350, 0x03};
    }
    return {0x1000, 0x01};
  }();
  trip(error.code, error.error_register, false);
  return true;
}

void Cia402Device::power_cycle(MonoTime now) {
  objects_.reset();
  power_.reset();
  nmt_ = Nmt::booting;
  booted_at_ = now + kBootTime;
  lost_ = false;
  pending_rpdo_.reset();
  commanded_at_.reset();
  host_heard_at_.reset();
  origin_.reset();
  emergencies_.clear();
  velocity_integral_ = torque_ = 0;
}

}  // namespace takt::simulation

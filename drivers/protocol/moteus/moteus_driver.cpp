// SPDX-License-Identifier: Apache-2.0
#include "drivers/protocol/moteus/moteus_driver.hpp"

#include <algorithm>
#include <array>
#include <cmath>
#include <numbers>

#include "config/turns.hpp"
#include "drivers/protocol/drive_timeout.hpp"
#include "drivers/protocol/little_endian.hpp"

namespace takt::drivers {
namespace {

constexpr float kRadPerRev = 2 * std::numbers::pi_v<float>;
constexpr std::uint32_t kReplyWanted = 0x8000;

bool is_positive(double x) {
  return std::isfinite(x) && x > 0;
}

void write_mode(std::uint8_t mode, MoteusWriter& writer) noexcept {
  const std::array value{static_cast<float>(mode)};
  writer.write(MoteusType::int8, MoteusRegister::mode, value);
}

constexpr float kReferencedToOutput = 2;  // of register 00C

void write_identity_query(MoteusWriter& writer) noexcept {
  writer.read(MoteusType::int32, MoteusRegister::model_number, 2);  // and firmware version
  writer.read(MoteusType::int32, MoteusRegister::serial_number, 3);
}

void write_query(MoteusWriter& writer, bool with_home) noexcept {
  writer.read(MoteusType::int8, MoteusRegister::mode, 1);
  writer.read(MoteusType::float32, MoteusRegister::position, 3);                        // and velocity, torque
  writer.read(MoteusType::int8, MoteusRegister::temperature, 2);                        // and fault
  writer.read(MoteusType::int8, MoteusRegister::motor_temperature, with_home ? 3 : 1);  // to home state
}

struct Reply {
  float mode = NAN, position = NAN, velocity = NAN, torque = NAN, temperature = 0, motor_temperature = 0, fault = 0,
        home = NAN;
  bool tells_position = false;  // as a number or not
};

// Registers that were not asked for are passed over.
void sort_in(const MoteusReader::Value& one, Reply& reply) noexcept {
  const auto reg = static_cast<MoteusRegister>(one.reg);
  if (reg == MoteusRegister::mode) reply.mode = one.value;
  if (reg == MoteusRegister::position) {
    reply.position = one.value;
    reply.tells_position = true;
  }
  if (reg == MoteusRegister::velocity) reply.velocity = one.value;
  if (reg == MoteusRegister::torque) reply.torque = one.value;
  if (reg == MoteusRegister::temperature) reply.temperature = one.value;
  if (reg == MoteusRegister::motor_temperature) reply.motor_temperature = one.value;
  if (reg == MoteusRegister::fault) reply.fault = one.value;
  if (reg == MoteusRegister::home_state) reply.home = one.value;
}

// int8 registers whose step is 1.
float plain_int8(std::uint8_t byte) noexcept {
  return byte == 0x80 ? NAN : static_cast<float>(static_cast<std::int8_t>(byte));
}

// The reply to write_query() as the firmware lays it out: read in place, three times as fast as by the reader, which
// takes every other layout.
bool is_usual(const CanFrame& frame) noexcept {
  const std::uint8_t* const at = frame.data;
  return frame.length == 24 && at[0] == 0x21 && at[1] == 0x00 && at[3] == 0x2F && at[4] == 0x01 && at[17] == 0x22 &&
         at[18] == 0x0E && at[21] == 0x21 && at[22] == 0x0A;
}

Reply read_usual(const std::uint8_t* at) noexcept {
  return {.mode = plain_int8(at[2]),
          .position = get_f32(at + 5),
          .velocity = get_f32(at + 9),
          .torque = get_f32(at + 13),
          .temperature = plain_int8(at[19]),
          .motor_temperature = plain_int8(at[23]),
          .fault = plain_int8(at[20]),
          .home = NAN,
          .tells_position = true};
}

// False: no whole reply.
bool parse(const CanFrame& frame, Reply& reply) noexcept {
  if (frame.remote || frame.error || frame.length > sizeof frame.data) return false;
  if (is_usual(frame)) {
    reply = read_usual(frame.data);
    return std::isfinite(reply.mode);
  }
  MoteusReader reader(std::span(frame.data, frame.length));
  for (MoteusReader::Value value; reader.next(value);) sort_in(value, reply);
  return !reader.malformed() && std::isfinite(reply.mode);
}

float hotter(float a, float b) noexcept {
  return std::max(std::isfinite(a) ? a : 0.0F, std::isfinite(b) ? b : 0.0F);
}

struct Verdict {
  DriveState state = DriveState::unknown;
  std::uint32_t code = 0;
};

Verdict judge(const Reply& reply) noexcept {
  if (reply.mode == kMoteusPosition) return {DriveState::enabled};
  if (reply.mode == kMoteusTimeout) return {DriveState::fault, kMoteusTimeout};
  if (reply.mode != kMoteusFault) return {DriveState::disabled};
  const bool named = reply.fault > 0 && reply.fault < 96;
  return {DriveState::fault, named ? static_cast<std::uint32_t>(reply.fault) : kMoteusFault};
}

}  // namespace

std::size_t MoteusDriver::encode(bool enable, const DriveSetpoint& setpoint, MonoTime now, MonoTime valid_until,
                                 std::span<CanFrame> out) noexcept {
  advance(enable);
  const Duration budget = valid_until.is_set() ? valid_until - now : Duration{};
  CanFrame& frame = out[0];
  frame = {};
  frame.id = kReplyWanted | settings_.id;
  frame.extended = frame.fd = frame.bit_rate_switch = true;
  MoteusWriter writer(frame.data);
  switch (phase_) {
    case Phase::disabling:
      write_mode(kMoteusStopped, writer);
      break;
    case Phase::enabling:
      write_command(limp(), budget, writer);
      break;
    case Phase::driving:
      write_command(command_for(setpoint), budget, writer);
      break;
    case Phase::left:
      if (feedback_.drive_state == DriveState::enabled) write_mode(kMoteusStopped, writer);
      break;
  }
  write_query(writer, phase_ == Phase::disabling);
  if (phase_ == Phase::disabling && is_time_to_ask()) write_identity_query(writer);
  frame.length = static_cast<std::uint8_t>(writer.finish());
  return 1;
}

// A drive that was asked often enough is left in peace, unless the robot file wants to know. One that was silent may
// be another than before.
bool MoteusDriver::is_time_to_ask() noexcept {
  if (++silent_ticks_ == kTicksToDoubt) {
    assumed_home_.forget();
    identity_.reset();
    firmware_.reset();
    asks_ = 0;
    ticks_to_ask_ = kTicksPerAsk;
  }
  const bool told = identity_ && firmware_;
  const bool wanted = settings_.identity.count + settings_.firmware.count != 0;
  if (told || (asks_ == kAsksForIdentity && !wanted) || silent_ticks_ >= kTicksToDoubt) return false;
  if (ticks_to_ask_ > 0) {
    --ticks_to_ask_;
    return false;
  }
  ticks_to_ask_ = kTicksPerAsk - 1;
  if (asks_ < kAsksForIdentity) ++asks_;
  return true;
}

std::uint32_t MoteusDriver::setup_error() const noexcept {
  const auto about = [](SetupFault fault, MoteusRegister which) {
    return setup_fault_code(fault, static_cast<std::uint32_t>(which));
  };
  if (contradicts(settings_.firmware, firmware_))
    return about(SetupFault::settings_differ, MoteusRegister::firmware_version);
  if (contradicts(settings_.identity, identity_))
    return about(SetupFault::settings_differ, MoteusRegister::serial_number);
  if (!knows_home_ && !assumed_home_.known()) return about(SetupFault::home_unknown, MoteusRegister::home_state);
  if (asks_ < kAsksForIdentity || may_enable()) return 0;
  const bool no_firmware = settings_.firmware.count != 0 && !firmware_;
  return about(SetupFault::settings_unread,
               no_firmware ? MoteusRegister::firmware_version : MoteusRegister::serial_number);
}

bool MoteusDriver::may_enable() const noexcept {
  return (knows_home_ || assumed_home_.known()) && is_set_up();
}

bool MoteusDriver::is_set_up() const noexcept {
  const auto is_so = [](const DriveWords& expected, const std::optional<DriveWords>& told) {
    return expected.count == 0 || (told && agrees(expected, *told));
  };
  return is_so(settings_.identity, identity_) && is_so(settings_.firmware, firmware_);
}

MoteusFacts decode_moteus_facts(const CanFrame& frame) noexcept {
  MoteusFacts facts;
  if (frame.remote || frame.error || frame.length > sizeof frame.data || is_usual(frame)) return facts;
  constexpr auto kFirst = static_cast<std::uint32_t>(MoteusRegister::serial_number);
  DriveWords serial{.word = {}, .count = 3};
  MoteusReader reader(std::span(frame.data, frame.length));
  for (MoteusReader::Value value; reader.next(value);) {
    if (value.reg == static_cast<std::uint32_t>(MoteusRegister::model_number)) facts.model = value.integer;
    if (value.reg == static_cast<std::uint32_t>(MoteusRegister::firmware_version))
      facts.firmware = DriveWords{{value.integer}, 1};
    if (value.reg == static_cast<std::uint32_t>(MoteusRegister::home_state) && value.value >= 0)
      facts.home = static_cast<std::uint32_t>(value.value);
    if (value.reg < kFirst || value.reg > kFirst + 2) continue;
    serial.word[kFirst + 2 - value.reg] = value.integer;
    if (value.reg == kFirst + 2) facts.serial_number = serial;
  }
  return reader.malformed() ? MoteusFacts{} : facts;
}

void MoteusDriver::advance(bool enable) noexcept {
  if (!enable) {
    phase_ = Phase::disabling;
    return;
  }
  const DriveState state = feedback_.drive_state;
  switch (phase_) {
    case Phase::disabling:
      if (!may_enable()) break;
      phase_ = Phase::enabling;
      heard_since_request_ = false;
      break;
    case Phase::enabling:
      if (!heard_since_request_) break;
      if (state == DriveState::enabled) phase_ = Phase::driving;
      silent_for_ = {};
      if (state == DriveState::fault) phase_ = Phase::left;
      break;
    case Phase::driving:
      silent_for_ = silent_for_ + settings_.period;
      if (state != DriveState::enabled || silent_for_ > settings_.silence) phase_ = Phase::left;
      break;
    case Phase::left:
      break;
  }
}

// Pushes nowhere.
MoteusDriver::Command MoteusDriver::limp() const noexcept {
  return {.position = q_ / kRadPerRev};
}

MoteusDriver::Command MoteusDriver::command_for(const DriveSetpoint& setpoint) const noexcept {
  const DriveSetpoint motor = to_motor(settings_.mapping, setpoint);
  if (!is_finite(setpoint) || !is_finite(motor)) return limp();
  const float kp_scale = std::clamp(motor.kp / settings_.servo_kp, 0.0F, 1.0F);
  return {.position = motor.q / kRadPerRev,
          .velocity = motor.dq / kRadPerRev,
          .torque = motor.tau,
          .kp_scale = kp_scale,
          .kd_scale = std::clamp(motor.kd / settings_.servo_kd, 0.0F, kp_scale)};
}

void MoteusDriver::write_command(const Command& command, Duration budget, MoteusWriter& writer) const noexcept {
  write_mode(kMoteusPosition, writer);
  const std::array law{command.position, command.velocity, command.torque,
                       command.kp_scale, command.kd_scale, settings_.torque_range};
  writer.write(MoteusType::float32, MoteusRegister::command_position, law);
  const Duration valid = std::clamp(budget, settings_.silence, kMoteusLongestWatchdog);
  const std::array watchdog{static_cast<float>(valid.seconds())};
  writer.write(MoteusType::float32, MoteusRegister::watchdog_timeout, watchdog);
  constexpr std::array kNoLimits{-0.1F, -0.05F};  // any negative one; these are -1 step
  writer.write(MoteusType::int8, MoteusRegister::velocity_limit, kNoLimits);
}

bool MoteusDriver::decode(const ReceivedFrame& received) noexcept {
  const CanFrame& frame = received.frame;
  if (frame.id != settings_.id << 8U) return false;
  Reply reply;
  if (!parse(frame, reply)) {
    ++malformed_frames_;
    return false;
  }
  const float q = reply.position * kRadPerRev;
  const float dq = reply.velocity * kRadPerRev;
  // A drive that does not know where it is says NaN: its own word all the same, and no stranger's.
  if (!std::isfinite(q) || !std::isfinite(dq) || !std::isfinite(reply.torque)) {
    ++malformed_frames_;
    return reply.tells_position;
  }
  if (take_reading(settings_.mapping, q, dq, reply.torque, received.received_at, feedback_)) q_ = q;
  assumed_home_.take(feedback_.q);
  feedback_.temperature_C = hotter(reply.temperature, reply.motor_temperature);
  feedback_.casing_C = std::isfinite(reply.temperature) ? whole_degrees(reply.temperature) : std::uint8_t{0};
  if (std::isfinite(reply.home)) knows_home_ = reply.home == kReferencedToOutput;
  Verdict verdict = judge(reply);
  if (phase_ == Phase::disabling) {
    silent_ticks_ = 0;
    const MoteusFacts told = decode_moteus_facts(frame);
    if (told.serial_number) identity_ = told.serial_number;
    if (told.firmware) firmware_ = told.firmware;
  }
  if (const std::uint32_t error = setup_error(); verdict.state == DriveState::disabled && error != 0)
    verdict = {DriveState::fault, error};
  feedback_.drive_state = verdict.state;
  feedback_.error_code = verdict.code;
  heard_since_request_ = true;
  silent_for_ = {};
  return true;
}

std::expected<std::unique_ptr<JointDriver>, std::string> make_moteus_driver(const config::RobotConfig& robot,
                                                                            std::size_t joint) {
  const config::Drive& drive = robot.joints[joint].drive;
  const std::size_t bus = robot.joints[joint].bus;
  if (bus >= robot.buses.size() || !robot.buses[bus].fd)
    return std::unexpected("moteus speaks CAN FD: give its bus `fd: true`");
  if (drive.id < 1 || drive.id > 127) return std::unexpected("moteus ids are 1 to 127");
  if (!is_positive(drive.torque_range) || !is_positive(drive.servo_kp) || !is_positive(drive.servo_kd))
    return std::unexpected("torque_range, servo_kp and servo_kd must be positive");
  MoteusDriveSettings settings;
  settings.id = drive.id;
  settings.torque_range = static_cast<float>(drive.torque_range);
  settings.servo_kp = static_cast<float>(drive.servo_kp);
  settings.servo_kd = static_cast<float>(drive.servo_kd);
  settings.mapping = mapping_of(drive);
  settings.silence = std::clamp(robot.feedback.timeout, kMoteusShortestSilence, kMoteusLongestSilence);
  settings.period = config::turn_of(robot, robot.joints[joint]);
  const auto identity = words_of("identity", drive.identity, {.style = WordStyle::hex, .least = 3, .most = 3});
  const auto firmware = words_of("firmware", drive.firmware, {.style = WordStyle::version});
  if (!identity || !firmware) return std::unexpected(identity ? firmware.error() : identity.error());
  settings.identity = *identity;
  settings.firmware = *firmware;
  return std::make_unique<MoteusDriver>(settings);
}

std::vector<FrameTraffic> moteus_traffic(const config::RobotConfig& /*robot*/, std::size_t /*joint*/) {
  return {{.bytes = kMoteusCommandBytes, .extended = true, .fd = true},
          {.bytes = kMoteusReplyBytes, .extended = true, .fd = true}};
}

std::string moteus_error_name(const config::Drive& /*drive*/, std::uint32_t code) {
  // mjbots/moteus docs/protocol/registers.md, register 00F
  static constexpr std::array<const char*, 17> kFrom32{"calibration fault",
                                                       "motor driver fault",
                                                       "over-voltage",
                                                       "encoder fault",
                                                       "motor not configured",
                                                       "PWM cycle overrun",
                                                       "over-temperature",
                                                       "started outside its position limits",
                                                       "under-voltage",
                                                       "configuration changed while running",
                                                       "no valid commutation encoder",
                                                       "no valid output encoder",
                                                       "gate driver could not be enabled",
                                                       "stop position with velocity or acceleration limits",
                                                       "timing violation",
                                                       "back-EMF feed-forward without acceleration limit",
                                                       "position limits out of range"};
  const auto about = static_cast<MoteusRegister>(setting_of(code));
  if (about == MoteusRegister::home_state) return "home state (register 00C)";
  if (about == MoteusRegister::firmware_version) return "firmware (register 101)";
  if (about == MoteusRegister::serial_number) return "identity (registers 120 to 122)";
  if (code == kMoteusTimeout) return "command watchdog expired";
  if (code == kMoteusFault) return "fault without a code";
  return code >= 32 && code - 32 < kFrom32.size() ? kFrom32[code - 32] : "";
}

}  // namespace takt::drivers

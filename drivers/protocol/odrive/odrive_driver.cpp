// SPDX-License-Identifier: Apache-2.0
#include "drivers/protocol/odrive/odrive_driver.hpp"

#include <algorithm>
#include <array>
#include <cmath>
#include <utility>

namespace takt::drivers {

std::size_t OdriveDriver::encode(bool enable, const DriveSetpoint& setpoint, MonoTime /*now*/, MonoTime /*valid_until*/,
                                 std::span<CanFrame> out) noexcept {
  const bool may_enable = setup_error() == 0 && (settings_.firmware.count == 0 || firmware_);
  if (!enable || !may_enable) return encode_disabled(out);
  out[0] = enabled_frame(setpoint);
  return 1;
}

bool OdriveDriver::is_set_up() const noexcept {
  const std::uint32_t error = setup_error();
  const bool asked = firmware_ || (settings_.firmware.count == 0 && asks_ == kAsksForVersion);
  return asked && (error == 0 || kind_of(error) == SetupFault::home_unknown);
}

std::size_t OdriveDriver::encode_disabled(std::span<CanFrame> out) noexcept {
  const std::uint32_t node = settings_.node;
  if (phase_ != Phase::disabling) {
    phase_ = Phase::disabling;
    turn_ = 1;
    judge_state();
    out[0] = odrive_set_axis_state(node, kOdriveIdle);
    out[1] = odrive_input_torque(node, 0);
    return 2;
  }
  const std::uint32_t turn = std::exchange(turn_, (turn_ + 1) % 3);
  if (turn == 0)
    out[0] = odrive_set_axis_state(node, kOdriveIdle);
  else if (turn == 1)
    out[0] = odrive_controller_mode(node, kOdriveTorqueControl, kOdrivePassthrough);
  else
    out[0] = reports_errors() ? odrive_clear_errors(node) : odrive_input_torque(node, 0);
  if (!is_time_to_ask()) return 1;
  out[1] = odrive_get_version(node);
  return 2;
}

// Seldom, and only while it may still be answered: a drive that was asked often enough is left in peace, unless the
// robot file wants to know.
bool OdriveDriver::is_time_to_ask() noexcept {
  const bool given_up = asks_ == kAsksForVersion && settings_.firmware.count == 0;
  if (firmware_ || given_up || !heartbeat_at_.is_set()) return false;
  if (ticks_to_ask_ > 0) {
    --ticks_to_ask_;
    return false;
  }
  ticks_to_ask_ = kTicksPerAsk - 1;
  if (asks_ < kAsksForVersion) ++asks_;
  if (asks_ == kAsksForVersion) judge_state();
  return true;
}

std::uint32_t OdriveDriver::setup_error() const noexcept {
  if (old_firmware_) return setup_fault_code(SetupFault::other_protocol, kOdriveOldFirmware);
  if (contradicts(settings_.firmware, firmware_)) return setup_fault_code(SetupFault::settings_differ, kOdriveFirmware);
  const bool unread = settings_.firmware.count != 0 && !firmware_ && asks_ == kAsksForVersion;
  if (unread) return setup_fault_code(SetupFault::settings_unread, kOdriveFirmware);
  if (!settings_.watchdog_waived) return setup_fault_code(SetupFault::watchdog_unknown);
  const bool knows_home = !settings_.home_mark || was_told_home_ || assumed_home_.known();
  return knows_home ? 0 : setup_fault_code(SetupFault::home_unknown);
}

CanFrame OdriveDriver::enabled_frame(const DriveSetpoint& setpoint) noexcept {
  const std::uint32_t node = settings_.node;
  switch (phase_) {
    case Phase::disabling:
    case Phase::set_mode:
      phase_ = Phase::zero_torque;
      return odrive_controller_mode(node, kOdriveTorqueControl, kOdrivePassthrough);
    case Phase::zero_torque:
      phase_ = Phase::request;
      return odrive_input_torque(node, 0);
    case Phase::request:
      phase_ = Phase::wait;
      waited_ticks_ = 0;
      heard_since_request_ = false;
      return odrive_set_axis_state(node, kOdriveClosedLoop);
    case Phase::wait:
      return waiting_frame(setpoint);
    case Phase::driving:
      if (feedback_.drive_state == DriveState::enabled) return torque_frame(setpoint);
      phase_ = Phase::left;
      break;
    case Phase::left:
      if (feedback_.drive_state == DriveState::enabled) return odrive_set_axis_state(node, kOdriveIdle);
      break;
  }
  return odrive_input_torque(node, 0);
}

CanFrame OdriveDriver::waiting_frame(const DriveSetpoint& setpoint) noexcept {
  if (heard_since_request_ && feedback_.drive_state == DriveState::enabled) {
    phase_ = Phase::driving;
    return torque_frame(setpoint);
  }
  ++waited_ticks_;
  if (feedback_.drive_state == DriveState::fault)
    phase_ = Phase::left;
  else if (waited_ticks_ >= kAskAgainTicks)
    phase_ = Phase::set_mode;
  return odrive_input_torque(settings_.node, 0);
}

CanFrame OdriveDriver::torque_frame(const DriveSetpoint& setpoint) const noexcept {
  const float torque = to_motor(settings_.mapping, setpoint).tau;
  return odrive_input_torque(settings_.node, std::isfinite(torque) ? torque : 0.0F);
}

bool OdriveDriver::decode(const ReceivedFrame& received) noexcept {
  const CanFrame& frame = received.frame;
  if (frame.extended || frame.id >> 5U != settings_.node) return false;
  return take(static_cast<OdriveMessage>(frame.id & 0x1FU), received);
}

bool OdriveDriver::take(OdriveMessage message, const ReceivedFrame& received) noexcept {
  const auto counted = [this](bool taken) {
    if (!taken) ++malformed_frames_;
    return taken;
  };
  const CanFrame& frame = received.frame;
  switch (message) {
    case OdriveMessage::get_version:
      return counted(take_version(frame));
    case OdriveMessage::heartbeat:
      return counted(take_heartbeat(received));
    case OdriveMessage::get_error:
      return counted(take_errors(frame));
    case OdriveMessage::encoder_estimates:
      return counted(take_estimates(received));
    case OdriveMessage::temperature:
      return counted(take_temperatures(frame));
    case OdriveMessage::torques:
      return counted(take_torques(frame));
    case OdriveMessage::iq:
    case OdriveMessage::bus_voltage:
      return counted(decode_odrive_pair(settings_.node, message, frame).has_value());
    case OdriveMessage::estop:
    case OdriveMessage::set_axis_state:
    case OdriveMessage::controller_mode:
    case OdriveMessage::input_pos:
    case OdriveMessage::input_vel:
    case OdriveMessage::input_torque:
    case OdriveMessage::limits:
    case OdriveMessage::clear_errors:
    case OdriveMessage::set_absolute_position:
      return false;  // a command: never the drive's
  }
  return false;
}

bool OdriveDriver::take_version(const CanFrame& frame) noexcept {
  const auto version = decode_odrive_version(settings_.node, frame);
  if (!version) return false;
  constexpr std::uint32_t kFirstKnown = 0x00'06'00;
  firmware_ = DriveWords{{version->firmware}, 1};
  old_firmware_ |= version->firmware < kFirstKnown;
  judge_state();
  return true;
}

bool OdriveDriver::take_heartbeat(const ReceivedFrame& received) noexcept {
  const auto heartbeat = decode_odrive_heartbeat(settings_.node, received.frame);
  if (!heartbeat) return false;
  // Perhaps another drive than before its silence.
  if (heartbeat_at_.is_set() && received.received_at - heartbeat_at_ > kOdriveHeartbeatTimeout) {
    firmware_.reset();
    old_firmware_ = false;
    assumed_home_.forget();
    asks_ = 0;
    ticks_to_ask_ = kTicksPerAsk;
  }
  heartbeat_at_ = std::max(heartbeat_at_, received.received_at);
  heartbeat_missing_ = false;
  heard_since_request_ = true;
  axis_state_ = heartbeat->axis_state;
  active_errors_ = heartbeat->axis_error;
  old_firmware_ |= heartbeat->of_firmware_05;
  judge_state();
  return true;
}

bool OdriveDriver::take_errors(const CanFrame& frame) noexcept {
  const auto errors = decode_odrive_errors(settings_.node, frame);
  if (!errors) return false;
  active_errors_ = errors->active;
  disarm_reason_ = errors->disarm_reason;
  judge_state();
  return true;
}

// Its own word all the same, and no stranger's.
bool OdriveDriver::without_a_number() noexcept {
  ++malformed_frames_;
  return true;
}

bool OdriveDriver::take_estimates(const ReceivedFrame& received) noexcept {
  const auto turns = decode_odrive_pair(settings_.node, OdriveMessage::encoder_estimates, received.frame);
  if (!turns) return false;
  was_told_home_ = settings_.home_mark && turns->first > settings_.home_mark->least;
  const float q = (turns->first - (was_told_home_ ? settings_.home_mark->turns : 0)) * kRadPerTurn;
  const float dq = turns->second * kRadPerTurn;
  if (!std::isfinite(q) || !std::isfinite(dq)) return without_a_number();
  take_reading(settings_.mapping, q, dq, tau_, received.received_at, feedback_);
  assumed_home_.take(feedback_.q);
  heartbeat_missing_ = heartbeat_at_.is_set() && received.received_at - heartbeat_at_ > kOdriveHeartbeatTimeout;
  judge_state();
  return true;
}

bool OdriveDriver::take_temperatures(const CanFrame& frame) noexcept {
  const auto celsius = decode_odrive_pair(settings_.node, OdriveMessage::temperature, frame);
  if (!celsius) return false;
  // A motor without a thermistor is not a number.
  const float stage = std::isfinite(celsius->first) ? celsius->first : 0.0F;
  feedback_.temperature_C = std::isfinite(celsius->second) ? std::max(stage, celsius->second) : stage;
  feedback_.casing_C = std::isfinite(celsius->first) ? whole_degrees(celsius->first) : std::uint8_t{0};
  return true;
}

bool OdriveDriver::take_torques(const CanFrame& frame) noexcept {
  const auto torques = decode_odrive_pair(settings_.node, OdriveMessage::torques, frame);
  if (!torques) return false;
  if (!std::isfinite(torques->second)) return without_a_number();
  tau_ = torques->second;
  return true;
}

void OdriveDriver::judge_state() noexcept {
  const auto judge = [this](DriveState state, std::uint32_t code = 0) {
    feedback_.drive_state = state;
    feedback_.error_code = code;
  };
  if (!heartbeat_at_.is_set()) return judge(DriveState::unknown);
  if (old_firmware_) return judge(DriveState::fault, setup_error());
  if (heartbeat_missing_) return judge(DriveState::fault, kOdriveNoHeartbeat);
  if (active_errors_ != 0) return judge(DriveState::fault, active_errors_ | disarm_reason_);
  if (axis_state_ == kOdriveClosedLoop) return judge(DriveState::enabled);
  // Some errors pass, and only the reason for leaving stays. It stays after a normal disable too: then it is history.
  if (phase_ == Phase::left && disarm_reason_ != 0) return judge(DriveState::fault, disarm_reason_);
  if (const std::uint32_t error = setup_error(); error != 0) return judge(DriveState::fault, error);
  judge(DriveState::disabled);
}

std::optional<OdriveHomeMark> odrive_home_mark(const config::Joint& joint) {
  if (joint.drive.position_after_power_up != config::PositionAfterPowerUp::unknown) return std::nullopt;
  const config::Limits& limits = joint.limits;
  const double turns_per_rad = joint.drive.direction * joint.drive.gear_ratio / (2 * std::numbers::pi);
  const double one_end = (limits.q_min - limits.position_margin - joint.drive.offset) * turns_per_rad;
  const double other_end = (limits.q_max + limits.position_margin - joint.drive.offset) * turns_per_rad;
  const double travel = std::abs(other_end - one_end);
  const double least = 2 * (travel + 1);
  return OdriveHomeMark{.turns = static_cast<float>(std::ceil(least + travel + 1 - std::min(one_end, other_end))),
                        .least = static_cast<float>(least)};
}

std::expected<std::unique_ptr<JointDriver>, std::string> make_odrive_driver(const config::RobotConfig& robot,
                                                                            std::size_t joint) {
  const config::Drive& drive = robot.joints[joint].drive;
  if (drive.id > kOdriveMaxNode) return std::unexpected("odrive nodes are 0 to 63");
  if (!std::isfinite(drive.torque_range) || !(drive.torque_range > 0))
    return std::unexpected("torque_range must be positive");
  if (robot.control.period.ns <= 0 || robot.control.period.ns % milliseconds(1).ns != 0)
    return std::unexpected("odrive reports come every whole millisecond: make control.period a multiple of 1 ms");
  OdriveDriveSettings settings;
  settings.node = drive.id;
  settings.mapping = mapping_of(drive);
  settings.watchdog_waived = config::waives_watchdog(drive);
  settings.home_mark = odrive_home_mark(robot.joints[joint]);
  const auto firmware = words_of("firmware", drive.firmware, {.style = WordStyle::version});
  if (!firmware) return std::unexpected(firmware.error());
  settings.firmware = *firmware;
  return std::make_unique<OdriveDriver>(settings);
}

std::vector<FrameTraffic> odrive_traffic(const config::RobotConfig& robot, std::size_t /*joint*/) {
  const auto every = [&robot](double report_ms) {
    return FrameTraffic{.bytes = 8, .per_tick = robot.control.period.milliseconds() / report_ms};
  };
  constexpr std::array kReport_ms{10.0, 10.0, 100.0, 100.0, 100.0};  // heartbeat, torques; temperature, error, bus
  std::vector<FrameTraffic> traffic{{.bytes = 4}, {.bytes = 8}};     // torque command, encoder estimates
  for (const double report_ms : kReport_ms) traffic.push_back(every(report_ms));
  return traffic;
}

std::string odrive_error_name(const config::Drive& /*drive*/, std::uint32_t code) {
  if (code == kOdriveNoHeartbeat) return "heartbeat missing";
  if (setting_of(code) == kOdriveFirmware) return "firmware (message 00)";
  if (setting_of(code) == kOdriveOldFirmware)
    return "that of firmware 0.5, whose errors and messages have other numbers: Takt speaks 0.6 (ODrive Pro, S1, "
           "Micro)";
  // odriverobotics/ODriveArduino src/ODriveEnums.h, ODrive.Error
  static constexpr std::array<std::pair<std::uint32_t, const char*>, 22> kBits{{
      {0x0000'0001, "initializing"},
      {0x0000'0002, "system level error"},
      {0x0000'0004, "timing error"},
      {0x0000'0008, "estimate missing"},
      {0x0000'0010, "bad configuration"},
      {0x0000'0020, "gate driver fault"},
      {0x0000'0040, "input missing"},
      {0x0000'0100, "bus over-voltage"},
      {0x0000'0200, "bus under-voltage"},
      {0x0000'0400, "bus over-current"},
      {0x0000'0800, "bus regeneration over-current"},
      {0x0000'1000, "current limit violated"},
      {0x0000'2000, "motor over-temperature"},
      {0x0000'4000, "inverter over-temperature"},
      {0x0000'8000, "velocity limit violated"},
      {0x0001'0000, "position limit violated"},
      {0x0100'0000, "command watchdog expired"},
      {0x0200'0000, "emergency stop requested"},
      {0x0400'0000, "spin-out detected"},
      {0x0800'0000, "brake resistor disarmed"},
      {0x1000'0000, "thermistor disconnected"},
      {0x4000'0000, "calibration error"},
  }};
  std::string names;
  for (const auto& [bit, name] : kBits)
    if ((code & bit) != 0) names += (names.empty() ? "" : ", ") + std::string(name);
  return names;
}

}  // namespace takt::drivers

// SPDX-License-Identifier: Apache-2.0
#include "drivers/protocol/mit/mit_driver.hpp"

#include <algorithm>
#include <array>
#include <cmath>
#include <utility>

#include "drivers/protocol/drive_timeout.hpp"

namespace takt::drivers {
namespace {

constexpr WordForm kDamiaoNumber{.style = WordStyle::decimal};

bool is_positive(float x) {
  return std::isfinite(x) && x > 0;
}

}  // namespace

std::size_t MitDriver::encode(bool enable, const DriveSetpoint& setpoint, MonoTime /*now*/, MonoTime /*valid_until*/,
                              std::span<CanFrame> out) noexcept {
  // The protocol has no field for the command's remaining life: the drive's own time-out stands in.
  CanFrame& frame = out[0];
  frame = {};
  frame.id = settings_.id;
  frame.length = 8;
  frame.fd = frame.bit_rate_switch = settings_.fd();
  note_silence();
  if (other_protocol_ticks_ > 0) {
    --other_protocol_ticks_;
    if (other_protocol_ticks_ == 0) judge();
  }
  if (!enable && wish_ != Wish::disable) readback_.restart();
  const bool wanted = enable && is_set_up();
  std::ranges::copy(payload_for(wanted, setpoint), frame.data);
  anything_sent_ = true;
  // A drive that is silent has nothing to answer; one that is enabled is left alone.
  const bool heard = std::exchange(heard_, false);
  if (wanted || settings_.variant != MitVariant::damiao || !heard || status_ == kDamiaoEnabled) return 1;
  const std::optional<CanFrame> question = readback_.next();
  judge();
  if (!question) return 1;
  out[1] = *question;
  out[1].fd = out[1].bit_rate_switch = settings_.fd();
  return 2;
}

void MitDriver::note_silence() noexcept {
  if (wish_ == Wish::drive) return;
  ++silent_ticks_;
  if (silent_ticks_ == kTicksToDoubt) readback_.restart();
}

bool MitDriver::is_set_up() const noexcept {
  switch (settings_.variant) {
    case MitVariant::damiao:
      return other_protocol_ticks_ == 0 && readback_.may_enable();
    case MitVariant::tmotor:
      return settings_.timeout.waived && other_protocol_ticks_ == 0;
    case MitVariant::robstride:
      return settings_.timeout.waived;
  }
  return false;
}

std::uint32_t MitDriver::setup_error() const noexcept {
  switch (settings_.variant) {
    case MitVariant::damiao:
      return other_protocol_ticks_ > 0 ? setup_fault_code(SetupFault::other_protocol, other_protocol_)
                                       : readback_.error_code();
    case MitVariant::tmotor:
      if (other_protocol_ticks_ > 0) return setup_fault_code(SetupFault::other_protocol, other_protocol_);
      return settings_.timeout.waived ? 0 : setup_fault_code(SetupFault::watchdog_unknown);
    case MitVariant::robstride:
      return settings_.timeout.waived ? 0 : setup_fault_code(SetupFault::watchdog_unknown);
  }
  return 0;
}

MitPayload MitDriver::payload_for(bool enable, const DriveSetpoint& setpoint) noexcept {
  if (!enable) {
    wish_ = Wish::disable;
    const bool error = settings_.variant == MitVariant::damiao && reported_state() == DriveState::fault;
    clear_next_ = error && !clear_next_;
    return encode_mit_special(clear_next_ ? MitSpecial::clear_error : MitSpecial::exit_motor_mode);
  }
  if (wish_ == Wish::enter && feedback_.drive_state == DriveState::enabled) wish_ = Wish::drive;
  if (wish_ != Wish::drive) {
    wish_ = Wish::enter;
    return encode_mit_special(MitSpecial::enter_motor_mode);
  }
  const DriveSetpoint motor = to_motor(settings_.mapping, setpoint);
  return encode_mit_command(settings_.range,
                            {.p = motor.q, .v = motor.dq, .kp = motor.kp, .kd = motor.kd, .t = motor.tau});
}

bool MitDriver::decode(const ReceivedFrame& received) noexcept {
  const CanFrame& frame = received.frame;
  if (take_other_protocol(frame)) return true;
  if (frame.id != settings_.reply_id || frame.extended) return false;
  if (settings_.variant == MitVariant::damiao) {
    if (const std::optional<DamiaoAnswer> answer = decode_damiao_answer(settings_.id, frame, settings_.fd())) {
      readback_.take(*answer);
      judge();
      return true;
    }
  }
  const std::optional<MitReply> reply = decode_mit_reply(settings_.range, settings_.variant, frame, settings_.fd());
  if (!reply) {
    ++malformed_frames_;
    return false;
  }
  // Drives may share one master id; the first byte tells them apart.
  const std::uint32_t mask = settings_.variant == MitVariant::damiao ? 0xFU : 0xFFU;
  if (reply->id != (settings_.id & mask)) return false;
  take(*reply, received.received_at);
  return true;
}

void MitDriver::take(const MitReply& reply, MonoTime received_at) noexcept {
  take_reading(settings_.mapping, reply.p, reply.v, reply.t, received_at, feedback_);
  feedback_.temperature_C = reply.temperature_C;
  feedback_.casing_C = reply.stage_C;
  status_ = reply.status;
  heard_ = true;
  silent_ticks_ = 0;
  judge();
}

// 0: it is of none that is known. A drive that is driven has been understood: there a frame that looks otherwise is a
// stranger's.
std::uint32_t MitDriver::other_protocol_of(const CanFrame& frame) const noexcept {
  const bool on_reply_id = frame.id == settings_.reply_id && !frame.extended && wish_ != Wish::drive;
  switch (settings_.variant) {
    case MitVariant::tmotor:
      if (on_reply_id && is_robstride_reply(settings_.id, frame)) return kRobstrideInMit;
      return is_ak_v3_feedback(settings_.id, frame) ? kAkV3Feedback : 0;
    case MitVariant::robstride:
      return 0;
    case MitVariant::damiao: {
      constexpr std::uint32_t kIdBits = 0xF;
      const bool is_reply = on_reply_id && !frame.remote && !frame.error && frame.length == 8 &&
                            (frame.data[0] & kIdBits) == (settings_.id & kIdBits);
      return is_reply && frame.fd != settings_.fd() ? kOtherFrames : 0;
    }
  }
  return 0;
}

bool MitDriver::take_other_protocol(const CanFrame& frame) noexcept {
  const std::uint32_t found = other_protocol_of(frame);
  if (found == 0) return false;
  other_protocol_ = found;
  other_protocol_ticks_ = kTicksToForget;
  judge();
  return true;
}

void MitDriver::judge() noexcept {
  if (!feedback_.received_at.is_set()) {
    feedback_.error_code = other_protocol_ticks_ > 0 ? setup_error() : 0;
    feedback_.drive_state = feedback_.error_code != 0 ? DriveState::fault : DriveState::unknown;
    return;
  }
  feedback_.drive_state = reported_state();
  feedback_.error_code = feedback_.drive_state == DriveState::fault ? status_ : setup_error();
  if (feedback_.error_code != 0) feedback_.drive_state = DriveState::fault;
}

DriveState MitDriver::reported_state() const noexcept {
  if (!feedback_.received_at.is_set()) return DriveState::unknown;
  switch (settings_.variant) {
    case MitVariant::damiao:
      if (status_ == kDamiaoDisabled) return DriveState::disabled;
      return status_ == kDamiaoEnabled ? DriveState::enabled : DriveState::fault;
    case MitVariant::tmotor:
    case MitVariant::robstride:  // tells nothing of it: status 0
      if (status_ != 0) return DriveState::fault;
      if (!anything_sent_) return DriveState::unknown;
      return wish_ == Wish::disable ? DriveState::disabled : DriveState::enabled;
  }
  return DriveState::unknown;
}

std::optional<Duration> MitDriver::stored_timeout() const {
  const std::optional<std::uint32_t> units = readback_.timeout();
  if (!units) return std::nullopt;
  return kTimeoutUnit * *units;
}

std::expected<std::unique_ptr<JointDriver>, std::string> make_mit_driver(const config::RobotConfig& robot,
                                                                         std::size_t joint) {
  const config::Drive& drive = robot.joints[joint].drive;
  MitDriveSettings settings;
  if (drive.variant == "damiao")
    settings.variant = MitVariant::damiao;
  else if (drive.variant == "tmotor")
    settings.variant = MitVariant::tmotor;
  else if (drive.variant == "robstride")
    settings.variant = MitVariant::robstride;
  else
    return std::unexpected("mit variant '" + drive.variant + "' is unknown: write tmotor, damiao or robstride");
  settings.range = {static_cast<float>(drive.position_range), static_cast<float>(drive.velocity_range),
                    static_cast<float>(drive.kp_range), static_cast<float>(drive.kd_range),
                    static_cast<float>(drive.torque_range)};
  const MitRange& range = settings.range;
  if (!is_positive(range.p) || !is_positive(range.v) || !is_positive(range.kp) || !is_positive(range.kd) ||
      !is_positive(range.t))
    return std::unexpected("the drive's packed ranges are not all positive: name a model or give every range");
  if (drive.id > 0x7FF || drive.reply_id > 0x7FF)
    return std::unexpected("mit drives have 11-bit ids: id and reply_id must be at most 0x7FF");
  settings.id = drive.id;
  settings.reply_id = drive.reply_id;
  settings.mapping = mapping_of(drive);
  if (drive.fd_bitrate != 0) {
    settings.fd_bit_rate_code = damiao_bit_rate_code(drive.fd_bitrate);
    if (settings.variant != MitVariant::damiao || !settings.fd())
      return std::unexpected("fd_bitrate is for Damiao drives: 2, 2.5, 3.2, 4 or 5 Mbit/s");
  }
  settings.timeout = {timeout_units(drive_timeout(robot)), config::waives_watchdog(drive)};
  const auto identity = words_of("identity", drive.identity, kDamiaoNumber);
  const auto firmware = words_of("firmware", drive.firmware, kDamiaoNumber);
  if (!identity || !firmware) return std::unexpected(identity ? firmware.error() : identity.error());
  if (settings.variant != MitVariant::damiao && identity->count + firmware->count != 0)
    return std::unexpected(
        "T-Motor drives, and RobStride in MIT protocol, tell neither identity nor firmware over CAN: "
        "remove the keys");
  if (identity->count != 0) settings.identity.serial_number = identity->word[0];
  if (firmware->count != 0) settings.identity.firmware = firmware->word[0];
  return std::make_unique<MitDriver>(settings);
}

std::vector<FrameTraffic> mit_traffic(const config::RobotConfig& robot, std::size_t joint) {
  const config::Drive& drive = robot.joints[joint].drive;
  const std::size_t reply_bytes = drive.variant == "tmotor" ? 6 : 8;
  const bool fd = drive.fd_bitrate != 0;
  return {{.bytes = 8, .fd = fd}, {.bytes = reply_bytes, .fd = fd}};
}

std::string mit_error_name(const config::Drive& drive, std::uint32_t code) {
  static constexpr std::array<const char*, 7> kTmotor{
      "", "over-temperature", "over-current", "over-voltage", "under-voltage", "encoder fault", "phase unbalance"};
  static constexpr std::array<const char*, 7> kDamiaoFrom8{
      "over-voltage",          "under-voltage",      "over-current", "output stage over-temperature",
      "coil over-temperature", "communication lost", "overload"};
  const std::uint32_t setting = setting_of(code);
  if (setting == kAkV3Feedback)
    return "that of AK V3 firmware or servo mode (29-bit feedback ids 0x29xx), which this program does not speak: set "
           "the "
           "drive to the MIT mode of V2 firmware with the maker's tool";
  if (setting == MitDriver::kOtherFrames)
    return drive.fd_bitrate != 0
               ? "classic frames, not CAN FD: set the drive's bit rate (register 35), or drop fd_bitrate"
               : "CAN FD, not classic frames: write fd_bitrate, or set the drive's bit rate (register 35)";
  if (setting == kRobstrideInMit)
    return "that of a RobStride in MIT protocol: write `variant: robstride`; or switch it back to its own protocol, "
           "which tells more, with the maker's tool, and write `protocol: robstride`";
  if (setting != 0) {
    const bool tells_nothing = kind_of(code) == SetupFault::settings_unread &&
                               static_cast<DamiaoRegister>(setting) == DamiaoRegister::control_mode;
    return std::string(damiao_register_name(setting)) +
           (tells_nothing ? "; a RobStride in MIT protocol tells none: write `variant: robstride` for it" : "");
  }
  if (drive.variant == "robstride") return "";
  if (drive.variant == "tmotor") return code < kTmotor.size() ? kTmotor[code] : "";
  return code >= 8 && code - 8 < kDamiaoFrom8.size() ? kDamiaoFrom8[code - 8] : "";
}

}  // namespace takt::drivers

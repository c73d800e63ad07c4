#include "drivers/mit_driver.hpp"

#include <algorithm>

namespace takt::drivers {

std::size_t MitDriver::encode(bool enable, const DriveSetpoint& setpoint, Duration /*budget*/,
                              std::span<CanFrame> out) noexcept {
  // The protocol has no field for the command's remaining life: the drive's own time-out is a setting in the drive.
  CanFrame& frame = out[0];
  frame = {};
  frame.id = settings_.id;
  frame.length = 8;
  std::ranges::copy(payload_for(enable, setpoint), frame.data);
  anything_sent_ = true;
  return 1;
}

MitPayload MitDriver::payload_for(bool enable, const DriveSetpoint& setpoint) noexcept {
  if (!enable) {
    wish_ = Wish::disable;
    const bool error = settings_.variant == MitVariant::damiao && feedback_.drive_state == DriveState::fault;
    clear_next_ = error && !clear_next_;
    return encode_mit_special(clear_next_ ? MitSpecial::clear_error : MitSpecial::exit_motor_mode);
  }
  if (wish_ == Wish::disable) {
    wish_ = Wish::enter;
    return encode_mit_special(MitSpecial::enter_motor_mode);
  }
  if (wish_ == Wish::enter && feedback_.drive_state == DriveState::enabled) wish_ = Wish::drive;
  if (wish_ == Wish::enter) return encode_mit_special(MitSpecial::enter_motor_mode);
  return encode_mit_command(settings_.range, to_motor(setpoint));
}

MitCommand MitDriver::to_motor(const DriveSetpoint& setpoint) const noexcept {
  const float ratio = settings_.direction * settings_.gear_ratio;
  const float squared = settings_.gear_ratio * settings_.gear_ratio;
  return {.p = (setpoint.q - settings_.offset) * ratio,
          .v = setpoint.dq * ratio,
          .kp = setpoint.kp / squared,
          .kd = setpoint.kd / squared,
          .t = setpoint.tau / ratio};
}

bool MitDriver::decode(const ReceivedFrame& received) noexcept {
  const CanFrame& frame = received.frame;
  if (frame.id != settings_.reply_id || frame.extended) return false;
  const std::optional<MitReply> reply = decode_mit_reply(settings_.range, settings_.variant, frame);
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
  const float ratio = settings_.direction * settings_.gear_ratio;
  feedback_.received_at = received_at;
  feedback_.q = reply.p / ratio + settings_.offset;
  feedback_.dq = reply.v / ratio;
  feedback_.tau = reply.t * ratio;
  feedback_.temperature_C = reply.temperature_C;
  feedback_.drive_state = state_of(reply);
  feedback_.error_code = feedback_.drive_state == DriveState::fault ? reply.status : 0;
}

DriveState MitDriver::state_of(const MitReply& reply) const noexcept {
  switch (settings_.variant) {
    case MitVariant::damiao:
      if (reply.status == kDamiaoDisabled) return DriveState::disabled;
      return reply.status == kDamiaoEnabled ? DriveState::enabled : DriveState::fault;
    case MitVariant::tmotor:
      if (reply.status != 0) return DriveState::fault;
      if (!anything_sent_) return DriveState::unknown;
      return wish_ == Wish::disable ? DriveState::disabled : DriveState::enabled;
  }
  return DriveState::unknown;
}

}  // namespace takt::drivers

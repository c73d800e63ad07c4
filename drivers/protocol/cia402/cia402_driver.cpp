// SPDX-License-Identifier: Apache-2.0
#include "drivers/protocol/cia402/cia402_driver.hpp"

#include <algorithm>
#include <limits>

namespace takt::drivers {
namespace {

using cia402::NmtState;
using cia402::PowerState;

// How long each half of a fault reset's edge lasts: drives read the controlword at a pace of their own.
constexpr std::uint32_t kResetHalfTicks = 10;

void count_tick(std::uint32_t& age) noexcept {
  if (age < std::numeric_limits<std::uint32_t>::max()) ++age;
}

bool is_fault(PowerState state) noexcept {
  return state == PowerState::fault || state == PowerState::fault_reaction;
}

DriveState drive_state_of(PowerState state) noexcept {
  switch (state) {
    case PowerState::operation_enabled:
      return DriveState::enabled;
    case PowerState::fault_reaction:
    case PowerState::fault:
      return DriveState::fault;
    case PowerState::not_ready:
    case PowerState::switch_on_disabled:
    case PowerState::ready:
    case PowerState::switched_on:
    case PowerState::quick_stop:
      return DriveState::disabled;
    case PowerState::undefined:
      return DriveState::unknown;
  }
  return DriveState::unknown;
}

// Modulo 2^32, as the drive's counter runs over.
std::int32_t difference(std::int32_t now, std::int32_t before) noexcept {
  return static_cast<std::int32_t>(static_cast<std::uint32_t>(now) - static_cast<std::uint32_t>(before));
}

}  // namespace

Cia402Driver::Cia402Driver(const Cia402DriveSettings& settings) noexcept
    : settings_(settings), setup_(settings.setup, settings.patience) {}

std::size_t Cia402Driver::encode(bool enable, const DriveSetpoint& setpoint, MonoTime /*now*/, MonoTime /*valid_until*/,
                                 std::span<CanFrame> out) noexcept {
  note_silence(enable);
  note_wish(enable);
  std::size_t count = 0;
  const auto frame = enable ? std::nullopt : setup_.tick();
  if (frame) out[count++] = *frame;
  if (setup_.configured()) out[count++] = command(setpoint);
  if (is_time_for_our_heartbeat()) out[count++] = cia402::encode_our_heartbeat();
  if (settings_.sends_sync) out[count++] = cia402::encode_sync();
  refresh_state();
  return count;
}

void Cia402Driver::note_silence(bool enable) noexcept {
  if (!setup_.done()) return;
  count_tick(heartbeat_age_);
  heartbeat_lost_ |= heartbeat_age_ > settings_.max_heartbeat_ticks;
  if (heartbeat_lost_ && !enable) start_over();
}

bool Cia402Driver::is_time_for_our_heartbeat() noexcept {
  if (!setup_.needs_our_heartbeat() || ++our_heartbeat_age_ < settings_.our_heartbeat_ticks) return false;
  our_heartbeat_age_ = 0;
  return true;
}

// Every report is of one tick.
void Cia402Driver::note_obedience(std::uint16_t statusword) noexcept {
  const bool drives = wish_ == Wish::drive && power_ == PowerState::operation_enabled;
  ignored_reports_ = drives && (statusword & cia402::kFollowsTarget) == 0 ? ignored_reports_ + 1 : 0;
  limited_reports_ = drives && (statusword & cia402::kInternalLimit) != 0 ? limited_reports_ + 1 : 0;
  if (limited_reports_ > settings_.limit_ticks) disobedience_ = kLimited;
  if (ignored_reports_ > settings_.follow_ticks) disobedience_ = kNotFollowing;
}

void Cia402Driver::note_wish(bool enable) noexcept {
  if (!enable) {
    wish_ = Wish::disable;
    disobedience_ = entering_ticks_ = 0;
    return;
  }
  if (wish_ == Wish::enter && power_ != PowerState::operation_enabled && ++entering_ticks_ > settings_.enable_ticks)
    disobedience_ = kStaysOff | statusword_;
  if (disobedience_ != 0) wish_ = Wish::left;
  if (!setup_.done() || heartbeat_lost_) wish_ = Wish::left;
  if (wish_ == Wish::disable) wish_ = Wish::enter;
  if (wish_ == Wish::enter && power_ == PowerState::operation_enabled) wish_ = Wish::drive;
  if (wish_ == Wish::enter && (is_fault(power_) || power_ == PowerState::quick_stop)) wish_ = Wish::left;
  if (wish_ == Wish::drive && power_ != PowerState::operation_enabled) wish_ = Wish::left;
}

CanFrame Cia402Driver::command(const DriveSetpoint& setpoint) noexcept {
  std::uint16_t controlword = cia402::kDisableVoltage;
  switch (wish_) {
    case Wish::disable:
      controlword = way_down();
      break;
    case Wish::enter:
    case Wish::drive:
      controlword = cia402::step_up(power_);
      break;
    case Wish::left:
      break;
  }
  const bool drives = wish_ == Wish::drive && has_reading_;
  const std::int32_t target = drives
                                  ? cia402::target_of(settings_.scale, to_motor(settings_.mapping, setpoint), counts_)
                                  : cia402::resting_target(settings_.scale, counts_);
  return cia402::encode_rpdo(settings_.scale.mode, settings_.setup.node, controlword, target);
}

std::uint16_t Cia402Driver::way_down() noexcept {
  if (power_ != PowerState::fault) {
    reset_ticks_ = 0;
    return cia402::kDisableVoltage;
  }
  const bool high = reset_ticks_ < kResetHalfTicks;
  reset_ticks_ = (reset_ticks_ + 1) % (2 * kResetHalfTicks);
  return high ? cia402::kFaultReset : cia402::kDisableVoltage;
}

bool Cia402Driver::decode(const ReceivedFrame& received) noexcept {
  if (received.frame.extended || received.frame.error) return false;
  const bool ours = obey(received);
  if (ours) refresh_state();
  return ours;
}

bool Cia402Driver::obey(const ReceivedFrame& received) noexcept {
  const CanFrame& frame = received.frame;
  const std::uint32_t node = settings_.setup.node;
  if (frame.id == cia402::kTpdo1Id + node) return take_report(received);
  if (frame.id == cia402::kHeartbeatId + node) return take_heartbeat(frame);
  if (frame.id == cia402::kEmergencyId + node) return take_emergency(frame);
  if (frame.id == cia402::kSdoAnswerId + node) return take_sdo(frame);
  // Ours, and nothing that we asked for: a drive before its set-up.
  return frame.id == cia402::kTpdo2Id + node || frame.id == cia402::kTpdo3Id + node ||
         frame.id == cia402::kTpdo4Id + node;
}

bool Cia402Driver::take_report(const ReceivedFrame& received) noexcept {
  // Before its set-up a drive reports whatever it was told by others.
  if (!setup_.configured()) return true;
  const auto report = cia402::decode_tpdo(received.frame);
  if (!report) {
    ++malformed_frames_;
    return false;
  }
  statusword_ = report->statusword;
  power_ = cia402::power_state(report->statusword);
  note_obedience(report->statusword);
  estimate_velocity(report->position, received.received_at);
  if (take_reading(settings_.mapping, static_cast<float>(cia402::to_rad(report->position, settings_.scale)), dq_,
                   cia402::to_torque(report->torque, settings_.scale), received.received_at, feedback_))
    counts_ = report->position;
  has_reading_ = true;
  return true;
}

void Cia402Driver::estimate_velocity(std::int32_t position, MonoTime received_at) noexcept {
  const Duration passed = received_at - slope_from_.at;
  if (has_reading_ && passed <= Duration{}) return;  // no time to divide by
  if (has_reading_) {
    const double moved = cia402::to_rad(difference(position, slope_from_.counts), settings_.scale);
    const auto share = static_cast<float>(settings_.velocity_bandwidth * passed.seconds());
    dq_ += share / (1 + share) * (static_cast<float>(moved / passed.seconds()) - dq_);
  } else {
    dq_ = 0;
  }
  slope_from_ = {position, received_at};
}

bool Cia402Driver::take_heartbeat(const CanFrame& frame) noexcept {
  const auto state = cia402::decode_heartbeat(frame);
  if (!state) {
    ++malformed_frames_;
    return false;
  }
  const bool was_done = setup_.done();
  switch (*state) {
    case NmtState::operational:
      heartbeat_age_ = 0;
      setup_.take_operational();
      if (was_done || !setup_.done()) break;
      seen_ = true;
      heartbeat_lost_ = false;
      break;
    case NmtState::boot:
      start_over();
      break;
    case NmtState::stopped:
    case NmtState::pre_operational:
      if (was_done) start_over();
      break;
  }
  return true;
}

bool Cia402Driver::take_emergency(const CanFrame& frame) noexcept {
  const auto emergency = cia402::decode_emergency(frame);
  if (emergency)
    emergency_ = emergency->code;
  else
    ++malformed_frames_;
  return emergency.has_value();
}

bool Cia402Driver::take_sdo(const CanFrame& frame) noexcept {
  const auto answer = cia402::decode_sdo_answer(frame);
  const auto segment = cia402::decode_sdo_segment(frame);
  if (answer)
    setup_.take(*answer);
  else if (segment)
    setup_.take(*segment);
  else
    ++malformed_frames_;
  return answer || segment;
}

void Cia402Driver::start_over() noexcept {
  setup_.restart();
  power_ = PowerState::undefined;
  has_reading_ = false;
  emergency_ = 0;
  heartbeat_age_ = 0;
}

void Cia402Driver::refresh_state() noexcept {
  feedback_.error_code = 0;
  if (setup_.fault()) {
    feedback_.drive_state = DriveState::fault;
    feedback_.error_code = setup_.error_code();
  } else if (heartbeat_lost_) {
    feedback_.drive_state = DriveState::fault;
    feedback_.error_code = kHeartbeatLost;
  } else if (!setup_.done() || !has_reading_) {
    feedback_.drive_state = seen_ ? DriveState::disabled : DriveState::unknown;
  } else {
    feedback_.drive_state = drive_state_of(power_);
    if (is_fault(power_)) {
      feedback_.error_code = emergency_ != 0 ? emergency_ : kGenericError;
    } else if (disobedience_ != 0) {
      feedback_.drive_state = DriveState::fault;
      feedback_.error_code = disobedience_;
    }
  }
}

}  // namespace takt::drivers

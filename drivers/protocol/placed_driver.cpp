// SPDX-License-Identifier: Apache-2.0
#include "drivers/protocol/placed_driver.hpp"

#include <algorithm>
#include <cmath>
#include <limits>
#include <numbers>

#include "config/turns.hpp"
#include "drivers/protocol/drive_timeout.hpp"

namespace takt::drivers {

using config::PositionAfterPowerUp;

double place_step(const config::Drive& drive) {
  constexpr double kWholeTurn = 2 * std::numbers::pi;
  switch (drive.position_after_power_up) {
    case PositionAfterPowerUp::within_a_turn:
      return kWholeTurn / drive.gear_ratio;
    case PositionAfterPowerUp::one_of_several:
      return kWholeTurn / drive.places_per_turn;
    case PositionAfterPowerUp::absolute:
    case PositionAfterPowerUp::unknown:
      break;
  }
  return 0;
}

std::optional<PlaceRule> place_rule(const config::RobotConfig& robot, std::size_t index) {
  const config::Joint& joint = robot.joints.at(index);
  const config::Drive& drive = joint.drive;
  const bool has_own_means =
      drive.protocol == config::DriveProtocol::odrive || drive.protocol == config::DriveProtocol::moteus;
  if (has_own_means || drive.position_after_power_up == PositionAfterPowerUp::absolute) return std::nullopt;
  const double most = config::has_packed_ranges(drive.protocol) ? drive.position_range / drive.gear_ratio
                                                                : std::numeric_limits<double>::infinity();
  return PlaceRule{.step = static_cast<float>(place_step(drive)),
                   .by_limits = drive.position_after_power_up == PositionAfterPowerUp::within_a_turn,
                   .low = static_cast<float>(joint.limits.q_min - joint.limits.position_margin),
                   .high = static_cast<float>(joint.limits.q_max + joint.limits.position_margin),
                   .reads_low = static_cast<float>(drive.offset - most),
                   .reads_high = static_cast<float>(drive.offset + most),
                   .fastest = static_cast<float>(joint.limits.velocity_hard * config::turn_of(robot, joint).seconds()),
                   .per_rad = static_cast<float>(config::per_rad(joint))};
}

std::size_t PlacedDriver::encode(bool enable, const DriveSetpoint& setpoint, MonoTime now, MonoTime valid_until,
                                 std::span<CanFrame> out) noexcept {
  silent_ticks_ = std::min(silent_ticks_ + 1, kTicksToDoubt);
  enabled_ = enable;
  if (!enable && silent_ticks_ == kTicksToDoubt) forget();
  DriveSetpoint told = setpoint;
  told.q -= shift_;
  const std::size_t count = driver_->encode(enable && known_, told, now, valid_until, out);
  judge();
  return count;
}

bool PlacedDriver::decode(const ReceivedFrame& received) noexcept {
  if (!driver_->decode(received)) return false;
  const JointFeedback& told = driver_->feedback();
  if (told.received_at.is_set() && told.replies != replies_) take(told.q);
  replies_ = told.replies;
  judge();
  return true;
}

void PlacedDriver::forget() noexcept {
  known_ = false;
  shift_ = 0;
}

void PlacedDriver::take(float read) noexcept {
  const bool is_ticks_business = rule_.by_limits && enabled_;
  if (known_ && !is_ticks_business && is_jump(read)) forget();
  silent_ticks_ = 0;
  last_read_ = read;
  if (!known_ && expected_ && std::abs(read - expected_->q) <= expected_->tolerance) {
    known_ = true;
    shift_ = 0;
  }
  expected_.reset();
  if (!known_ && rule_.by_limits) place(read);
}

bool PlacedDriver::is_jump(float read) const noexcept {
  constexpr float kUnnoticed = 0.05F;  // rad
  const float most = rule_.step > 0
                         ? rule_.step / 2
                         : kUnnoticed * rule_.per_rad + rule_.fastest * static_cast<float>(silent_ticks_ + 1);
  return !(std::abs(read - last_read_) <= most);
}

void PlacedDriver::place(float read) noexcept {
  const float doubt = kPlaceDoubt * rule_.per_rad;
  const float least = std::ceil((rule_.low - doubt - read) / rule_.step);
  const float most = std::floor((rule_.high + doubt - read) / rule_.step);
  if (least != most) return;
  const float shift = least * rule_.step;
  const bool is_inside = read + shift >= rule_.low && read + shift <= rule_.high;
  // From there the drive must be able to say, and to be told, all of where the joint may be.
  if (!is_inside || rule_.low - shift < rule_.reads_low || rule_.high - shift > rule_.reads_high) return;
  known_ = true;
  shift_ = shift;
}

void PlacedDriver::judge() noexcept {
  feedback_ = driver_->feedback();
  feedback_.q = bounded(feedback_.q + shift_);
  const bool is_heard = feedback_.received_at.is_set() && feedback_.drive_state != DriveState::unknown;
  const bool is_silent = silent_ticks_ == kTicksToDoubt;  // its silence is what there is to say of it
  if (known_ || !is_heard || is_silent || feedback_.error_code != 0) return;
  feedback_.drive_state = DriveState::fault;
  feedback_.error_code = setup_fault_code(SetupFault::home_unknown);
}

}  // namespace takt::drivers

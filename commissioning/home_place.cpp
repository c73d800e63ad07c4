// SPDX-License-Identifier: Apache-2.0
#include "commissioning/home_place.hpp"

#include <algorithm>
#include <array>
#include <cmath>
#include <numbers>

#include "drivers/protocol/little_endian.hpp"
#include "drivers/protocol/odrive/odrive_driver.hpp"
#include "drivers/protocol/placed_driver.hpp"
#include "drivers/protocol/shown_unit.hpp"

namespace takt::commissioning {
namespace {

constexpr double kTurn = 2 * std::numbers::pi;
constexpr double kMovedSincePowerUp = 10 * drivers::kDegree;  // rad; of a slide of its motor

double motor_turns(const config::Drive& drive, double q) {
  return (q - drive.offset) * drive.direction * drive.gear_ratio / kTurn;
}

// Register 131, set output exact, in turns: lasts until power-off, and sets the home state.
drivers::CanFrame moteus_output_is(const config::Drive& drive, float turns) {
  constexpr std::array<std::uint8_t, 3> kWriteOneFloat{0x0D, 0xB1, 0x02};
  drivers::CanFrame frame;
  frame.id = drive.id;
  frame.extended = frame.fd = frame.bit_rate_switch = true;
  frame.length = 7;
  std::ranges::copy(kWriteOneFloat, frame.data);
  drivers::put_f32(frame.data + kWriteOneFloat.size(), turns);
  return frame;
}

}  // namespace

bool forgets_home(const config::Drive& drive) {
  return drive.protocol == config::DriveProtocol::moteus ||
         drive.position_after_power_up != config::PositionAfterPowerUp::absolute;
}

std::optional<drivers::CanFrame> home_frame(const config::Joint& joint, double q) {
  const config::Drive& drive = joint.drive;
  const auto turns = static_cast<float>(motor_turns(drive, q));
  if (drive.protocol == config::DriveProtocol::moteus) return moteus_output_is(drive, turns);
  const auto mark = drivers::odrive_home_mark(joint);
  if (drive.protocol != config::DriveProtocol::odrive || !mark) return std::nullopt;
  return drivers::odrive_set_absolute_position(drive.id, mark->turns + turns);
}

std::expected<double, std::string> shift_between(const config::Joint& joint, double read, double at) {
  const double step = drivers::place_step(joint.drive);
  const double shift = step > 0 ? step * std::round((at - read) / step) : at - read;
  const double place = read + shift;
  const double counted = read - joint.drive.offset, least = kMovedSincePowerUp * config::per_rad(joint);
  const auto text_of = [&joint](double q) { return drivers::shown(joint.kind, q); };
  if (step == 0 && std::abs(counted) < least)
    return std::unexpected("its drive reads " + text_of(counted) +
                           ", as it does wherever it is switched on, so that nothing would tell that it was switched "
                           "off since: move the joint by more than " +
                           text_of(least) + ", and say it again");
  if (step > 0 && std::abs(place - at) > step / 4)
    return std::unexpected("its drive reads " + text_of(read) + ", so it is at " + text_of(place) +
                           " or a multiple of " + text_of(step) + " from there, and " + text_of(at) +
                           " is near none of them: look again");
  if (const auto possible = check_place(joint, place); !possible) return std::unexpected(possible.error());
  const config::Limits& limits = joint.limits;
  const double offset = joint.drive.offset + shift;
  const double farthest = std::max(std::abs(limits.q_min - limits.position_margin - offset),
                                   std::abs(limits.q_max + limits.position_margin - offset));
  if (config::has_packed_ranges(joint.drive.protocol) && farthest * joint.drive.gear_ratio > joint.drive.position_range)
    return std::unexpected(
        "from there limits.position reaches beyond the drive's position_range: switch the drive off, "
        "bring the joint nearer to its zero, and switch it on");
  return shift;
}

std::expected<void, std::string> check_place(const config::Joint& joint, double at) {
  const config::Limits& limits = joint.limits;
  if (at >= limits.q_min - limits.position_margin && at <= limits.q_max + limits.position_margin) return {};
  return std::unexpected(drivers::shown(joint.kind, at) + " is outside limits.position " +
                         drivers::shown(joint.kind, limits.q_min) + " to " + drivers::shown(joint.kind, limits.q_max));
}

}  // namespace takt::commissioning

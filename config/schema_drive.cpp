// SPDX-License-Identifier: Apache-2.0
// Keys: joints[].drive. Some belong to one protocol only, and are neither asked for nor accepted with another.
#include <algorithm>
#include <array>
#include <cmath>

#include "config/drive_presets.hpp"
#include "config/joint_keys.hpp"
#include "config/schema.hpp"
#include "config/turns.hpp"

namespace takt::config {
namespace {

constexpr std::array<std::string_view, 5> kProtocols{"mit", "robstride", "odrive", "moteus", "cia402"};
constexpr std::array<std::string_view, 3> kVariants{"tmotor", "damiao", "robstride"};
constexpr std::array<std::string_view, 3> kCia402Modes{"csp", "csv", "cst"};
constexpr std::array<std::string_view, 4> kPositionsAfterPowerUp{"absolute", "unknown", "one_of_several",
                                                                 "within_a_turn"};
constexpr std::array<std::string_view, 5> kVelocityUnits{"counts_per_s", "rpm", "tenth_rpm", "hundredth_rpm",
                                                         "thousandth_rpm"};

// The key table shows the keys of every protocol.
class Speaks {
 public:
  Speaks(const Fields& fields, DriveProtocol protocol) : all_(fields.shows_all()), protocol_(protocol) {}
  [[nodiscard]] bool any_of(std::initializer_list<DriveProtocol> protocols) const {
    return all_ || std::ranges::find(protocols, protocol_) != protocols.end();
  }

 private:
  bool all_;
  DriveProtocol protocol_;
};

std::int64_t highest_id(DriveProtocol protocol) {
  switch (protocol) {
    case DriveProtocol::mit:
      return 0x7FF;
    case DriveProtocol::odrive:
      return 63;
    case DriveProtocol::robstride:
    case DriveProtocol::moteus:
      return 127;
    case DriveProtocol::cia402:
      return 126;  // 127 is this computer's own number
  }
  return 0;
}

std::vector<std::string_view> models_of(const Fields& fields, DriveProtocol protocol) {
  std::vector<std::string_view> models;
  for (const DriveProtocol one : {DriveProtocol::mit, DriveProtocol::robstride}) {
    if (one != protocol && !fields.shows_all()) continue;
    for (const DrivePreset& preset : presets_of(one)) models.push_back(preset.model);
    for (const ModelAlias& alias : kModelAliases)
      if (find_drive_preset(one, alias.name) != nullptr) models.push_back(alias.name);
  }
  return models;
}

void describe_fd_bitrate(Fields& fields, Drive& drive) {
  double rate = drive.fd_bitrate;
  fields.quantity({"fd_bitrate",
                   "mit (damiao): CAN FD data rate of bus and drive (register 35); 0 bit/s: classic frames", "0 bit/s"},
                  rate, Dimension::bit_rate, between(0, 10e6));
  drive.fd_bitrate = static_cast<std::uint32_t>(std::lround(rate));
}

void describe_packed_ranges(Fields& fields, Drive& drive) {
  fields.one_of(
      {.name = "model",
       .doc = "mit, robstride: gives the ranges (docs/drives.md); none: all five are required",
       .otherwise = "none",
       .if_unknown = "for another model write none and the five ranges of its manual (position_range, velocity_range, "
                     "torque_range, kp_range, kd_range)"},
      drive.model, models_of(fields, drive.protocol), "drive model", "none");
  const DrivePreset* preset = find_drive_preset(drive.protocol, drive.model);
  if (preset != nullptr) drive.model = preset->model;  // instead of another name for it
  const bool names_model = !drive.model.empty();       // an unknown one too: it is complained about where it stands
  const std::string unsettled =
      preset == nullptr ? std::string()
                        : "public sources do not settle it for " + drive.model + " (" + std::string(preset->unsettled) +
                              "), and a wrong range scales every command: write what the drive's own manual says";
  const auto range = [&](std::string_view name, std::string_view doc, double& value, double from_preset,
                         Dimension dimension) {
    const bool settled = preset == nullptr || from_preset != kUnsettled;
    if (!settled) return fields.quantity({name, unsettled}, value, dimension, above(0, 1e6));
    if (preset && value == 0) value = from_preset;
    const std::optional<std::string_view> otherwise =
        names_model || fields.shows_all() ? std::optional<std::string_view>("the model's") : std::nullopt;
    fields.quantity({name, doc, otherwise, names_model}, value, dimension, above(0, 1e6));
  };
  constexpr DrivePreset kNone{};
  const DrivePreset& from = preset ? *preset : kNone;
  range("position_range", "mit, robstride: span of packed position, +-, motor side", drive.position_range,
        from.position, Dimension::angle);
  range("velocity_range", "the same of velocity", drive.velocity_range, from.velocity, Dimension::angular_velocity);
  range("torque_range", "largest torque of the drive, motor side; mit, robstride: span of packed torque",
        drive.torque_range, from.torque, Dimension::torque);
  range("kp_range", "mit, robstride: highest packed stiffness", drive.kp_range, from.kp, Dimension::stiffness);
  range("kd_range", "mit, robstride: highest packed damping", drive.kd_range, from.kd, Dimension::damping);
}

// moteus tells it. Damiao and RobStride know their place within a turn, and limits mostly tell the turn. Where it can
// be either, a person says it: a joint that stands elsewhere than it is taken to has no limits.
void describe_position_after_power_up(Fields& fields, Drive& drive) {
  std::optional<std::string_view> otherwise;
  if (drive.variant == "damiao" || drive.variant == "robstride" || drive.protocol == DriveProtocol::robstride)
    otherwise = "within_a_turn";
  if (fields.shows_all()) otherwise = "the protocol's";
  fields.choice({"position_after_power_up",
                 "all but moteus: what a reading is after power-on: absolute, within_a_turn, one_of_several, unknown "
                 "(docs/drives.md); in doubt, `takt joint home` comes before arming; mit (damiao, robstride), "
                 "robstride: within_a_turn; others: required",
                 otherwise},
                drive.position_after_power_up, kPositionsAfterPowerUp);
  if (drive.position_after_power_up == PositionAfterPowerUp::one_of_several || fields.shows_all())
    fields.integer({"places_per_turn", "one_of_several: indistinguishable places in a joint's turn (AK80-9: 9)"},
                   drive.places_per_turn, 2, 1000);
}

void describe_own_units(Fields& fields, Drive& drive, const Speaks& speaks) {
  if (!has_packed_ranges(drive.protocol))
    fields.quantity({"torque_range", "largest torque ever asked of the drive, motor side"}, drive.torque_range,
                    Dimension::torque, above(0, 1e6));
  if (speaks.any_of({DriveProtocol::moteus})) {
    fields.quantity({"servo_kp", "moteus: its servo.pid_position.kp, per radian"}, drive.servo_kp, Dimension::stiffness,
                    above(0, 1e6));
    fields.quantity({"servo_kd", "moteus: its servo.pid_position.kd, per radian"}, drive.servo_kd, Dimension::damping,
                    above(0, 1e6));
  }
  if (speaks.any_of({DriveProtocol::cia402})) {
    fields.choice({"mode", "cia402: cyclic synchronous position, velocity or torque", "cst"}, drive.mode, kCia402Modes);
    fields.integer({"counts_per_turn", "cia402: units of object 6064 per motor turn"}, drive.counts_per_turn, 1,
                   1LL << 30);
    fields.quantity({"rated_torque", "cia402: object 6076 of the drive"}, drive.rated_torque, Dimension::torque,
                    above(0, 1e6));
    if (drive.mode == Cia402Mode::csv || fields.shows_all())
      fields.choice({"velocity_unit", "cia402, csv: unit of object 60FF; compared with 60A9 if present"},
                    drive.velocity_unit, kVelocityUnits);
  }
}

}  // namespace

void describe_drive(Fields& fields, Drive& drive, JointKind kind) {
  if (!fields.choice({"protocol", "protocol of the drive"}, drive.protocol, kProtocols)) return fields.leave_the_rest();
  const Speaks speaks(fields, drive.protocol);
  if (speaks.any_of({DriveProtocol::mit}))
    fields.one_of({"variant", "mit: tmotor replies with 6 bytes, damiao with 8; robstride: switched to this protocol"},
                  drive.variant, kVariants, "variant");
  fields.integer({"id", "mit: CAN id of commands; others: number on the bus"}, drive.id,
                 drive.protocol == DriveProtocol::odrive ? 0 : 1, highest_id(drive.protocol));
  if (speaks.any_of({DriveProtocol::mit}))
    fields.integer({"reply_id", "mit: CAN id of replies"}, drive.reply_id, 0, highest_id(DriveProtocol::mit));
  if (drive.variant == "damiao" || fields.shows_all()) describe_fd_bitrate(fields, drive);
  if (speaks.any_of({DriveProtocol::mit, DriveProtocol::robstride, DriveProtocol::moteus}))
    fields.integer({"every", "mit, robstride, moteus: written to every n-th tick, a stop at once", "1"}, drive.every, 1,
                   kMostTicksPerTurn);
  if (speaks.any_of({DriveProtocol::robstride}))
    fields.integer({"host_id", "robstride: this computer's number on the bus", "253"}, drive.host_id, 128, 253);
  if (speaks.any_of({DriveProtocol::mit, DriveProtocol::robstride, DriveProtocol::odrive, DriveProtocol::cia402}))
    fields.text(
        {"watchdog_waiver",
         "all but moteus: reason to arm although the drive's time-out is off or unknown; none: not armed", "none"},
        drive.watchdog_waiver);
  if (speaks.any_of({DriveProtocol::mit, DriveProtocol::robstride, DriveProtocol::moteus, DriveProtocol::cia402}))
    fields.text({"identity",
                 "mit (damiao), robstride, moteus, cia402 (VENDOR:PRODUCT[:SERIAL]): identity that its card shows; "
                 "any: not compared",
                 "any"},
                drive.identity);
  if (speaks.any_of({DriveProtocol::mit, DriveProtocol::odrive, DriveProtocol::moteus, DriveProtocol::cia402}))
    fields.text(
        {"firmware",
         "mit (damiao), odrive, moteus, cia402 (revision number): version that its card shows; any: not compared",
         "any"},
        drive.firmware);
  if (speaks.any_of({DriveProtocol::mit, DriveProtocol::robstride, DriveProtocol::odrive, DriveProtocol::cia402}))
    describe_position_after_power_up(fields, drive);
  fields.integer({"direction", "1 or -1: q_joint = direction * q_motor / gear_ratio + offset", "1"}, drive.direction,
                 -1, 1);
  const JointKeys keys(fields, kind);
  keys.quantity({"offset", "joint angle at the motor's zero", {{"0 rad", "0 m"}}}, drive.offset, kJointPosition,
                between(-100, 100));
  constexpr std::string_view kDoc =
      "motor turns per joint turn that the drive does not count; slide, required: motor radians per metre";
  JointKey gear{"gear_ratio", kDoc};
  if (kind == JointKind::hinge) gear.otherwise = {"1", ""};
  keys.quantity(gear, drive.gear_ratio, kJointGear, {above(0, 1000), above(0, 1e6)});
  if (has_packed_ranges(drive.protocol) || fields.shows_all()) describe_packed_ranges(fields, drive);
  describe_own_units(fields, drive, speaks);
}

}  // namespace takt::config

// SPDX-License-Identifier: Apache-2.0
// Relations inside buses, joints and the model.
#include <fmt/format.h>

#include <algorithm>
#include <array>
#include <cmath>

#include "config/checks.hpp"
#include "config/drive_ids.hpp"
#include "config/drive_presets.hpp"
#include "config/joint_units.hpp"
#include "config/turns.hpp"

namespace takt::config {
namespace {

constexpr std::uint32_t kDamiaoRegisterId = 0x7FF, kHighestRobstrideId = 0x7F;

std::string joint_path(std::size_t index, std::string_view key) {
  return fmt::format("joints[{}].{}", index, key);
}

// Which drive sent a reply is told by the reply's id and by the id bits inside it: 4 for damiao, 8 for the others.
bool replies_are_told_apart(const Drive& a, const Drive& b) {
  const std::uint32_t mask = a.variant == "damiao" || b.variant == "damiao" ? 0xFU : 0xFFU;
  return a.reply_id != b.reply_id || (a.id & mask) != (b.id & mask);
}

// A RobStride takes bits 8 to 10 of an id for a mode, and obeys in each.
bool obeys(const Drive& drive, std::uint32_t id) {
  return (drive.variant == "robstride" ? id & 0xFFU : id) == drive.id;
}

void check_mit_pair(const Joint& a, const Joint& b, std::size_t i, const std::string& bus, Checker& checker) {
  const std::string id = joint_path(i, "drive.id");
  checker.require(
      !obeys(a.drive, b.drive.id) && !obeys(b.drive, a.drive.id), id,
      fmt::format("CAN id 0x{:x} is already {}'s on bus {}; give each drive its own", a.drive.id, b.name, bus));
  checker.require(!obeys(a.drive, b.drive.reply_id), id,
                  fmt::format("CAN id 0x{:x} is {}'s reply_id on bus {}; choose another", a.drive.id, b.name, bus));
  checker.require(!obeys(b.drive, a.drive.reply_id), joint_path(i, "drive.reply_id"),
                  fmt::format("CAN id 0x{:x} is {}'s id on bus {}; choose another", a.drive.reply_id, b.name, bus));
  checker.require(a.drive.id == b.drive.id || replies_are_told_apart(a.drive, b.drive), joint_path(i, "drive.reply_id"),
                  fmt::format("replies of {} and {} on bus {} cannot be told apart; give each its own reply_id", b.name,
                              a.name, bus));
}

std::vector<IdPattern> all_of(const DriveIds& ids, bool with_broadcasts) {
  std::vector<IdPattern> all = ids.commands;
  all.insert(all.end(), ids.replies.begin(), ids.replies.end());
  if (with_broadcasts) all.insert(all.end(), ids.broadcasts.begin(), ids.broadcasts.end());
  return all;
}

// Drives of one protocol share its broadcasts; those of different protocols must share nothing.
const IdPattern* first_clash(const std::vector<IdPattern>& ours, const std::vector<IdPattern>& theirs) {
  for (const IdPattern& one : ours)
    for (const IdPattern& other : theirs)
      if (overlap(one, other)) return &one;
  return nullptr;
}

void check_pair_on_bus(const RobotConfig& robot, std::size_t i, std::size_t k, Checker& checker) {
  const Joint& a = robot.joints[i];
  const Joint& b = robot.joints[k];
  if (a.bus != b.bus) return;
  const std::string& bus = robot.buses[a.bus].name;
  if (a.drive.protocol == DriveProtocol::mit && b.drive.protocol == DriveProtocol::mit)
    return check_mit_pair(a, b, i, bus, checker);
  const bool mixed = a.drive.protocol != b.drive.protocol;
  const std::vector<IdPattern> ours = all_of(ids_of(a.drive), mixed);
  const IdPattern* const clash = first_clash(ours, all_of(ids_of(b.drive), mixed));
  if (clash == nullptr) return;
  checker.require(false, joint_path(i, "drive.id"),
                  fmt::format("{} and {} on bus {} both use CAN id 0x{:x}{}; give one of them another id or bus",
                              b.name, a.name, bus, clash->id, clash->extended ? " (29 bits)" : ""));
}

// What is known of drives: no more is believed of one.
void check_position_after_power_up(const Drive& drive, std::size_t i, Checker& checker) {
  using enum PositionAfterPowerUp;
  const PositionAfterPowerUp said = drive.position_after_power_up;
  const bool packed = has_packed_ranges(drive.protocol);
  const std::string path = joint_path(i, "drive.position_after_power_up");
  checker.require(packed || said == absolute || said == unknown, path,
                  fmt::format("{} drives count from where they were switched on, or know their place; write unknown or "
                              "absolute",
                              name(drive.protocol)));
  checker.require(said != one_of_several || drive.variant != "damiao", path,
                  "one_of_several is for drives with one encoder, before the gear; write within_a_turn");
  checker.require(drive.model != "CyberGear" || said == unknown, path,
                  "a CyberGear forgets its zero with its supply, and cannot save it; write unknown");
}

// Its places are counted in turns of the joint, of which a slide has none.
void check_place_of_slide(const Joint& joint, std::size_t i, Checker& checker) {
  checker.require(
      joint.kind == JointKind::hinge || joint.drive.position_after_power_up != PositionAfterPowerUp::one_of_several,
      joint_path(i, "drive.position_after_power_up"),
      "one_of_several counts turns of the joint, which a slide has none of; write unknown");
}

void check_drive(const Joint& joint, const Bus& bus, std::size_t i, Checker& checker) {
  const Drive& drive = joint.drive;
  checker.require(drive.protocol != DriveProtocol::moteus || bus.fd, joint_path(i, "bus"),
                  fmt::format("moteus speaks CAN FD; write `fd: true` into bus {}", bus.name));
  checker.require(!joint.passive || drive.protocol != DriveProtocol::cia402 || drive.mode == Cia402Mode::cst,
                  joint_path(i, "drive.mode"),
                  "makes the drive hold a position or speed of its own; a passive joint needs cst");
  checker.require(drive.direction != 0, joint_path(i, "drive.direction"), "0 is no direction; write 1 or -1");
  check_position_after_power_up(drive, i, checker);
  check_place_of_slide(joint, i, checker);
  if (drive.protocol != DriveProtocol::mit) return;
  const DrivePreset* const preset = find_drive_preset(drive.protocol, drive.model);
  checker.require(preset == nullptr || preset->variant == drive.variant, joint_path(i, "drive.variant"),
                  fmt::format("{} is no {} drive: correct variant or model", drive.model, drive.variant));
  // A T-Motor drive may reply with the id that it hears.
  checker.require(!obeys(drive, drive.reply_id) || drive.variant == "tmotor", joint_path(i, "drive.reply_id"),
                  fmt::format("0x{:x} is the drive's own id; choose another", drive.reply_id));
  checker.require(
      drive.variant != "robstride" || drive.id <= kHighestRobstrideId, joint_path(i, "drive.id"),
      fmt::format("is at most 0x{:x} of a RobStride, which takes higher bits for a mode", kHighestRobstrideId));
  if (drive.variant == "damiao")
    checker.require(drive.id != kDamiaoRegisterId && drive.reply_id != kDamiaoRegisterId, joint_path(i, "drive.id"),
                    "0x7FF is the register channel of damiao drives; choose another");
}

// Codes of register 35 above 1 Mbit/s, on which the sources agree (drivers/protocol/mit/damiao_registers.hpp).
constexpr std::array<std::uint32_t, 5> kDamiaoDataRates{2'000'000, 2'500'000, 3'200'000, 4'000'000, 5'000'000};

void check_fd_bitrate(const Joint& joint, const Bus& bus, std::size_t i, Checker& checker) {
  if (joint.drive.fd_bitrate == 0) return;
  const std::string path = joint_path(i, "drive.fd_bitrate");
  checker.require(bus.fd, path, fmt::format("the drive speaks CAN FD; write `fd: true` into bus {}", bus.name));
  if (!bus.fd) return;
  checker.require(bus.bitrate == 1'000'000, path,
                  fmt::format("bus {} has {} bit/s; Damiao drives are known to speak CAN FD at 1 Mbit/s alone",
                              bus.name, bus.bitrate));
  checker.require(joint.drive.fd_bitrate == bus.data_bitrate, path,
                  fmt::format("bus {} has a data_bitrate of {} bit/s, and all on a bus have the same; write it in both",
                              bus.name, bus.data_bitrate));
  checker.require(
      std::ranges::find(kDamiaoDataRates, joint.drive.fd_bitrate) != kDamiaoDataRates.end(), path,
      fmt::format("{} bit/s is no rate that Damiao drives are known to have; write 2, 2.5, 3.2, 4 or 5 Mbit/s",
                  joint.drive.fd_bitrate));
}

// A drive that is seldom written to goes on with what it was told last: it must not give up between two turns, nor may
// what holds it inside its limits come too seldom.
void check_turn(const RobotConfig& robot, std::size_t i, Checker& checker) {
  const Joint& joint = robot.joints[i];
  if (joint.drive.every <= 1) return;
  constexpr Duration kLongestTurn = milliseconds(25);  // half of the shortest time-out that drives are given
  const Duration turn = turn_of(robot, joint);
  const std::string path = joint_path(i, "drive.every");
  checker.require(turn <= kLongestTurn, path,
                  fmt::format("every {} ticks is {}; at most {} are: drives give up by themselves soon after",
                              joint.drive.every, format_duration(turn), format_duration(kLongestTurn)));
  checker.require(robot.feedback.timeout.ns >= 2 * turn.ns, path,
                  fmt::format("a reply every {} leaves no room for one lost within feedback.timeout {}; lower it, or "
                              "raise the time-out",
                              format_duration(turn), format_duration(robot.feedback.timeout)));
  checker.require(joint.passive || turn.seconds() * joint.observer_bandwidth <= 1, path,
                  fmt::format("turn {} * observer_bandwidth {:.4g} rad/s exceeds 1: the torque barriers would answer "
                              "too seldom; lower either",
                              format_duration(turn), joint.observer_bandwidth));
}

bool tells_temperature(const Drive& drive) {
  return drive.protocol != DriveProtocol::cia402;
}
bool tells_casing(const Drive& drive) {
  return drive.variant == "damiao" || drive.protocol == DriveProtocol::odrive ||
         drive.protocol == DriveProtocol::moteus;
}

// A limit on what the drive never tells would keep the robot from arming for ever.
void check_temperature(const Joint& joint, std::size_t i, Checker& checker) {
  if (!joint.limits.temperature) return;
  const TemperatureLimits& limits = *joint.limits.temperature;
  const std::string path = joint_path(i, "limits.temperature");
  checker.require(tells_temperature(joint.drive), path,
                  "cia402 has no object for it that every drive has, so none is read; drop the section");
  checker.require(tells_casing(joint.drive) || (limits.casing_warning == 0 && limits.casing_stop == 0), path,
                  "this drive tells one temperature; drop casing_warning and casing_stop");
  const auto in_order = [&](double warning, double stop, std::string_view what) {
    checker.require(
        warning == 0 || stop == 0 || warning < stop, path,
        fmt::format("{}warning {:g} degC is not below {}stop {:g} degC; lower it", what, warning, what, stop));
  };
  in_order(limits.warning, limits.stop, "");
  in_order(limits.casing_warning, limits.casing_stop, "casing_");
}

// What the drive can express must contain what the joint is allowed to do.
void check_drive_ranges(const Joint& joint, std::size_t i, Checker& checker) {
  const Drive& drive = joint.drive;
  const Limits& limits = joint.limits;
  const double gear = drive.gear_ratio;
  const double farthest = std::max(std::abs(limits.q_min - limits.position_margin - drive.offset),
                                   std::abs(limits.q_max + limits.position_margin - drive.offset));
  const auto require = [&](double needed, double range, std::string_view key, std::string_view formula,
                           std::string_view unit) {
    checker.require(
        needed <= range, joint_path(i, key),
        fmt::format("{} = {:.6g} {} exceeds the drive's range {:.6g} {}; narrow the limit or check the model", formula,
                    needed, unit, range, unit));
  };
  require(limits.torque / gear, drive.torque_range, "limits.torque", "torque / gear_ratio", "Nm");
  if (!has_packed_ranges(drive.protocol)) return;
  require(farthest * gear, drive.position_range, "limits.position", "(|position| + margin - offset) * gear_ratio",
          "rad");
  require(limits.velocity_hard * gear, drive.velocity_range, "limits.velocity_hard", "velocity_hard * gear_ratio",
          "rad/s");
  require(limits.kp / (gear * gear), drive.kp_range, "limits.kp", "kp / gear_ratio^2", "Nm/rad");
  require(limits.kd / (gear * gear), drive.kd_range, "limits.kd", "kd / gear_ratio^2", "Nms/rad");
}

void check_limits_and_gains(const Joint& joint, std::size_t i, Checker& checker) {
  const Limits& limits = joint.limits;
  checker.require(limits.velocity_hard >= limits.velocity, joint_path(i, "limits.velocity_hard"),
                  fmt::format("{0} {2} is below velocity {1} {2}; raise it", limits.velocity_hard, limits.velocity,
                              kJointVelocity.unit(joint.kind)));
  checker.require(joint.home >= limits.q_min && joint.home <= limits.q_max, joint_path(i, "home"),
                  fmt::format("{0} {3} is outside limits.position [{1:.4g}, {2:.4g}] {3}; move it inside", joint.home,
                              limits.q_min, limits.q_max, kJointPosition.unit(joint.kind)));
  if (joint.passive) return;
  const double braking = limits.velocity * limits.velocity / (2 * limits.acceleration);
  checker.require(
      braking <= limits.q_max - limits.q_min, joint_path(i, "limits.acceleration"),
      fmt::format("velocity^2 / (2 * acceleration) = {0:.4g} {2} of braking exceeds the range of {1:.4g} {2}; "
                  "raise it or lower velocity",
                  braking, limits.q_max - limits.q_min, kJointPosition.unit(joint.kind)));
  checker.require(joint.kp <= limits.kp, joint_path(i, "gains.kp"),
                  fmt::format("{} exceeds limits.kp {} {}; lower it or raise the limit", joint.kp, limits.kp,
                              kJointStiffness.unit(joint.kind)));
  checker.require(joint.kd <= limits.kd, joint_path(i, "gains.kd"),
                  fmt::format("{} exceeds limits.kd {} {}; lower it or raise the limit", joint.kd, limits.kd,
                              kJointDamping.unit(joint.kind)));
  checker.require(joint.damping <= limits.kd, joint_path(i, "gains.damping"),
                  fmt::format("{} exceeds limits.kd {} {}; lower it or raise the limit", joint.damping, limits.kd,
                              kJointDamping.unit(joint.kind)));
}

void check_link(const Link& link, std::size_t i, Checker& checker) {
  const std::string path = fmt::format("model.links[{}]", i);
  checker.require(std::hypot(link.axis[0], link.axis[1], link.axis[2]) > 1e-6, path + ".axis",
                  "has no direction; write a vector such as [0, 0, 1]");
  const double sum = link.inertia[0] + link.inertia[1] + link.inertia[2];
  checker.require(std::ranges::all_of(link.inertia, [sum](double one) { return 2 * one <= sum * (1 + 1e-9); }),
                  path + ".inertia",
                  "one moment exceeds the sum of the other two, which no body has; check the numbers");
}

}  // namespace

void check_buses_and_ids(const RobotConfig& robot, Checker& checker) {
  for (std::size_t i = 0; i < robot.buses.size(); ++i)
    for (std::size_t k = 0; k < i; ++k)
      checker.require(robot.buses[i].interface != robot.buses[k].interface, fmt::format("buses[{}].interface", i),
                      fmt::format("interface `{}` already belongs to bus `{}`; each bus needs its own",
                                  robot.buses[i].interface, robot.buses[k].name));
  for (std::size_t i = 0; i < robot.joints.size(); ++i)
    for (std::size_t k = 0; k < i; ++k) check_pair_on_bus(robot, i, k, checker);
}

void check_drives(const RobotConfig& robot, Checker& checker) {
  for (std::size_t i = 0; i < robot.joints.size(); ++i) {
    const Joint& joint = robot.joints[i];
    check_drive(joint, robot.buses[joint.bus], i, checker);
    check_fd_bitrate(joint, robot.buses[joint.bus], i, checker);
    check_turn(robot, i, checker);
    check_temperature(joint, i, checker);
  }
}

void check_joints(const RobotConfig& robot, Checker& checker) {
  checker.require(!std::ranges::all_of(robot.joints, &Joint::passive), "joints",
                  "are all passive: nothing could move; make one of them a driven joint");
  for (std::size_t i = 0; i < robot.joints.size(); ++i) {
    const Joint& joint = robot.joints[i];
    check_drive_ranges(joint, i, checker);
    check_limits_and_gains(joint, i, checker);
  }
}

void check_model(const RobotConfig& robot, Checker& checker) {
  if (!robot.model) return;
  const std::vector<Link>& links = robot.model->links;
  checker.require(links.size() == robot.joints.size(), "model.links",
                  fmt::format("has {} links for {} joints; write one per joint", links.size(), robot.joints.size()));
  for (std::size_t i = 0; i < links.size(); ++i) {
    check_link(links[i], i, checker);
    checker.require(links[i].joint != "base", fmt::format("model.links[{}].joint", i),
                    "`base` is what a link's parent calls the robot's base; rename the joint");
    if (i < robot.joints.size())
      checker.require(
          links[i].joint == robot.joints[i].name, fmt::format("model.links[{}].joint", i),
          fmt::format("`{}` stands where `{}` belongs; keep the joints' order", links[i].joint, robot.joints[i].name));
  }
}

}  // namespace takt::config

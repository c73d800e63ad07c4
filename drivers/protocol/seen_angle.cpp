// SPDX-License-Identifier: Apache-2.0
#include "drivers/protocol/seen_angle.hpp"

#include <algorithm>
#include <array>
#include <cmath>
#include <cstdio>
#include <filesystem>
#include <fstream>
#include <sstream>

#include "drivers/protocol/shown_unit.hpp"

namespace takt::drivers {
namespace {

std::string signed_text(config::JointKind kind, double moved) {
  return (std::signbit(moved) ? "" : "+") + shown(kind, moved);
}

std::string number(double value) {
  std::array<char, 32> text{};
  std::snprintf(text.data(), text.size(), "%.3g", value);
  return text.data();
}

// To two digits: an eye tells no more.
std::string about(double value) {
  if (!(value > 0) || !std::isfinite(value)) return number(value);
  const double digit = std::pow(10, std::floor(std::log10(value)) - 1);
  return number(std::round(value / digit) * digit);
}

// Joints by number: their names may hold anything.
std::string angle_file(const std::string& directory, std::size_t joint) {
  return directory + "/seen-" + std::to_string(joint);
}

// All that scales what a drive tells.
std::string scale_of(const config::Joint& joint) {
  const config::Drive& drive = joint.drive;
  std::ostringstream text;
  text.precision(17);
  text << config::name(drive.protocol) << ' ' << drive.variant << ' ' << drive.id << ' ' << drive.direction << ' '
       << drive.gear_ratio << ' ' << drive.position_range << ' ' << drive.counts_per_turn << ' ' << drive.identity;
  if (joint.kind == config::JointKind::slide) text << " slide";
  return text.str();
}

const char* other_scale(config::DriveProtocol protocol) {
  switch (protocol) {
    case config::DriveProtocol::mit:
    case config::DriveProtocol::robstride:
      return ", or position_range is another than the drive's";
    case config::DriveProtocol::cia402:
      return ", or counts_per_turn is another than the drive's";
    case config::DriveProtocol::odrive:
    case config::DriveProtocol::moteus:
      break;
  }
  return "";
}

}  // namespace

std::string contradicted_by_eye(const config::Joint& joint, const SeenAngle& angle) {
  const config::Drive& drive = joint.drive;
  const double least = shown_unit(joint.kind).size, within = std::max(least, kSeenShare * std::abs(angle.moved));
  if (std::abs(angle.seen - angle.moved) <= within) return {};
  const std::string told = "you saw " + signed_text(joint.kind, angle.seen) + ", its drive told " +
                           signed_text(joint.kind, angle.moved) + ": ";
  if (!(std::abs(angle.seen) > least)) return told + "another joint moved, or none";
  if (std::abs(angle.seen + angle.moved) <= within) return told + "direction is the opposite";
  const char* const gear_unit = joint.kind == config::JointKind::slide ? " rad/m" : "";
  return told + "gear_ratio is " + about(drive.gear_ratio * std::abs(angle.moved / angle.seen)) + gear_unit +
         " by that, the robot file says " + number(drive.gear_ratio) + gear_unit + other_scale(drive.protocol);
}

std::string text_of(config::JointKind kind, const SeenAngle& angle) {
  return signed_text(kind, angle.seen) + " seen where the drive told " + signed_text(kind, angle.moved) + ", " +
         angle.day;
}

std::expected<void, std::string> keep_seen_angle(const std::string& runtime_directory, const config::RobotConfig& robot,
                                                 std::size_t joint, const std::optional<SeenAngle>& angle) {
  const std::string path = angle_file(runtime_directory, joint), unfinished = path + ".new";
  std::error_code failed;
  if (!angle) {
    std::filesystem::remove(path, failed);
    if (!failed) return {};
    return std::unexpected("cannot remove " + path + ": see to the directory, or name another with --runtime-dir");
  }
  std::filesystem::create_directories(runtime_directory, failed);
  std::ofstream file(unfinished);
  file.precision(17);
  file << angle->day << ' ' << angle->moved << ' ' << angle->seen << '\n' << scale_of(robot.joints.at(joint)) << '\n';
  file.close();
  if (file) std::filesystem::rename(unfinished, path, failed);
  if (!file || failed)
    return std::unexpected("cannot write " + path + ": see to the directory, or name another with --runtime-dir");
  return {};
}

std::optional<SeenAngle> seen_angle(const std::string& runtime_directory, const config::RobotConfig& robot,
                                    std::size_t joint) {
  std::ifstream file(angle_file(runtime_directory, joint));
  SeenAngle angle;
  std::string scale;
  if (!(file >> angle.day >> angle.moved >> angle.seen >> std::ws) || !std::getline(file, scale)) return std::nullopt;
  const bool holds = std::isfinite(angle.moved) && std::isfinite(angle.seen) &&
                     scale == scale_of(robot.joints.at(joint)) &&
                     contradicted_by_eye(robot.joints[joint], angle).empty();
  return holds ? std::optional(angle) : std::nullopt;
}

}  // namespace takt::drivers

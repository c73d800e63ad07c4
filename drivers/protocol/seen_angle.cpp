// SPDX-License-Identifier: Apache-2.0
#include "drivers/protocol/seen_angle.hpp"

#include <algorithm>
#include <array>
#include <cmath>
#include <cstdio>
#include <filesystem>
#include <fstream>
#include <numbers>
#include <sstream>

namespace takt::drivers {
namespace {

double degrees_of(double rad) {
  return rad * 180 / std::numbers::pi;
}

std::string signed_degrees(double rad) {
  std::array<char, 48> text{};
  std::snprintf(text.data(), text.size(), "%+.1f deg", degrees_of(rad));
  return text.data();
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
std::string file_of(const std::string& directory, std::size_t joint) {
  return directory + "/seen-" + std::to_string(joint);
}

// All that scales what a drive tells.
std::string scale_of(const config::Drive& drive) {
  std::ostringstream text;
  text.precision(17);
  text << config::name(drive.protocol) << ' ' << drive.variant << ' ' << drive.id << ' ' << drive.direction << ' '
       << drive.gear_ratio << ' ' << drive.position_range << ' ' << drive.counts_per_turn << ' ' << drive.identity;
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

std::string contradicted_by_eye(const config::Drive& drive, const SeenAngle& angle) {
  const double within = std::max(kSeenWithin, kSeenShare * std::abs(angle.moved));
  if (std::abs(angle.seen - angle.moved) <= within) return {};
  const std::string told =
      "you saw " + signed_degrees(angle.seen) + ", its drive told " + signed_degrees(angle.moved) + ": ";
  if (!(std::abs(angle.seen) > kSeenWithin)) return told + "another joint turned, or none";
  if (std::abs(angle.seen + angle.moved) <= within) return told + "direction is the opposite";
  return told + "gear_ratio is " + about(drive.gear_ratio * std::abs(angle.moved / angle.seen)) +
         " by that, the robot file says " + number(drive.gear_ratio) + other_scale(drive.protocol);
}

std::string text_of(const SeenAngle& angle) {
  return signed_degrees(angle.seen) + " seen where the drive told " + signed_degrees(angle.moved) + ", " + angle.day;
}

std::expected<void, std::string> keep_seen_angle(const std::string& runtime_directory, const config::RobotConfig& robot,
                                                 std::size_t joint, const std::optional<SeenAngle>& angle) {
  const std::string path = file_of(runtime_directory, joint), unfinished = path + ".new";
  std::error_code failed;
  if (!angle) {
    std::filesystem::remove(path, failed);
    if (!failed) return {};
    return std::unexpected("cannot remove " + path + ": see to the directory, or name another with --runtime-dir");
  }
  std::filesystem::create_directories(runtime_directory, failed);
  std::ofstream file(unfinished);
  file.precision(17);
  file << angle->day << ' ' << angle->moved << ' ' << angle->seen << '\n'
       << scale_of(robot.joints.at(joint).drive) << '\n';
  file.close();
  if (file) std::filesystem::rename(unfinished, path, failed);
  if (!file || failed)
    return std::unexpected("cannot write " + path + ": see to the directory, or name another with --runtime-dir");
  return {};
}

std::optional<SeenAngle> seen_angle(const std::string& runtime_directory, const config::RobotConfig& robot,
                                    std::size_t joint) {
  std::ifstream file(file_of(runtime_directory, joint));
  SeenAngle angle;
  std::string scale;
  if (!(file >> angle.day >> angle.moved >> angle.seen >> std::ws) || !std::getline(file, scale)) return std::nullopt;
  const bool holds = std::isfinite(angle.moved) && std::isfinite(angle.seen) &&
                     scale == scale_of(robot.joints.at(joint).drive) &&
                     contradicted_by_eye(robot.joints[joint].drive, angle).empty();
  return holds ? std::optional(angle) : std::nullopt;
}

}  // namespace takt::drivers

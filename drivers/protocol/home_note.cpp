// SPDX-License-Identifier: Apache-2.0
#include "drivers/protocol/home_note.hpp"

#include <cmath>
#include <ctime>
#include <filesystem>
#include <fstream>

namespace takt::drivers {
namespace {

// Joints by number: their names may hold anything.
std::string note_file(const std::string& directory, std::size_t joint) {
  return directory + "/home-" + std::to_string(joint);
}

std::string boot_id() {
  std::string id;
  std::ifstream("/proc/sys/kernel/random/boot_id") >> id;
  return id;
}

// Goes on while the computer sleeps.
std::int64_t since_boot_ns() {
  timespec now{};
  ::clock_gettime(CLOCK_BOOTTIME, &now);
  return std::int64_t{now.tv_sec} * 1'000'000'000 + now.tv_nsec;
}

bool cannot_be_told(const config::Drive& drive) {
  return drive.position_after_power_up != config::PositionAfterPowerUp::absolute &&
         drive.protocol != config::DriveProtocol::odrive && drive.protocol != config::DriveProtocol::moteus;
}

std::optional<HomeNote> read_note(const std::string& path, const config::RobotConfig& robot) {
  std::ifstream file(path);
  std::string boot;
  std::uint64_t hash = 0;
  std::int64_t at = 0;
  HomeNote note;
  if (!(file >> boot >> hash >> at >> note.shift >> note.left_at)) return std::nullopt;
  const std::int64_t age = since_boot_ns() - at;
  const bool holds = boot == boot_id() && hash == robot.hash && age >= 0 && age <= kHomeNoteLasts.ns &&
                     std::isfinite(note.shift) && std::isfinite(note.left_at);
  return holds ? std::optional(note) : std::nullopt;
}

}  // namespace

std::expected<void, std::string> write_home_note(const std::string& runtime_directory, const config::RobotConfig& robot,
                                                 std::size_t joint, const HomeNote& note) {
  const std::string path = note_file(runtime_directory, joint), unfinished = path + ".new";
  std::error_code failed;
  std::filesystem::create_directories(runtime_directory, failed);
  std::ofstream file(unfinished);
  file.precision(17);
  file << boot_id() << ' ' << robot.hash << ' ' << since_boot_ns() << ' ' << note.shift << ' ' << note.left_at << '\n';
  file.close();
  if (file) std::filesystem::rename(unfinished, path, failed);
  if (!file || failed)
    return std::unexpected("cannot write " + path + ": see to the directory, or name another with --runtime-dir");
  return {};
}

std::vector<std::optional<HomeNote>> home_notes(const std::string& runtime_directory,
                                                const config::RobotConfig& robot) {
  std::vector<std::optional<HomeNote>> notes;
  for (std::size_t joint = 0; joint < robot.joints.size(); ++joint)
    notes.push_back(cannot_be_told(robot.joints[joint].drive) ? read_note(note_file(runtime_directory, joint), robot)
                                                              : std::nullopt);
  return notes;
}

std::vector<std::optional<HomeNote>> take_home_notes(const std::string& runtime_directory,
                                                     const config::RobotConfig& robot) {
  auto notes = home_notes(runtime_directory, robot);
  for (std::size_t joint = 0; joint < robot.joints.size(); ++joint) {
    if (!cannot_be_told(robot.joints[joint].drive)) continue;
    std::error_code failed;
    const bool gone = std::filesystem::remove(note_file(runtime_directory, joint), failed);
    if (!gone) notes[joint].reset();  // it would hold again and again
  }
  return notes;
}

config::RobotConfig homed_robot(const config::RobotConfig& robot, std::span<const std::optional<HomeNote>> notes) {
  config::RobotConfig homed = robot;
  for (std::size_t joint = 0; joint < notes.size(); ++joint)
    if (notes[joint]) homed.joints[joint].drive.offset += notes[joint]->shift;
  return homed;
}

}  // namespace takt::drivers

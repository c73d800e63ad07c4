// SPDX-License-Identifier: Apache-2.0
#include "cli/running_robots.hpp"

#include <fmt/format.h>
#include <sys/stat.h>
#include <unistd.h>

#include <algorithm>
#include <cerrno>
#include <cstring>
#include <filesystem>
#include <fstream>
#include <iterator>
#include <nlohmann/json.hpp>

#include "config/paths.hpp"
#include "config/printable.hpp"
#include "executive/ipc/unix_socket.hpp"

namespace takt::cli {
namespace {

namespace fs = std::filesystem;

// A folder below /tmp may be another user's trap.
bool is_own_folder(const std::string& path) {
  struct stat status {};
  return lstat(path.c_str(), &status) == 0 && S_ISDIR(status.st_mode) && status.st_uid == geteuid();
}

std::vector<std::string> folders_in(const std::string& place) {
  std::vector<std::string> found;
  std::error_code error;
  for (fs::directory_iterator at(place, error), end; !error && at != end; at.increment(error)) {
    std::error_code ignored;
    if (at->is_directory(ignored) && !at->is_symlink(ignored)) found.push_back(at->path().string());
  }
  std::ranges::sort(found);
  return found;
}

// Without permission to look, nothing is known of a robot there.
bool may_run_in(const std::string& directory) {
  const std::string socket = config::executive_socket(directory);
  return access(directory.c_str(), X_OK) == 0 && ipc::may_listen(socket);
}

// At most so much of a file, for a stranger may have written it.
std::string start_of(const std::string& path) {
  constexpr std::size_t kMostBytes = 64 * 1024;
  std::ifstream file(path, std::ios::binary);
  std::string text(kMostBytes, '\0');
  file.read(text.data(), static_cast<std::streamsize>(text.size()));
  text.resize(static_cast<std::size_t>(std::max<std::streamsize>(0, file.gcount())));
  return text;
}

// What the executive wrote of itself; discarded where it is not there.
nlohmann::json executive_json(const std::string& directory) {
  return nlohmann::json::parse(start_of(directory + "/executive.json"), nullptr, false);
}

// Printable; `otherwise` where it is not said.
std::string text_in(const nlohmann::json& json, const char* key, const std::string& otherwise) {
  const bool says = json.is_object() && json.contains(key) && json[key].is_string();
  return config::printable(says ? json[key].get<std::string>() : otherwise);
}

std::string name_of_robot_in(const std::string& directory) {
  return text_in(executive_json(directory), "robot", fs::path(directory).filename().string());
}

// Of the process with this folder in /proc; empty: it is no executive of this user, or has the usual one.
std::string runtime_directory_of_executive(const fs::path& process) {
  if (start_of(process / "comm") != "takt-executive\n") return {};
  if (!start_of(process / "status").contains(fmt::format("\nUid:\t{0}\t{0}\t", geteuid()))) return {};
  constexpr std::string_view kOption = "--runtime-dir";
  const std::string words = start_of(process / "cmdline");
  std::string directory;
  for (std::size_t begin = 0; begin < words.size();) {
    const std::string word = words.c_str() + begin;
    begin += word.size() + 1;
    if (word == kOption && begin < words.size()) directory = words.c_str() + begin;
    if (word.starts_with(std::string(kOption) + '=')) directory = word.substr(kOption.size() + 1);
  }
  if (directory.empty() || directory.starts_with('/')) return directory;
  std::error_code error;
  const fs::path cwd = fs::read_symlink(process / "cwd", error);
  return error ? std::string() : (cwd / directory).lexically_normal().string();
}

std::string described(const std::string& place) {
  const bool is_there = access(place.c_str(), F_OK) == 0;
  return is_there && access(place.c_str(), R_OK | X_OK) != 0 ? place + " (no permission: use sudo, or run as user takt)"
                                                             : place;
}

Refusal none_runs(const RobotPlaces& places, const std::string& name) {
  const std::string looked = places.home == places.services
                                 ? described(places.home)
                                 : described(places.services) + " and " + described(places.home);
  return {kExitUnavailable,
          fmt::format("no robot{} runs: looked in {}; start one with `takt run FILE`, or name its --runtime-dir",
                      name.empty() ? "" : " `" + name + "`", looked)};
}

Refusal several_run(const std::vector<RunningRobot>& robots) {
  std::string lines = fmt::format("{} robots run here; which one?", robots.size());
  for (const RunningRobot& robot : robots)
    lines += fmt::format("\n  {}: --runtime-dir {}", robot.name, robot.runtime_directory);
  return {kExitUsage, lines};
}

}  // namespace

RobotPlaces places_of_this_user() {
  return {config::kServiceRuntimeDirectory, config::runtime_home()};
}

std::vector<std::string> possible_runtime_directories(const RobotPlaces& places) {
  std::vector<std::string> all{places.services};
  std::ranges::move(folders_in(places.services), std::back_inserter(all));
  if (places.home != places.services && is_own_folder(places.home))
    std::ranges::move(folders_in(places.home), std::back_inserter(all));
  return all;
}

std::vector<RunningRobot> running_robots(const RobotPlaces& places) {
  std::vector<RunningRobot> robots;
  for (const std::string& directory : possible_runtime_directories(places))
    if (may_run_in(directory)) robots.push_back({name_of_robot_in(directory), directory});
  return robots;
}

std::vector<RunningRobot> running_robots_anywhere(const RobotPlaces& places) {
  std::vector<RunningRobot> robots = running_robots(places);
  std::error_code error;
  for (fs::directory_iterator at("/proc", error), end; !error && at != end; at.increment(error)) {
    const std::string directory = runtime_directory_of_executive(at->path());
    const bool is_known = std::ranges::find(robots, directory, &RunningRobot::runtime_directory) != robots.end();
    if (!directory.empty() && !is_known && may_run_in(directory))
      robots.push_back({name_of_robot_in(directory), directory});
  }
  return robots;
}

std::expected<RunningRobot, Refusal> the_running_robot(const RobotPlaces& places, const std::string& name) {
  std::vector<RunningRobot> robots = running_robots(places);
  if (!name.empty()) std::erase_if(robots, [&name](const RunningRobot& robot) { return robot.name != name; });
  if (robots.empty()) return std::unexpected(none_runs(places, name));
  if (robots.size() > 1) return std::unexpected(several_run(robots));
  return robots.front();
}

WhatRuns what_runs_in(const std::string& directory) {
  const nlohmann::json json = executive_json(directory);
  const bool has_cpu = json.is_object() && json.contains("cpu") && json["cpu"].is_number_integer();
  return {.robot = text_in(json, "robot", ""),
          .file = config::printable(remembered_robot_file(directory)),
          .config_hash = text_in(json, "config_hash", ""),
          .policy_hash = text_in(json, "policy_hash", ""),
          .version = text_in(json, "version", ""),
          .cpu = has_cpu ? std::optional(json["cpu"].get<int>()) : std::nullopt};
}

std::expected<void, std::string> make_runtime_home(const std::string& home) {
  std::error_code ignored;
  fs::create_directories(fs::path(home).parent_path(), ignored);
  if (mkdir(home.c_str(), S_IRWXU) != 0 && errno != EEXIST)
    return std::unexpected(fmt::format("{} cannot be made: {}; name a --runtime-dir", home, std::strerror(errno)));
  if (geteuid() != 0 && !is_own_folder(home))
    return std::unexpected(fmt::format("{} is another user's; name a --runtime-dir", home));
  return {};
}

void remember_robot_file(const std::string& runtime_directory, const std::string& robot_file) {
  std::error_code error;
  fs::create_directories(fs::path(runtime_directory).parent_path(), error);
  mkdir(runtime_directory.c_str(), S_IRWXU | S_IRGRP | S_IXGRP);  // as the executive would make it
  const fs::path file = fs::canonical(robot_file, error);
  if (error) return;
  fs::remove(runtime_directory + "/.robot.yaml", error);
  fs::create_symlink(file, runtime_directory + "/.robot.yaml", error);
}

std::string remembered_robot_file(const std::string& runtime_directory) {
  for (const char* const name : {"/.robot/robot.yaml", "/.robot.yaml"}) {
    std::error_code error;
    const fs::path file = fs::canonical(runtime_directory + name, error);  // paths in it count from where it lies
    if (!error) return file.string();
  }
  return {};
}

}  // namespace takt::cli

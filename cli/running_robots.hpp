// SPDX-License-Identifier: Apache-2.0
// The robots that run on this machine, as far as their sockets tell: the systemd units' in /run/takt, and those of this
// user, one folder each in config::runtime_home(). A folder whose socket no process serves is stale and passed over.
// Thread rule: one thread. Asking may take half a second for each executive that does not answer.
#pragma once

#include <expected>
#include <optional>
#include <string>
#include <vector>

#include "cli/command.hpp"

namespace takt::cli {

// Where robots may run. The folders in `services` count too: root's `takt run` makes them there.
struct RobotPlaces {
  std::string services, home;
};
RobotPlaces places_of_this_user();

// Whether one runs there or not.
std::vector<std::string> possible_runtime_directories(const RobotPlaces& places);

struct RunningRobot {
  std::string name;  // as its executive says, else its folder's; printable
  std::string runtime_directory;
};
// One that is there but does not answer is a running robot too.
std::vector<RunningRobot> running_robots(const RobotPlaces& places);

// Those, and the executives of this user with a runtime directory of their own, by their command lines in /proc.
std::vector<RunningRobot> running_robots_anywhere(const RobotPlaces& places);

// The one that runs; `name` not empty: the one of that name. Refused with 69 when there is none, with 64 and one line
// per robot when there are several.
std::expected<RunningRobot, Refusal> the_running_robot(const RobotPlaces& places, const std::string& name);

// What an executive said of itself at its start, and the robot file that was left for it, of a deployment its own.
// Printable; empty: not known.
struct WhatRuns {
  std::string robot, file, config_hash, policy_hash, version;
  std::optional<int> cpu{};  // of the control thread
};
WhatRuns what_runs_in(const std::string& directory);

// Makes the user's own folder, which no other user may write to; the error says why it must not be used.
std::expected<void, std::string> make_runtime_home(const std::string& home);

// So that `takt top` finds the robot file by itself; the units leave .robot/robot.yaml there.
void remember_robot_file(const std::string& runtime_directory, const std::string& robot_file);
// Empty: none was left.
std::string remembered_robot_file(const std::string& runtime_directory);

}  // namespace takt::cli

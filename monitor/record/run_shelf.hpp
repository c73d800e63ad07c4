// SPDX-License-Identifier: Apache-2.0
// The run folders of one directory, such as record.directory: what they are, which of them record.keep deletes, and for
// how long there is room for more. Reads small files and sizes; nothing here waits for a robot.
// Thread rule: none; what another process changes meanwhile is seen or not.
#pragma once

#include <cstdint>
#include <expected>
#include <string>
#include <vector>

#include "config/robot_config.hpp"

namespace takt::monitor {

struct ShelvedRun {
  std::string folder, name, robot;
  std::int64_t began_unix_ns = 0;
  double seconds = 0;       // of those that go on: so far
  std::uint64_t bytes = 0;  // of all its files
  std::string ended;        // how it ended, or that it goes on
  bool goes_on = false;     // not closed, and written to within the last ten minutes
  bool is_kept = false;     // `takt runs keep`
  bool is_telling = false;  // holds an incident that nobody asked for or a mark, or nobody knows
};

// Oldest first; what is no run folder is left out. `now`: Unix time.
std::vector<ShelvedRun> runs_in(const std::string& directory, std::int64_t now_unix_ns);
// One line of error: it is no run folder, or cannot be written into.
std::expected<void, std::string> keep_run(const std::string& folder);

// Which of the robot's runs go, the first ones first. Never one that goes on or is kept; beyond `days` what tells
// nothing; beyond `gib`, or where the disk has less than 2 GiB left, what tells nothing, oldest first, then the rest.
std::vector<ShelvedRun> to_prune(const std::vector<ShelvedRun>& runs, const config::RobotConfig& robot,
                                 std::uint64_t free_bytes, std::int64_t now_unix_ns);
// Deletes them, of the folder and of `runs`, which are all of record.directory's. Returns those that are gone.
std::vector<ShelvedRun> prune(std::vector<ShelvedRun>& runs, const config::RobotConfig& robot,
                              std::int64_t now_unix_ns);

// Until the disk is full, at the pace of the robot's newest runs; before there are any, at what such a robot fills
// while it moves. Infinite: record.keep makes room for ever.
double hours_left(const std::vector<ShelvedRun>& runs, const config::RobotConfig& robot, std::uint64_t free_bytes);
// Of the disk that the directory, or its nearest parent that exists, lies on. 0: not known.
std::uint64_t free_bytes_at(const std::string& directory);

}  // namespace takt::monitor

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
  bool goes_on = false;     // a recorder holds it, or it is not closed and was written to within the last ten minutes
  bool is_kept = false;     // `takt runs keep`
  bool is_telling = false;  // holds an incident that no operator asked for, or a mark
  bool is_unknown = false;  // has no metrics.json that says so; then incidents are those of transitions.jsonl
  bool is_stuck = false;    // could not be deleted
};

// Oldest first; what is no run folder, and a link to one, is left out. `now`: Unix time.
std::vector<ShelvedRun> runs_in(const std::string& directory, std::int64_t now_unix_ns);
// One line of error: it is no run folder, or cannot be written into.
std::expected<void, std::string> keep_run(const std::string& folder);

// Which of the robot's runs go, the first ones first. Never one that goes on, is kept or tells something. Beyond `days`
// those of which that is known; beyond `gib`, or where the disk has less than 2 GiB left, these, oldest first, then the
// unknown ones.
std::vector<ShelvedRun> to_prune(const std::vector<ShelvedRun>& runs, const config::RobotConfig& robot,
                                 std::uint64_t free_bytes, std::int64_t now_unix_ns);
struct Pruned {
  std::vector<ShelvedRun> gone;
  std::vector<std::string> failures;  // one sentence each
};
// Deletes them, of the folder and of `runs`, which are all of record.directory's. Follows no link. Looks again at each
// before: one that a recorder holds, or that was marked to be kept meanwhile, stays.
Pruned prune(std::vector<ShelvedRun>& runs, const config::RobotConfig& robot, std::int64_t now_unix_ns);

// Until the disk is full, at the pace of the robot's newest runs; before there are any, at what such a robot fills
// while it moves. Infinite: record.keep makes room for ever.
double hours_left(const std::vector<ShelvedRun>& runs, const config::RobotConfig& robot, std::uint64_t free_bytes);
// Of the disk that the directory, or its nearest parent that exists, lies on. 0: not known.
std::uint64_t free_bytes_at(const std::string& directory);

}  // namespace takt::monitor

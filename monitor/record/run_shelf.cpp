// SPDX-License-Identifier: Apache-2.0
#include "monitor/record/run_shelf.hpp"

#include <fmt/format.h>

#include <algorithm>
#include <chrono>
#include <cstring>
#include <filesystem>
#include <limits>
#include <nlohmann/json.hpp>

#include "monitor/record/bounded_file.hpp"
#include "monitor/record/run_folder.hpp"

namespace takt::monitor {
namespace {

namespace fs = std::filesystem;

constexpr std::uint64_t kGib = std::uint64_t{1} << 30U;
// For the part that is written and its successor.
constexpr std::uint64_t kLeastFree = 2 * kGib;
constexpr std::int64_t kDay_ns = std::int64_t{86'400} * 1'000'000'000;
constexpr std::chrono::minutes kStillWritten{10};
constexpr const char* kKept = "kept";
// Measured: an arm of six joints fills some 0.35 MB/s while it moves.
constexpr double kBytesPerSecondAndJoint = 60e3;
constexpr double kLongestPace_s = 3'600, kShortestPace_s = 60;

std::uint64_t bytes_below(const fs::path& folder) {
  std::uint64_t bytes = 0;
  std::error_code error;
  for (fs::recursive_directory_iterator each(folder, error), end; !error && each != end; each.increment(error)) {
    std::error_code gone;
    const bool is_file = each->symlink_status(gone).type() == fs::file_type::regular;
    const auto size = is_file ? each->file_size(gone) : 0;
    if (!gone) bytes += size;
  }
  return bytes;
}

bool is_written_to(const RunFolder& folder) {
  std::error_code error;
  const auto at = fs::last_write_time(folder.ticks(), error);
  return !error && fs::file_time_type::clock::now() - at < kStillWritten;
}

// Incidents that nobody asked for, and marks, by metrics.json; -1: there is none that says so.
std::int64_t counted(const nlohmann::ordered_json& metrics) {
  try {
    const auto& listed = metrics.at("incidents").get_ref<const nlohmann::ordered_json::array_t&>();
    std::int64_t count = metrics.at("mark_count").get<std::int64_t>() +
                         metrics.at("incident_count").get<std::int64_t>() - static_cast<std::int64_t>(listed.size());
    for (const auto& incident : listed)
      if (!incident.at("asked").get<bool>()) ++count;
    return count;
  } catch (const nlohmann::json::exception&) {
    return -1;
  }
}

std::string how_it_ended(const RunManifest& manifest, bool goes_on) {
  if (goes_on) return "goes on";
  if (!manifest.goes_on_in.empty()) return "goes on in " + manifest.goes_on_in;
  if (!manifest.stopped_because.empty()) return "recording stopped: " + manifest.stopped_because;
  return manifest.complete ? manifest.ended_because : "cut off";
}

std::uint64_t bytes_of(const std::vector<ShelvedRun>& runs) {
  std::uint64_t bytes = 0;
  for (const ShelvedRun& run : runs) bytes += run.bytes;
  return bytes;
}

bool may_go(const ShelvedRun& run, const config::RobotConfig& robot) {
  return run.robot == robot.robot && !run.goes_on && !run.is_kept;
}

}  // namespace

std::vector<ShelvedRun> runs_in(const std::string& directory, std::int64_t now_unix_ns) {
  std::vector<ShelvedRun> runs;
  std::error_code error;
  for (fs::directory_iterator each(directory, error), end; !error && each != end; each.increment(error)) {
    std::error_code gone;
    if (each->symlink_status(gone).type() != fs::file_type::directory) continue;
    const RunFolder folder(each->path().string());
    const auto manifest = folder.read_manifest();
    if (!manifest) continue;
    ShelvedRun run;
    run.folder = folder.path();
    run.name = folder.name();
    run.robot = manifest->robot;
    const std::int64_t offset = manifest->clock.monotonic_to_unix_ns;
    run.goes_on = !manifest->ended_at.is_set() && is_written_to(folder);
    run.began_unix_ns = manifest->started_at.ns + offset;
    const std::int64_t ended = manifest->ended_at.is_set() ? manifest->ended_at.ns + offset : now_unix_ns;
    if (manifest->ended_at.is_set() || run.goes_on)
      run.seconds = std::max(0.0, static_cast<double>(ended - run.began_unix_ns) * 1e-9);
    run.bytes = bytes_below(each->path());
    run.ended = how_it_ended(*manifest, run.goes_on);
    run.is_kept = fs::exists(folder.path() + "/" + kKept, gone);
    const auto text = read_file(folder.metrics());
    const std::int64_t count = counted(nlohmann::ordered_json::parse(text.value_or(""), nullptr, false));
    run.is_telling = count != 0;
    if (count > 0) run.ended += fmt::format("; {} incidents and marks", count);
    runs.push_back(std::move(run));
  }
  std::ranges::sort(runs, {}, [](const ShelvedRun& run) { return std::pair(run.began_unix_ns, run.name); });
  return runs;
}

std::expected<void, std::string> keep_run(const std::string& folder) {
  if (const auto manifest = RunFolder(folder).read_manifest(); !manifest) return std::unexpected(manifest.error());
  return replace_file(folder + "/" + kKept, "");
}

std::vector<ShelvedRun> to_prune(const std::vector<ShelvedRun>& runs, const config::RobotConfig& robot,
                                 std::uint64_t free_bytes, std::int64_t now_unix_ns) {
  const config::RunKeep& keep = robot.record.keep;
  if (!keep.is_given()) return {};
  std::vector<ShelvedRun> going;
  std::uint64_t left = 0;
  for (const ShelvedRun& run : runs)
    if (run.robot == robot.robot) left += run.bytes;
  const auto take = [&](const ShelvedRun& run) {
    going.push_back(run);
    left -= run.bytes;
    free_bytes += run.bytes;
  };
  std::vector<ShelvedRun> rest;
  for (const ShelvedRun& run : runs) {
    if (!may_go(run, robot)) continue;
    const bool is_old = keep.days && run.began_unix_ns < now_unix_ns - *keep.days * kDay_ns;
    if (is_old && !run.is_telling)
      take(run);
    else
      rest.push_back(run);
  }
  std::ranges::stable_partition(rest, [](const ShelvedRun& run) { return !run.is_telling; });
  for (const ShelvedRun& run : rest) {
    const bool is_too_much = keep.gib && left > static_cast<std::uint64_t>(*keep.gib) * kGib;
    if (!is_too_much && free_bytes >= kLeastFree) break;
    take(run);
  }
  return going;
}

std::vector<ShelvedRun> prune(std::vector<ShelvedRun>& runs, const config::RobotConfig& robot,
                              std::int64_t now_unix_ns) {
  auto going = to_prune(runs, robot, free_bytes_at(robot.record.directory), now_unix_ns);
  std::erase_if(going, [](const ShelvedRun& run) {
    std::error_code error;
    fs::remove_all(run.folder, error);
    return static_cast<bool>(error);
  });
  std::erase_if(runs, [&](const ShelvedRun& run) {
    return std::ranges::find(going, run.folder, &ShelvedRun::folder) != going.end();
  });
  return going;
}

double hours_left(const std::vector<ShelvedRun>& runs, const config::RobotConfig& robot, std::uint64_t free_bytes) {
  std::uint64_t room = free_bytes;
  if (robot.record.keep.is_given()) {
    std::vector<ShelvedRun> may;
    std::ranges::copy_if(runs, std::back_inserter(may), [&](const ShelvedRun& run) { return may_go(run, robot); });
    room += bytes_of(may);
    if (room >= 2 * kLeastFree) return std::numeric_limits<double>::infinity();
  }
  double seconds = 0, bytes = 0;
  for (auto run = runs.rbegin(); run != runs.rend() && seconds < kLongestPace_s; ++run) {
    if (run->robot != robot.robot || run->seconds <= 0) continue;
    seconds += run->seconds;
    bytes += static_cast<double>(run->bytes);
  }
  const double pace = seconds < kShortestPace_s || bytes <= 0
                          ? kBytesPerSecondAndJoint * static_cast<double>(robot.joints.size())
                          : bytes / seconds;
  return static_cast<double>(room) / pace / 3'600;
}

std::uint64_t free_bytes_at(const std::string& directory) {
  fs::path folder = directory;
  std::error_code error;
  while (!folder.empty() && folder != folder.root_path() && !fs::exists(folder, error)) folder = folder.parent_path();
  const fs::space_info space = fs::space(folder, error);
  return error ? 0 : space.available;
}

}  // namespace takt::monitor

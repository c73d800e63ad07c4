// SPDX-License-Identifier: Apache-2.0
#include "monitor/record/run_shelf.hpp"

#include <fmt/format.h>

#include <algorithm>
#include <chrono>
#include <cstring>
#include <filesystem>
#include <limits>
#include <nlohmann/json.hpp>
#include <optional>
#include <sstream>

#include "executive/incident/incident.hpp"
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
// A recorder's are some kilobytes; what is larger was not written by one.
constexpr std::uintmax_t kLargestJson = 64U << 20U;
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

std::expected<std::string, std::string> read_small(const std::string& path) {
  std::error_code error;
  const std::uintmax_t size = fs::file_size(path, error);
  if (error || size > kLargestJson) return std::unexpected("too large, or not there");
  return read_file(path);
}

// Where that cannot be told it is.
bool is_kept(const std::string& folder) {
  std::error_code error;
  return fs::symlink_status(folder + "/" + kKept, error).type() != fs::file_type::not_found;
}

bool was_written_to(const RunFolder& folder) {
  std::error_code error;
  const auto at = fs::last_write_time(folder.ticks(), error);
  return !error && fs::file_time_type::clock::now() - at < kStillWritten;
}

// Incidents that no operator asked for, and marks, by metrics.json; none: it does not say.
std::optional<std::int64_t> counted(const std::string& text) {
  const auto metrics = nlohmann::ordered_json::parse(text, nullptr, false);
  try {
    const auto& listed = metrics.at("incidents").get_ref<const nlohmann::ordered_json::array_t&>();
    std::int64_t count = metrics.at("mark_count").get<std::int64_t>() +
                         metrics.at("incident_count").get<std::int64_t>() - static_cast<std::int64_t>(listed.size());
    for (const auto& incident : listed)
      if (!incident.at("asked").get<bool>()) ++count;
    return count;
  } catch (const nlohmann::json::exception&) {
    return std::nullopt;
  }
}

bool is_unasked_stop(const std::string& line) {
  const auto json = nlohmann::ordered_json::parse(line, nullptr, false);
  const auto text = [&json](const char* key) {
    const auto found = json.is_object() ? json.find(key) : json.end();
    return found != json.end() && found->is_string() ? found->get<std::string>() : std::string();
  };
  const std::string to = text("to"), cause = text("cause");
  if (to != name(Mode::damped_stop) && to != name(Mode::fault_latched)) return false;
  for (std::size_t i = 0; i < kCauseCount; ++i)
    if (incident::is_asked(static_cast<Cause>(i)) && cause == name(static_cast<Cause>(i))) return false;
  return true;
}

// The same without metrics.json, by the transitions; what cannot be read counts as one.
std::int64_t counted_by_transitions(const RunFolder& folder) {
  std::error_code error;
  if (!fs::exists(folder.transitions(), error) && !error) return 0;
  const auto text = read_small(folder.transitions());
  if (!text) return 1;
  std::istringstream lines(*text);
  std::int64_t count = 0;
  for (std::string line; std::getline(lines, line);) count += is_unasked_stop(line) ? 1 : 0;
  return count;
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
  return run.robot == robot.robot && !run.goes_on && !run.is_kept && !run.is_telling && !run.is_stuck;
}

std::optional<ShelvedRun> run_at(const RunFolder& folder, std::int64_t now_unix_ns) {
  std::error_code error;
  if (const auto size = fs::file_size(folder.manifest(), error); error || size > kLargestJson) return std::nullopt;
  const auto manifest = folder.read_manifest();
  if (!manifest) return std::nullopt;
  ShelvedRun run;
  run.folder = folder.path();
  run.name = folder.name();
  run.robot = manifest->robot;
  const bool is_closed = manifest->ended_at.is_set();
  run.goes_on = is_being_written(folder.ticks()) || (!is_closed && was_written_to(folder));
  const auto unix_ns = [&](MonoTime at) {  // a stranger's manifest says anything
    std::int64_t sum = 0;
    return __builtin_add_overflow(at.ns, manifest->clock.monotonic_to_unix_ns, &sum) ? now_unix_ns : sum;
  };
  run.began_unix_ns = unix_ns(manifest->started_at);
  if (is_closed || run.goes_on) {
    const std::int64_t ended = is_closed ? unix_ns(manifest->ended_at) : now_unix_ns;
    run.seconds = std::max(0.0, (static_cast<double>(ended) - static_cast<double>(run.began_unix_ns)) * 1e-9);
  }
  run.bytes = bytes_below(folder.path());
  run.ended = how_it_ended(*manifest, run.goes_on);
  run.is_kept = is_kept(folder.path());
  const auto known = counted(read_small(folder.metrics()).value_or(""));
  const std::int64_t count = known ? *known : counted_by_transitions(folder);
  run.is_unknown = !known;
  run.is_telling = count != 0;
  if (count > 0) run.ended += fmt::format("; {} incidents and marks", count);
  return run;
}

// What is left of a run when this is cut short is still a run, and goes next time: manifest and metrics go last.
std::error_code delete_run(const std::string& folder) {
  std::error_code error;
  const RunFolder run(folder);
  for (fs::directory_iterator each(folder, error), end; !error && each != end; each.increment(error)) {
    std::error_code told_below;
    if (each->path() != run.manifest() && each->path() != run.metrics()) fs::remove_all(each->path(), told_below);
  }
  fs::remove_all(folder, error);
  return error;
}

}  // namespace

std::vector<ShelvedRun> runs_in(const std::string& directory, std::int64_t now_unix_ns) {
  std::vector<ShelvedRun> runs;
  std::error_code error;
  for (fs::directory_iterator each(directory, error), end; !error && each != end; each.increment(error)) {
    std::error_code gone;
    if (each->symlink_status(gone).type() != fs::file_type::directory) continue;
    if (auto run = run_at(RunFolder(each->path().string()), now_unix_ns)) runs.push_back(std::move(*run));
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
    if (is_old && !run.is_unknown)
      take(run);
    else
      rest.push_back(run);
  }
  std::ranges::stable_partition(rest, [](const ShelvedRun& run) { return !run.is_unknown; });
  for (const ShelvedRun& run : rest) {
    const bool is_too_much = keep.gib && left > static_cast<std::uint64_t>(*keep.gib) * kGib;
    if (!is_too_much && free_bytes >= kLeastFree) break;
    take(run);
  }
  return going;
}

Pruned prune(std::vector<ShelvedRun>& runs, const config::RobotConfig& robot, std::int64_t now_unix_ns) {
  Pruned pruned;
  for (ShelvedRun& run : to_prune(runs, robot, free_bytes_at(robot.record.directory), now_unix_ns)) {
    if (is_kept(run.folder) || is_being_written(RunFolder(run.folder).ticks())) continue;
    if (const std::error_code error = delete_run(run.folder)) {
      pruned.failures.push_back(fmt::format("cannot delete {}: {}", run.folder, error.message()));
      if (const auto stuck = std::ranges::find(runs, run.folder, &ShelvedRun::folder); stuck != runs.end())
        stuck->is_stuck = true;
    } else {
      std::erase_if(runs, [&](const ShelvedRun& each) { return each.folder == run.folder; });
      pruned.gone.push_back(std::move(run));
    }
  }
  return pruned;
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

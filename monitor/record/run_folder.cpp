// SPDX-License-Identifier: Apache-2.0
#include "monitor/record/run_folder.hpp"

#include <fmt/chrono.h>
#include <fmt/format.h>

#include <filesystem>
#include <random>
#include <system_error>

#include "monitor/record/bounded_file.hpp"

namespace takt::monitor {

std::expected<RunFolder, std::string> RunFolder::create(const std::string& wanted, int from) {
  namespace fs = std::filesystem;
  constexpr int kMostSuccessors = 10'000;
  std::error_code error;
  const fs::path parent = fs::absolute(wanted).parent_path();
  fs::create_directories(parent, error);
  for (int number = from; !error && number < from + kMostSuccessors; ++number) {
    const std::string path = number == 1 ? wanted : fmt::format("{}.{}", wanted, number);
    if (fs::create_directory(path, error)) return RunFolder(path);
  }
  const std::string why = error ? error.message() : "too many folders of this name";
  return std::unexpected(fmt::format("cannot make the run folder {}: {}; choose another with --run-dir", wanted, why));
}

std::expected<RunManifest, std::string> RunFolder::read_manifest() const {
  const auto text = read_file(manifest());
  if (!text) return std::unexpected(fmt::format("{}: is {} a run folder?", text.error(), path_));
  const auto json = nlohmann::ordered_json::parse(*text, nullptr, false);
  if (json.is_discarded()) return std::unexpected(fmt::format("{} is not JSON", manifest()));
  auto manifest_read = manifest_of(json);
  if (!manifest_read) return std::unexpected(fmt::format("{} {}", manifest(), manifest_read.error()));
  return manifest_read;
}

std::expected<void, std::string> RunFolder::write_manifest(const RunManifest& manifest_to_write) const {
  // Paths are bytes, JSON is UTF-8.
  const auto json = to_json(manifest_to_write);
  return replace_file(manifest(), json.dump(2, ' ', false, decltype(json)::error_handler_t::replace) + "\n");
}

std::string new_run_id(const std::string& robot, std::int64_t unix_ns) {
  const auto seconds = static_cast<std::time_t>(unix_ns / 1'000'000'000);
  std::random_device random;
  return fmt::format("{:%Y%m%dT%H%M%SZ}-{}-{:06x}", fmt::gmtime(seconds), robot, random() & 0xFF'FFFFU);
}

}  // namespace takt::monitor

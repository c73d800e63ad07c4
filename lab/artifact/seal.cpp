// SPDX-License-Identifier: Apache-2.0
#include "lab/artifact/seal.hpp"

#include <fmt/format.h>

#include <algorithm>
#include <array>
#include <filesystem>
#include <nlohmann/json.hpp>
#include <set>
#include <utility>

#include "config/load.hpp"
#include "config/sha256.hpp"
#include "lab/artifact/artifact.hpp"
#include "lab/artifact/inputs.hpp"
#include "monitor/record/bounded_file.hpp"
#include "monitor/record/strict_json.hpp"

namespace takt::lab {
namespace {

constexpr std::array kSealed{"manifest.json",   "panel.yaml",       "rollout.schema.json", "rollouts.jsonl",
                             "rollouts.sha256", "rollouts.parquet", "confusion.json"};

// Sealed where they are there. An earlier version kept no inputs, whose contents have their hashes for names.
constexpr std::array kSealedIfThere{kInputsFile, ArtifactFolder::kRegistration, ArtifactFolder::kRegistrationStamp};

// `named`: in the seal, which a file that is gone is missing from.
std::vector<const char*> sealed_files(const ArtifactFolder& folder, const nlohmann::ordered_json& named) {
  std::vector<const char*> files(kSealed.begin(), kSealed.end());
  std::error_code unknown;
  for (const char* const file : kSealedIfThere)
    if (named.contains(file) || std::filesystem::exists(folder.path() + "/" + file, unknown)) files.push_back(file);
  return files;
}

// The next line without its end; what is left begins behind it.
std::string_view take_line(std::string_view& text) {
  const std::size_t end = text.find('\n');
  const std::string_view line = text.substr(0, end);
  text.remove_prefix(end == std::string_view::npos ? text.size() : end + 1);
  return line;
}

// Of every regular file below runs/, by its path in the artifact.
std::expected<nlohmann::ordered_json, std::string> hashes_of_runs(const ArtifactFolder& folder) {
  std::set<std::string> paths;
  std::error_code error, none;
  const std::filesystem::path runs(folder.path() + "/runs");
  if (std::filesystem::is_directory(runs, none))
    for (std::filesystem::recursive_directory_iterator entry(runs, error), end; !error && entry != end;
         entry.increment(error))
      if (entry->symlink_status().type() == std::filesystem::file_type::regular)
        paths.insert(entry->path().lexically_relative(folder.path()).string());
  if (error) return std::unexpected(fmt::format("cannot read {}: {}", runs.string(), error.message()));
  auto json = nlohmann::ordered_json::object();
  for (const std::string& path : paths) {
    auto hash = config::file_sha256(folder.path() + "/" + path);
    if (!hash) return std::unexpected(fmt::format("{}/{}: {}", folder.path(), path, hash.error()));
    json[path] = std::move(*hash);
  }
  return json;
}

// Below runs/, and nowhere else.
bool leads_into_runs(const std::string& path) {
  const std::filesystem::path steps(path);
  return path.starts_with("runs/") && path.find('\0') == path.npos &&
         std::ranges::none_of(steps, [](const auto& step) { return step == ".." || step == "."; });
}

}  // namespace

std::string row_seal(std::string_view before, std::string_view row) {
  return config::sha256_hex(std::string(before) + "\n" + std::string(row));
}

std::string broken_row_seal(std::string_view rows, std::string_view seals, bool may_lack_last) {
  std::string before;
  for (std::size_t number = 1; !rows.empty(); ++number) {
    const std::string row = std::string(take_line(rows)) + "\n";
    if (seals.empty() && may_lack_last && rows.empty()) return {};
    if (seals.empty())
      return fmt::format("row {} has no seal in rollouts.sha256: it was not written by the run", number);
    const std::string_view seal = take_line(seals);
    if (row_seal(before, row) != seal)
      return fmt::format("row {} is not the one that was written: its seal in rollouts.sha256 is another's", number);
    before = seal;
  }
  return seals.empty() ? std::string() : "rollouts.sha256 has seals of rows that are not there";
}

std::expected<std::string, std::string> seal_of(const ArtifactFolder& folder, const std::string& artifact_id) {
  nlohmann::ordered_json json{{"schema", kSealSchema}, {"artifact_id", artifact_id}};
  for (const char* const file : sealed_files(folder, nlohmann::ordered_json::object())) {
    const auto text = monitor::read_file(folder.path() + "/" + file);
    if (!text) return std::unexpected(text.error());
    json["files"][file] = config::sha256_hex(*text);
  }
  auto runs = hashes_of_runs(folder);
  if (!runs) return std::unexpected(runs.error());
  json["runs"] = std::move(*runs);
  return json.dump(2) + "\n";
}

std::string broken_seal(const ArtifactFolder& folder, const std::string& artifact_id) {
  const auto text = monitor::read_file(folder.seal());
  if (!text) return fmt::format("{}: a finished artifact has one", text.error());
  const auto json = monitor::parse_strict(*text);
  if (!json) return fmt::format("seal.json is {}", json.error());
  const auto is_object = [&](const char* key) { return json->contains(key) && json->at(key).is_object(); };
  if (!json->is_object() || json->value("schema", "") != kSealSchema || !is_object("files") || !is_object("runs"))
    return fmt::format("seal.json is no seal of this version ({})", kSealSchema);
  if (json->value("artifact_id", "") != artifact_id) return "seal.json is of another artifact";
  const auto names = sealed_files(folder, json->at("files"));
  for (const char* const file : names) {
    const auto content = monitor::read_file(folder.path() + "/" + file);
    if (!content) return content.error();
    if (json->at("files").value(file, "") != config::sha256_hex(*content))
      return fmt::format("{} is not the file that was sealed", file);
  }
  const auto& runs = json->at("runs").items();
  const bool leads_astray = std::any_of(runs.begin(), runs.end(), [](const auto& item) {
    return !leads_into_runs(item.key()) || !item.value().is_string();
  });
  const bool has_more = json->size() != 4 || json->at("files").size() != names.size();
  if (leads_astray || has_more || *text != json->dump(2) + "\n") return "seal.json is not as it was written";
  return {};
}

SealedRuns look_at_runs(const ArtifactFolder& folder) {
  SealedRuns found;
  const auto text = monitor::read_file(folder.seal());
  if (!text) return found;
  const auto json = nlohmann::ordered_json::parse(*text, nullptr, false);
  for (const auto& [path, hash] : json.at("runs").items()) {
    ++found.files;
    const auto now = config::file_sha256(folder.path() + "/" + path);
    if (!now) {
      found.altered.push_back(fmt::format("{}: {}", path, now.error()));
    } else if (*now != hash.get<std::string>()) {
      found.altered.push_back(fmt::format("{} is not the file that was sealed", path));
    }
  }
  return found;
}

}  // namespace takt::lab

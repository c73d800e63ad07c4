// SPDX-License-Identifier: Apache-2.0
#include "lab/artifact/inputs.hpp"

#include <fmt/format.h>

#include <algorithm>
#include <filesystem>
#include <nlohmann/json.hpp>

#include "config/load.hpp"
#include "config/sha256.hpp"
#include "lab/artifact/artifact.hpp"
#include "monitor/record/bounded_file.hpp"
#include "monitor/record/strict_json.hpp"

namespace takt::lab {
namespace {

using Json = nlohmann::ordered_json;

bool is_sha256(const Json& value) {
  constexpr std::size_t kDigits = 64;
  if (!value.is_string()) return false;
  const auto& text = value.get_ref<const std::string&>();
  return text.size() == kDigits && text.find_first_not_of("0123456789abcdef") == std::string::npos;
}

// From the robot file's folder to a file: up first, then down, and no way out of the folders that are made for it.
bool may_be_input(const std::string& path) {
  const std::filesystem::path steps(path);
  std::size_t up = 0, down = 0;
  for (const auto& step : steps) {
    if (step == ".." && down != 0) return false;
    (step == ".." ? up : down) += 1;
    if (step == "." || step.empty()) return false;
  }
  return down != 0 && up <= kDeepest && steps.is_relative() && path.find('\0') == path.npos &&
         steps.lexically_normal() == steps;
}

bool read_hashes(const Json& json, bool (*may_be)(const std::string&), KeptInputs::Hashes& hashes) {
  if (!json.is_object()) return false;
  for (const auto& [path, hash] : json.items()) {
    if (!may_be(path) || !is_sha256(hash)) return false;
    hashes[path] = hash.get<std::string>();
  }
  return true;
}

std::expected<KeptInputs, std::string> inputs_of(const Json& json) {
  const auto refused = std::unexpected(fmt::format("{} is not as it was written ({})", kInputsFile, kInputsSchema));
  if (!json.is_object() || json.size() != 3 || json.value("schema", "") != kInputsSchema || !json.contains("tasks") ||
      !json.at("tasks").is_object() || !json.contains("not_kept"))
    return refused;
  KeptInputs inputs;
  const auto any_path = [](const std::string& path) { return path.starts_with('/') && path.find('\0') == path.npos; };
  if (!read_hashes(json.at("not_kept"), any_path, inputs.not_kept)) return refused;
  for (const auto& [task, files] : json.at("tasks").items())
    if (!read_hashes(files, may_be_input, inputs.tasks[task]) || !inputs.tasks[task].contains(kKeptRobot))
      return refused;
  return inputs;
}

std::string content_path(const ArtifactFolder& folder, const std::string& sha256) {
  return folder.inputs() + "/" + sha256;
}

}  // namespace

bool keeps_inputs(const ArtifactFolder& folder) {
  std::error_code error;
  return std::filesystem::exists(folder.inputs_file(), error);
}

std::expected<KeptInputs, std::string> read_inputs(const ArtifactFolder& folder) {
  const auto text = monitor::read_file(folder.inputs_file());
  if (!text) return std::unexpected(text.error());
  const auto json = monitor::parse_strict(*text);
  if (!json) return std::unexpected(fmt::format("{} is {}", kInputsFile, json.error()));
  return inputs_of(*json);
}

std::expected<void, std::string> write_inputs(const ArtifactFolder& folder, const KeptInputs& inputs) {
  const Json json{{"schema", kInputsSchema}, {"tasks", Json(inputs.tasks)}, {"not_kept", Json(inputs.not_kept)}};
  return monitor::replace_file(folder.inputs_file(), json.dump(2) + "\n");
}

std::expected<std::string, std::string> keep_content(const ArtifactFolder& folder, std::string_view content) {
  std::error_code error;
  std::filesystem::create_directories(folder.inputs(), error);
  if (error) return std::unexpected(fmt::format("cannot make {}: {}", folder.inputs(), error.message()));
  std::string sha256 = config::sha256_hex(content);
  if (std::filesystem::exists(content_path(folder, sha256), error)) return sha256;
  if (auto done = monitor::replace_file(content_path(folder, sha256), content); !done)
    return std::unexpected(done.error());
  return sha256;
}

std::expected<std::string, std::string> kept_content(const ArtifactFolder& folder, const std::string& sha256) {
  std::error_code error;
  const std::string path = content_path(folder, sha256);
  if (std::filesystem::file_size(path, error) > kLargestInput || error)
    return std::unexpected(fmt::format("inputs/{} is not there", sha256));
  auto content = monitor::read_file(path);
  if (!content) return content;
  if (config::sha256_hex(*content) != sha256)
    return std::unexpected(fmt::format("inputs/{} is not what was kept", sha256));
  return content;
}

std::vector<std::string> altered_inputs(const ArtifactFolder& folder) {
  std::vector<std::string> sentences;
  const auto inputs = read_inputs(folder);
  if (!inputs) return {inputs.error()};
  for (const auto& [task, files] : inputs->tasks)
    for (const auto& [path, sha256] : files)
      if (const auto content = kept_content(folder, sha256); !content)
        sentences.push_back(fmt::format("{} of {}: {}", path, task, content.error()));
  return sentences;
}

std::expected<void, std::string> merge_inputs(std::span<const Artifact> from, const ArtifactFolder& to) {
  KeptInputs merged;
  if (!std::ranges::all_of(from, [](const Artifact& artifact) { return keeps_inputs(artifact.folder); })) return {};
  for (const Artifact& artifact : from) {
    const auto inputs = read_inputs(artifact.folder);
    if (!inputs) return std::unexpected(fmt::format("{}: {}", artifact.folder.path(), inputs.error()));
    merged.not_kept.insert(inputs->not_kept.begin(), inputs->not_kept.end());
    for (const auto& [task, files] : inputs->tasks) {
      for (const auto& [path, sha256] : files) {
        const auto [known, is_new] = merged.tasks[task].emplace(path, sha256);
        if (known->second != sha256)
          return std::unexpected(
              fmt::format("{} of {} is another file in {} than in those before", path, task, artifact.folder.path()));
        if (!is_new) continue;
        const auto content = kept_content(artifact.folder, sha256);
        if (!content) return std::unexpected(fmt::format("{}: {}", artifact.folder.path(), content.error()));
        if (auto kept = keep_content(to, *content); !kept) return std::unexpected(kept.error());
      }
    }
  }
  return write_inputs(to, merged);
}

}  // namespace takt::lab

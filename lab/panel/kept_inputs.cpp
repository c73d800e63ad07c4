// SPDX-License-Identifier: Apache-2.0
#include "lab/panel/kept_inputs.hpp"

#include <fmt/format.h>
#include <stdlib.h>

#include <algorithm>
#include <filesystem>
#include <utility>
#include <vector>

#include "config/hash.hpp"
#include "config/load.hpp"
#include "config/model_text.hpp"
#include "config/sha256.hpp"
#include "lab/artifact/inputs.hpp"
#include "monitor/record/bounded_file.hpp"

namespace takt::lab {
namespace {

namespace fs = std::filesystem;

void add_model(const std::string& model, std::vector<std::string>& files) {
  const auto text = config::read_model_text(model);
  if (!text) return;
  files.insert(files.end(), text->files.begin(), text->files.end());
  // One that only a picture needs may be missing.
  std::error_code error;
  for (std::string& asset : config::model_assets(*text))
    if (fs::is_regular_file(asset, error)) files.push_back(std::move(asset));
}

// That a robot file names and a rollout reads, by whole paths.
std::vector<std::string> files_of(const config::RobotConfig& robot) {
  std::vector<std::string> files;
  const auto add_policy = [&](const std::string& path) {
    for (const std::string& file : config::policy_files(path)) files.push_back(file);
  };
  if (robot.policy) add_policy(robot.policy->file);
  for (const config::Fallback& fallback : robot.fallbacks)
    if (fallback.has_own_file()) add_policy(fallback.file);
  if (robot.simulation && robot.simulation->mujoco) add_model(robot.simulation->mujoco->model, files);
  for (std::string& file : files) file = fs::absolute(file).lexically_normal();
  return files;
}

std::vector<std::string> engines_of(const config::RobotConfig& robot) {
  std::vector<std::string> files;
  if (robot.policy && robot.policy->engine)
    for (const std::string* const path : {&robot.policy->engine->name, &robot.policy->engine->library})
      if (path->contains('/')) files.push_back(*path);
  return files;
}

std::ptrdiff_t steps_up(const fs::path& name) {
  return std::ranges::count_if(name, [](const fs::path& step) { return step == ".."; });
}

// How the kept robot file finds it; empty: from this machine's folders only.
std::string kept_name(const std::string& file, const config::RobotConfig& robot) {
  const fs::path home = fs::absolute(robot.file).lexically_normal().parent_path();
  fs::path name = fs::path(file).lexically_relative(home);
  const std::ptrdiff_t up = steps_up(name);
  if (name.empty() || robot.resolved.contains(file) || static_cast<std::size_t>(up) > kDeepest || name == kKeptRobot)
    return {};
  return name.string();
}

std::expected<void, std::string> keep_file(const std::string& file, const std::string& name,
                                           const ArtifactFolder& folder, KeptInputs::Hashes& kept,
                                           KeptInputs::Hashes& not_kept) {
  std::error_code error;
  const std::uintmax_t size = fs::file_size(file, error);
  if (error) return std::unexpected(fmt::format("{}: {}", file, error.message()));
  if (name.empty() || size > kLargestInput) {
    auto hash = config::file_sha256(file);
    if (!hash) return std::unexpected(fmt::format("{}: {}", file, hash.error()));
    not_kept[file] = std::move(*hash);
    return {};
  }
  const auto content = monitor::read_file(file);
  if (!content) return std::unexpected(content.error());
  auto hash = keep_content(folder, *content);
  if (!hash) return std::unexpected(hash.error());
  kept[name] = std::move(*hash);
  return {};
}

std::expected<void, std::string> keep_task(const Contest& contest, std::size_t task, const ArtifactFolder& folder,
                                           KeptInputs& inputs) {
  const Panel& panel = contest.panel();
  const PanelTask& one = panel.tasks[task];
  KeptInputs::Hashes& kept = inputs.tasks[std::string(evidence::kTaskNames[static_cast<std::size_t>(one.task)])];
  const auto robot = config::load(panel.robot.empty() ? one.robot : panel.robot);
  if (!robot) return std::unexpected(robot.error().substr(0, robot.error().find('\n')));
  auto written = keep_content(folder, robot->resolved);
  if (!written) return std::unexpected(written.error());
  kept[kKeptRobot] = std::move(*written);
  for (std::size_t method = 0; method < panel.methods.size(); ++method) {
    const Contestant& who = contest.contestant({.task = task, .method = method});
    for (const std::string& file : files_of(who.robot))
      if (auto done = keep_file(file, kept_name(file, who.robot), folder, kept, inputs.not_kept); !done) return done;
    for (const std::string& file : engines_of(who.robot))
      if (auto done = keep_file(file, "", folder, kept, inputs.not_kept); !done) return done;
  }
  return {};
}

std::vector<std::string> words_of(const std::string& command) {
  std::vector<std::string> words(1);
  char quote = 0;
  for (const char c : command) {
    if (quote == 0 && (c == '\'' || c == '"')) {
      quote = c;
    } else if (c == quote) {
      quote = 0;
    } else if (quote == 0 && (c == ' ' || c == '\t' || c == '\n')) {
      if (!words.back().empty()) words.emplace_back();
    } else {
      words.back() += c;
    }
  }
  return words;
}

// The folder of the kept robot file below `root`: as deep as the files that lie above it ask for.
fs::path home_of(const fs::path& root, const KeptInputs::Hashes& files) {
  std::ptrdiff_t deepest = 0;
  for (const auto& [name, sha256] : files) deepest = std::max(deepest, steps_up(name));
  fs::path home = root;
  for (std::ptrdiff_t up = 0; up < deepest; ++up) home /= "robot";
  return home;
}

}  // namespace

OutsideProgram outside_program(const std::string& command) {
  OutsideProgram program{.command = command, .files = {}};
  std::error_code error;
  std::vector<std::string> words = words_of(command);
  if (fs::is_regular_file(command, error)) words = {fs::absolute(command).string()};  // a name with blanks
  for (std::size_t i = 0; i < words.size(); ++i) {
    const bool is_searched = i == 0 && !words[i].contains('/');
    if (is_searched || !fs::is_regular_file(words[i], error)) continue;
    if (const auto hash = config::file_sha256(words[i])) program.files[words[i]] = *hash;
  }
  return program;
}

std::expected<void, std::string> keep_inputs(const Contest& contest, const ArtifactFolder& folder) {
  if (keeps_inputs(folder)) return {};
  KeptInputs inputs;
  for (std::size_t task = 0; task < contest.panel().tasks.size(); ++task)
    if (auto done = keep_task(contest, task, folder, inputs); !done) return done;
  return write_inputs(folder, inputs);
}

std::expected<UnpackedInputs, std::string> UnpackedInputs::unpack(const ArtifactFolder& folder) {
  if (!keeps_inputs(folder))
    return std::unexpected(
        fmt::format("{} does not keep what it was computed from: name its panel file by --panel", folder.path()));
  const auto inputs = read_inputs(folder);
  if (!inputs) return std::unexpected(inputs.error());
  std::string root = (fs::temp_directory_path() / "takt-inputs.XXXXXX").string();
  if (mkdtemp(root.data()) == nullptr)
    return std::unexpected("no temporary folder for the kept files can be made; set TMPDIR");
  UnpackedInputs unpacked(root);
  for (const auto& [task, files] : inputs->tasks) {
    const fs::path home = home_of(fs::path(root) / std::to_string(unpacked.robots_.size()), files);
    for (const auto& [name, sha256] : files) {
      const auto content = kept_content(folder, sha256);
      if (!content) return std::unexpected(content.error());
      const fs::path file = (home / name).lexically_normal();
      std::error_code error;
      fs::create_directories(file.parent_path(), error);
      if (auto done = monitor::replace_file(file.string(), *content); !done) return std::unexpected(done.error());
    }
    unpacked.robots_[task] = (home / kKeptRobot).string();
  }
  return unpacked;
}

UnpackedInputs::UnpackedInputs(UnpackedInputs&& other) noexcept
    : path_(std::exchange(other.path_, {})), robots_(std::move(other.robots_)) {}

UnpackedInputs::~UnpackedInputs() {
  std::error_code ignored;
  if (!path_.empty()) fs::remove_all(path_, ignored);
}

}  // namespace takt::lab

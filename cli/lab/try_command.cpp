// SPDX-License-Identifier: Apache-2.0
// takt policy try: a table over a folder of policies: which engine takes each, why not, error and time against ONNX
// Runtime.
#include <fmt/format.h>

#include <algorithm>
#include <exception>
#include <filesystem>
#include <fstream>
#include <memory>
#include <optional>
#include <set>
#include <utility>
#include <vector>

#include "cli/command.hpp"
#include "cli/lab/tried_page.hpp"
#include "cli/lab_commands.hpp"
#include "config/bundle_name.hpp"
#include "config/document.hpp"
#include "config/printable.hpp"
#include "policy_host/leapp/leapp_bundle.hpp"

namespace takt::cli {
namespace {

namespace fs = std::filesystem;

using onnx_runtime::OnnxRuntime;

struct PolicyTryOptions {
  std::string folder, out, library;
};

TriedPolicy try_one(const fs::path& folder, const fs::path& file, const policy_trial::TrialSetup& setup) {
  TriedPolicy tried{fs::relative(file, folder), policy_trial::try_policy(file, setup), {}};
  policy_trial::Trial& trial = tried.trial;
  if (trial.own && trial.judge) {
    try {
      tried.agreement = policy_trial::compare(*trial.own, *trial.judge, kMostTimedInferences);
    } catch (const std::exception& failed) {
      trial.unjudged = failed.what();
    }
  }
  trial.own.reset();  // some are large
  trial.judge.reset();
  return tried;
}

// The networks of a bundle beside its YAML; nothing: the file is none.
std::optional<std::vector<fs::path>> networks_of_bundle(const fs::path& file) {
  const auto text = config::read_file(file.string());
  if (!text || !policy_host::is_leapp_bundle(*text)) return std::nullopt;
  std::vector<fs::path> networks;
  if (const auto bundle = policy_host::read_leapp_bundle(*text, file.string()))
    for (const policy_host::LeappNode& node : bundle->nodes) networks.push_back(file.parent_path() / node.model_path);
  return networks;
}

// A bundle counts as one, its networks not by themselves.
std::vector<fs::path> policies_below(const fs::path& folder) {
  std::vector<fs::path> files;
  std::set<fs::path> in_bundles;
  for (const fs::directory_entry& entry : fs::recursive_directory_iterator(folder)) {
    if (!entry.is_regular_file()) continue;
    const fs::path& file = entry.path();
    if (file.extension() == ".onnx" || file.extension() == ".pt") files.push_back(file);
    if (!config::names_bundle(file.string())) continue;
    const auto networks = networks_of_bundle(file);
    if (!networks) continue;
    files.push_back(file);
    in_bundles.insert(networks->begin(), networks->end());
  }
  std::erase_if(files, [&](const fs::path& file) { return in_bundles.contains(file); });
  // The folder's own first, then folder by folder.
  std::ranges::sort(files, {}, [&](const fs::path& file) {
    const fs::path below = file.lexically_relative(folder);
    return std::pair(below.has_parent_path() ? below.begin()->string() : std::string(), file);
  });
  return files;
}

int write_page(const PolicyTryOptions& options, const std::string& page, std::size_t policies) {
  if (options.out.empty()) {
    fmt::print("{}", page);
    return kExitOk;
  }
  std::ofstream file(options.out);
  file << page;
  if (!file.flush()) return fail("takt policy try", options.out + " cannot be written; choose another --out");
  fmt::print("{}: {} policies\n", config::printable(options.out), policies);
  return kExitOk;
}

int try_folder(const PolicyTryOptions& options) {
  if (!fs::is_directory(options.folder))
    return refuse(kExitUsage,
                  "takt policy try: " + options.folder +
                      (fs::exists(options.folder) ? " is no folder: name the one that it is in" : ": no such folder"));
  policy_trial::TrialSetup setup;
  std::optional<OnnxRuntime> judge;
  if (!options.library.empty()) {
    auto opened = OnnxRuntime::open(options.library);
    if (!opened) return refuse(kExitUnavailable, "takt policy try: " + opened.error());
    judge.emplace(*std::move(opened));
    setup = {options.library, &*judge};
  }
  std::vector<TriedPolicy> tried;
  for (const fs::path& file : policies_below(options.folder)) tried.push_back(try_one(options.folder, file, setup));
  if (tried.empty())
    return fail("takt policy try", options.folder + ": holds no .onnx, no .pt and no LEAPP bundle's .yaml");
  return write_page(options, tried_page(tried, judge ? judge->version() : ""), tried.size());
}

}  // namespace

void add_policy_try(CLI::App& app, int& exit_code) {
  CLI::App* command = add_lab_command(app, "try");
  auto options = std::make_shared<PolicyTryOptions>();
  command
      ->add_option("FOLDER", options->folder,
                   "searched for .onnx and .pt files and LEAPP bundles (.yaml), folders below included")
      ->required();
  command->add_option("--out", options->out, "Markdown file to write (default: print it)");
  command->add_option("--onnxruntime", options->library,
                      "libonnxruntime.so to run by what is its, and to judge by; it is loaded, so it must be one you "
                      "trust");
  command->footer(
      "Example: takt policy try policies --onnxruntime /usr/lib/x86_64-linux-gnu/libonnxruntime.so\n"
      "Exit codes: 0 tried, whatever the table says; 1 no policy there or the table cannot be written; 64 command "
      "line; 65 an engine crashed or hung while it loaded one; 69 that is not ONNX Runtime.");
  command->callback([options, &exit_code] { exit_code = try_folder(*options); });
}

}  // namespace takt::cli

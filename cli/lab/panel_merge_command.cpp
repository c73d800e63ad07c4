// SPDX-License-Identifier: Apache-2.0
// takt panel merge: artifacts of one panel into one, never a mixture.
#include <fmt/format.h>

#include <memory>
#include <vector>

#include "cli/command.hpp"
#include "lab/artifact/merge.hpp"

namespace takt::cli {
namespace {

struct PanelMergeOptions {
  std::string out;
  std::vector<std::string> directories;
};

int merge(const PanelMergeOptions& options) {
  std::vector<lab::Artifact> artifacts;
  for (const std::string& directory : options.directories) {
    auto artifact = lab::open_artifact(directory);
    if (!artifact) return fail("takt panel merge", artifact.error());
    artifacts.push_back(std::move(*artifact));
  }
  const auto merged = lab::merge(options.out, artifacts);
  if (!merged) return fail("takt panel merge", merged.error());
  fmt::print("{}: {} rows, {} methods\n", merged->manifest.artifact_id, merged->rows.size(),
             merged->manifest.methods.size());
  return kExitOk;
}

}  // namespace

void add_panel_merge(CLI::App& panel, int& exit_code) {
  CLI::App* command = panel.add_subcommand("merge", "Put artifacts of one panel into one; refuse mixtures.");
  auto options = std::make_shared<PanelMergeOptions>();
  command->add_option("OUT", options->out, "folder of the new artifact")->required();
  command->add_option("DIR", options->directories, "artifact folders")->required()->expected(1, -1);
  command->footer(
      "Example: takt panel merge artifacts/both artifacts/fast artifacts/slow\n"
      "Exit codes: 0 merged; 1 refused, with the reason.");
  command->callback([options, &exit_code] { exit_code = merge(*options); });
}

}  // namespace takt::cli

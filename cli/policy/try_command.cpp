// takt policy try: a table over a folder of policies: loads?, why not, error and time against ONNX Runtime.
#include <fmt/format.h>

#include <algorithm>
#include <filesystem>
#include <fstream>
#include <memory>
#include <optional>

#include "cli/command.hpp"
#include "policy_host/policy_trial.hpp"

namespace takt::cli {
namespace {

using onnx_runtime::OnnxRuntime;
using policy_host::PolicyTrial;

constexpr int kTimedInferences = 2000;

struct PolicyTryOptions {
  std::string folder, out, library;
};

struct TriedPolicy {
  std::string policy, loads, tensors, error, time;
};

// A table cell is one line without bars.
std::string table_cell(std::string text) {
  for (char& c : text) {
    if (c == '|' || static_cast<unsigned char>(c) < ' ') c = ' ';
  }
  return text;
}

std::string value_counts(const PolicyTrial& trial) {
  std::size_t in = 0;
  for (const std::size_t i : trial.tensors().observation) {
    std::size_t count = 1;
    for (const std::int64_t size : trial.model().inputs()[i].shape) count *= static_cast<std::size_t>(size);
    in += count;
  }
  const std::size_t out = trial.model().output(trial.tensors().outputs.front()).size();
  const std::size_t states = trial.tensors().states.size();
  return fmt::format("{} to {}{}", in, out, states == 0 ? "" : fmt::format(", {} states", states));
}

TriedPolicy try_one(const std::filesystem::path& file, const std::string& name,
                    const std::optional<OnnxRuntime>& peer) {
  TriedPolicy row{table_cell(name), "", "", "", ""};
  if (file.extension() == ".pt") {
    row.loads = "no: TorchScript; export it to ONNX, its state as inputs and outputs";
    return row;
  }
  auto trial = PolicyTrial::load(file);
  if (!trial) {
    const std::string prefix = file.string() + ": ";
    row.loads =
        "no: " + table_cell(trial.error().starts_with(prefix) ? trial.error().substr(prefix.size()) : trial.error());
    return row;
  }
  row.loads = "yes";
  row.tensors = value_counts(*trial);
  if (!peer) return row;
  const auto agreement = trial->against(*peer, kTimedInferences);
  if (!agreement) {
    row.error = table_cell(agreement.error());
    return row;
  }
  row.error = fmt::format("{:.1e}", agreement->error);
  row.time = fmt::format("{:.1f} / {:.1f} us = {:.2f}", agreement->own_us, agreement->peer_us,
                         agreement->own_us / agreement->peer_us);
  return row;
}

std::vector<std::filesystem::path> policies_below(const std::filesystem::path& folder) {
  std::vector<std::filesystem::path> files;
  for (const std::filesystem::directory_entry& entry : std::filesystem::recursive_directory_iterator(folder)) {
    if (!entry.is_regular_file()) continue;
    if (entry.path().extension() == ".onnx" || entry.path().extension() == ".pt") files.push_back(entry.path());
  }
  std::ranges::sort(files);
  return files;
}

std::string tried_table(const std::vector<TriedPolicy>& rows, const std::optional<OnnxRuntime>& peer) {
  const auto loaded = std::ranges::count(rows, "yes", &TriedPolicy::loads);
  std::string text = fmt::format("# Policies tried\n\n{} files, {} load. ", rows.size(), loaded);
  text += peer ? fmt::format("Judge: ONNX Runtime {}, one thread.\n", peer->version())
               : std::string("Not judged: no ONNX Runtime was named (--onnxruntime).\n");
  text += fmt::format(
      "Error: the largest |a - b| / max(1, |b|) of any output over {} observations in sequence, states fed back. Time: "
      "medians "
      "of {} inferences, both engines in turns, the built-in engine's / ONNX Runtime's = ratio.\n\n"
      "| policy | loads | values | error | time |\n|---|---|---|---|---|\n",
      policy_host::kTrialObservations, kTimedInferences);
  for (const TriedPolicy& row : rows) {
    text += fmt::format("| {} | {} | {} | {} | {} |\n", row.policy, row.loads, row.tensors, row.error, row.time);
  }
  return text;
}

int try_folder(const PolicyTryOptions& options) {
  if (!std::filesystem::is_directory(options.folder))
    return refuse(kExitUsage, "takt policy try: " + options.folder + ": no such folder");
  std::optional<OnnxRuntime> peer;
  if (!options.library.empty()) {
    auto opened = OnnxRuntime::open(options.library);
    if (!opened) return refuse(kExitUnavailable, "takt policy try: " + opened.error());
    peer.emplace(*std::move(opened));
  }
  std::vector<TriedPolicy> rows;
  for (const std::filesystem::path& file : policies_below(options.folder)) {
    rows.push_back(try_one(file, std::filesystem::relative(file, options.folder).string(), peer));
  }
  if (rows.empty()) return fail("takt policy try", options.folder + ": holds no .onnx and no .pt file");
  const std::string text = tried_table(rows, peer);
  if (options.out.empty()) {
    fmt::print("{}", text);
    return kExitOk;
  }
  std::ofstream file(options.out);
  file << text;
  if (!file.flush()) return fail("takt policy try", options.out + " cannot be written; choose another --out");
  fmt::print("{}: {} policies\n", options.out, rows.size());
  return kExitOk;
}

}  // namespace

void add_policy_try(CLI::App& policy, int& exit_code) {
  CLI::App* command =
      policy.add_subcommand("try", "Try every policy of a folder: loads?, error and time against ONNX Runtime.");
  auto options = std::make_shared<PolicyTryOptions>();
  command->add_option("FOLDER", options->folder, "searched for .onnx and .pt files, folders below included")
      ->required();
  command->add_option("--out", options->out, "Markdown file to write (default: print it)");
  command->add_option("--onnxruntime", options->library,
                      "libonnxruntime.so to judge by; it is loaded, so it must be one you trust");
  command->footer(
      "Example: takt policy try policies --onnxruntime /usr/lib/x86_64-linux-gnu/libonnxruntime.so\n"
      "Exit codes: 0 tried, whatever the table says; 1 no policy there or the table cannot be written; 64 command "
      "line; "
      "69 that is not ONNX Runtime.");
  command->callback([options, &exit_code] { exit_code = try_folder(*options); });
}

}  // namespace takt::cli

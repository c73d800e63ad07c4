// SPDX-License-Identifier: Apache-2.0
// takt seal: signs a finished artifact or a closed run.
#include <fmt/format.h>

#include <expected>
#include <filesystem>
#include <memory>
#include <string>
#include <utility>

#include "cli/command.hpp"
#include "cli/lab_commands.hpp"
#include "config/printable.hpp"
#include "lab/artifact/signature.hpp"
#include "lab/judge/audit.hpp"
#include "lab/judge/run_audit.hpp"
#include "lab/panel/panel_promise.hpp"
#include "monitor/record/bounded_file.hpp"
#include "monitor/record/recorded_run.hpp"
#include "monitor/record/run_seal.hpp"

namespace takt::cli {
namespace {

constexpr const char* kSealCommand = "takt seal";

struct SealOptions {
  std::string directory, key;
};

// The envelope, and whose it is.
struct Sealed {
  std::string id, envelope;
  bool passed = false;
};

panel::SignedResult result_of(bool passed) {
  return passed ? panel::SignedResult::passed : panel::SignedResult::warned;
}

std::expected<Sealed, std::string> sealed_run(const std::string& directory, const std::string& key) {
  const auto run = monitor::open_run(directory);
  if (!run) return std::unexpected(run.error());
  const auto seal = monitor::check_run_seal(run->folder);
  if (!seal) return std::unexpected(seal.error());
  if (!seal->altered.empty()) return std::unexpected(seal->altered.front());
  if (!seal->closed) return std::unexpected("the run is being recorded, or its recorder was ended before it closed it");
  const bool passed = panel::audit_run(*run).is_consistent();
  auto envelope = panel::sign(*run, result_of(passed), key);
  if (!envelope) return std::unexpected("--key: " + envelope.error());
  return Sealed{run->manifest.run_id, std::move(*envelope), passed};
}

std::expected<Sealed, std::string> sealed_artifact(const std::string& directory, const std::string& key) {
  const auto artifact = panel::open_finished_artifact(directory);
  if (!artifact) return std::unexpected(artifact.error());
  const bool passed = panel::audit(*artifact, panel::panel_promise(artifact->folder.panel())).is_consistent();
  auto envelope = panel::sign(*artifact, result_of(passed), key);
  if (!envelope) return std::unexpected("--key: " + envelope.error());
  return Sealed{artifact->manifest.artifact_id, std::move(*envelope), passed};
}

int seal(const SealOptions& options) {
  const auto key = monitor::read_file(options.key);
  if (!key) return fail(kSealCommand, "--key: " + key.error());
  const bool is_run = std::filesystem::exists(monitor::RunFolder(options.directory).ticks());
  const auto sealed = is_run ? sealed_run(options.directory, *key) : sealed_artifact(options.directory, *key);
  if (!sealed) return fail(kSealCommand, fmt::format("{}: {}", options.directory, sealed.error()));
  const std::string file = options.directory + "/" + panel::kSignatureFile;
  if (const auto written = monitor::replace_file(file, sealed->envelope); !written)
    return fail(kSealCommand, written.error());
  fmt::print("{} signed: {}{}\n", sealed->id, config::printable(file),
             sealed->passed ? "" : "; the audit misses something, and the signature says so (takt audit)");
  return kExitOk;
}

}  // namespace

void add_seal(CLI::App& app, int& exit_code) {
  CLI::App* command = add_lab_command(app, "seal");
  auto options = std::make_shared<SealOptions>();
  command->add_option("DIR", options->directory, "artifact or run folder")->required();
  command->add_option("--key", options->key, "private key of Ed25519, PEM (openssl genpkey -algorithm ed25519)")
      ->required();
  command->footer(
      "Example: takt seal artifacts/smoke --key lab.pem\n"
      "Exit codes: 0 signed; 1 it is not finished or not as it was written, the key is none, or the file\n"
      "cannot be written; 64 command line.");
  command->callback([options, &exit_code] { exit_code = seal(*options); });
}

}  // namespace takt::cli

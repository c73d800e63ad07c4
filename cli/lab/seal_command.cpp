// SPDX-License-Identifier: Apache-2.0
// takt seal: signs a finished artifact, a closed run, or a panel before it runs, and keeps the time stamp of that
// signature.
#include <fmt/format.h>
#include <unistd.h>

#include <chrono>
#include <cstdint>
#include <expected>
#include <filesystem>
#include <memory>
#include <optional>
#include <string>
#include <utility>

#include "cli/command.hpp"
#include "cli/lab/margin_option.hpp"
#include "cli/lab/panel_choice.hpp"
#include "cli/lab_commands.hpp"
#include "config/printable.hpp"
#include "lab/artifact/signature.hpp"
#include "lab/judge/audit.hpp"
#include "lab/judge/run_audit.hpp"
#include "lab/panel/panel_promise.hpp"
#include "lab/panel/registration.hpp"
#include "lab/panel/sequential_decision.hpp"
#include "monitor/record/bounded_file.hpp"
#include "monitor/record/recorded_run.hpp"
#include "monitor/record/run_manifest.hpp"
#include "monitor/record/run_seal.hpp"

namespace takt::cli {
namespace {

constexpr const char* kSealCommand = "takt seal";
constexpr std::int64_t kNanosecondsPerSecond = 1'000'000'000;

struct SealOptions {
  std::string directory, key, time, compare, margin;
  PanelChoice choice;
  bool is_of_panel = false;  // an option of panels was given
};

// The envelope, and whose it is.
struct Sealed {
  std::string id, envelope;
  bool passed = false;
};

lab::SignedResult result_of(bool passed) {
  return passed ? lab::SignedResult::passed : lab::SignedResult::warned;
}

std::expected<Sealed, std::string> sealed_run(const std::string& directory, const std::string& key) {
  const auto run = monitor::open_run(directory);
  if (!run) return std::unexpected(run.error());
  const auto seal = monitor::check_run_seal(run->folder);
  if (!seal) return std::unexpected(seal.error());
  if (!seal->altered.empty()) return std::unexpected(seal->altered.front());
  if (!seal->closed) return std::unexpected("the run is being recorded, or its recorder was ended before it closed it");
  const bool passed = lab::audit_run(*run).is_consistent();
  auto envelope = lab::sign(*run, result_of(passed), key);
  if (!envelope) return std::unexpected("--key: " + envelope.error());
  return Sealed{run->manifest.run_id, std::move(*envelope), passed};
}

std::expected<Sealed, std::string> sealed_artifact(const std::string& directory, const std::string& key) {
  const auto artifact = lab::open_finished_artifact(directory);
  if (!artifact) return std::unexpected(artifact.error());
  const bool passed = lab::audit(*artifact, lab::panel_promise(artifact->folder.panel())).is_consistent();
  auto envelope = lab::sign(*artifact, result_of(passed), key);
  if (!envelope) return std::unexpected("--key: " + envelope.error());
  return Sealed{artifact->manifest.artifact_id, std::move(*envelope), passed};
}

struct SignatureFiles {
  std::string envelope, stamp;  // paths
};

SignatureFiles files_of(const std::string& directory) {
  if (!std::filesystem::is_regular_file(directory))
    return {directory + "/" + lab::kSignatureFile, directory + "/" + lab::kTimeStampFile};
  const auto [envelope, stamp] = lab::registration_beside(directory);
  return {envelope, stamp};
}

std::string name_of(const std::string& path) {
  return std::filesystem::path(path).filename().string();
}

// A stamp of an envelope that is no longer there says nothing of this one.
int keep_envelope(const SignatureFiles& files, const std::string& envelope) {
  if (const auto done = monitor::replace_file(files.envelope, envelope); !done) return fail(kSealCommand, done.error());
  const auto response = monitor::read_file(files.stamp);
  if (response && !lab::claimed_time(*response, envelope, "") && ::unlink(files.stamp.c_str()) == 0)
    fmt::print("{} stamped another signature and is removed\n", config::printable(files.stamp));
  return kExitOk;
}

// Of the panel's methods, B against A.
std::expected<std::optional<lab::RegisteredComparison>, std::string> comparison_of(const SealOptions& options,
                                                                                   lab::Panel panel) {
  if (options.compare.empty()) return std::nullopt;
  const auto two = lab::keep_two_methods(options.compare, panel);
  if (!two) return std::unexpected(fmt::format("--compare {}: {}", options.compare, two.error()));
  const auto margin = margin_of(options.margin);
  if (!margin) return std::unexpected(fmt::format("--margin {}: write a share of success, such as 2%", options.margin));
  return lab::RegisteredComparison{(*two)[0], (*two)[1], *margin};
}

int register_panel(const SealOptions& options) {
  const auto key = monitor::read_file(options.key);
  if (!key) return fail(kSealCommand, "--key: " + key.error());
  auto chosen = chosen_panel(kSealCommand, options.directory, options.choice);
  if (!chosen) return refuse(chosen.error().exit_code, chosen.error().sentence);
  const auto comparison = comparison_of(options, chosen->panel);
  if (!comparison) return refuse(kExitUsage, fmt::format("{}: {}", kSealCommand, comparison.error()));
  const std::size_t planned = lab::plan_of(chosen->panel, {}).size();
  const auto contest = lab::Contest::prepare(std::move(chosen->panel), options.choice.outside());
  if (!contest) return refuse(config::kExitBadConfiguration, contest.error());
  lab::ArtifactManifest manifest = contest->manifest(planned);
  if (!options.choice.until_decided.empty()) manifest.until_decided = {chosen->rivals.begin(), chosen->rivals.end()};
  const auto now = std::chrono::system_clock::now().time_since_epoch();
  const std::int64_t unix_ns = std::chrono::duration_cast<std::chrono::nanoseconds>(now).count();
  const auto text = lab::registration_text(*contest, manifest, *comparison, unix_ns, *key);
  if (!text) return fail(kSealCommand, "--key: " + text.error());
  const SignatureFiles files = files_of(options.directory);
  if (const int code = keep_envelope(files, *text); code != kExitOk) return code;
  fmt::print("{} registered, {} rollouts: {}; takt panel run keeps it\n", manifest.panel, planned,
             config::printable(files.envelope));
  return kExitOk;
}

int sign(const SealOptions& options) {
  if (std::filesystem::is_regular_file(options.directory)) return register_panel(options);
  if (options.is_of_panel)
    return refuse(kExitUsage, fmt::format("{}: {} is no panel file, and these options are of one; leave them out",
                                          kSealCommand, options.directory));
  const auto key = monitor::read_file(options.key);
  if (!key) return fail(kSealCommand, "--key: " + key.error());
  const bool is_run = std::filesystem::exists(monitor::RunFolder(options.directory).ticks());
  const auto sealed = is_run ? sealed_run(options.directory, *key) : sealed_artifact(options.directory, *key);
  if (!sealed) return fail(kSealCommand, fmt::format("{}: {}", options.directory, sealed.error()));
  const SignatureFiles files = files_of(options.directory);
  if (const int code = keep_envelope(files, sealed->envelope); code != kExitOk) return code;
  fmt::print("{} signed: {}{}\n", sealed->id, config::printable(files.envelope),
             sealed->passed ? "" : "; the audit misses something, and the signature says so (takt audit)");
  return kExitOk;
}

int keep_time(const SealOptions& options) {
  const auto response = monitor::read_file(options.time);
  if (!response) return fail(kSealCommand, "--time: " + response.error());
  const SignatureFiles files = files_of(options.directory);
  const auto envelope = monitor::read_file(files.envelope);
  if (!envelope) return fail(kSealCommand, envelope.error() + "; sign it first, by --key");
  const auto stamp = lab::claimed_time(*response, *envelope, name_of(files.envelope));
  if (!stamp) return fail(kSealCommand, fmt::format("--time {}: {}", options.time, stamp.error()));
  if (const auto done = monitor::replace_file(files.stamp, *response); !done) return fail(kSealCommand, done.error());
  fmt::print("{} stamped {} by {}; takt audit --time-by checks who that is\n", config::printable(files.stamp),
             monitor::utc_text(stamp->unix_s * kNanosecondsPerSecond), stamp->by);
  return kExitOk;
}

}  // namespace

void add_seal(CLI::App& app, int& exit_code) {
  CLI::App* command = add_lab_command(app, "seal");
  auto options = std::make_shared<SealOptions>();
  command->add_option("DIR", options->directory, "artifact, run folder, or a panel file before it runs")->required();
  auto* const what = command->add_option_group("what");
  what->add_option("--key", options->key, "sign it: private key of Ed25519, PEM (openssl genpkey -algorithm ed25519)");
  what->add_option("--time", options->time, "keep a time stamp of its signature: response of RFC 3161 (openssl ts)");
  what->require_option(1);
  CLI::App* const panel = command->add_option_group("panel", "of a panel file");
  add_panel_choice(*panel, options->choice);
  auto* const compare = panel->add_option("--compare", options->compare, "A,B: these two methods are to be compared");
  auto* const margin = panel->add_option("--margin", options->margin, "by which B may succeed less often than A: 2%");
  compare->needs(margin);
  margin->needs(compare);
  command->footer(
      "Example: takt seal artifacts/smoke --key lab.pem\n"
      "Of a panel file it registers what `takt panel run` is to show, beside the file (docs/evidence.md).\n"
      "Exit codes: 0 done; 1 it is not finished or not as it was written, the key is none, the stamp is of\n"
      "something else, or the file cannot be written; 64 command line; 65 panel or robot file.");
  command->callback([options, panel, &exit_code] {
    options->is_of_panel = panel->count_all() > 0;
    exit_code = options->key.empty() ? keep_time(*options) : sign(*options);
  });
}

}  // namespace takt::cli

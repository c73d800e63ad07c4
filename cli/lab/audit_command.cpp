// SPDX-License-Identifier: Apache-2.0
// takt audit: is a panel's artifact, a run folder, or an attestation ready to be audited, what is missing, and what the
// verdict rests on.
#include <fmt/format.h>

#include <charconv>
#include <cmath>
#include <expected>
#include <filesystem>
#include <memory>
#include <optional>
#include <random>
#include <vector>

#include "cli/command.hpp"
#include "cli/json_line.hpp"
#include "cli/lab_commands.hpp"
#include "cli/run/policy_host_option.hpp"
#include "cli/world_option.hpp"
#include "config/printable.hpp"
#include "evidence/attestation/attestation.hpp"
#include "lab/artifact/signature.hpp"
#include "lab/judge/audit.hpp"
#include "lab/judge/post_mortem.hpp"
#include "lab/judge/run_audit.hpp"
#include "lab/panel/attested_again.hpp"
#include "lab/panel/kept_inputs.hpp"
#include "lab/panel/panel_promise.hpp"
#include "lab/panel/recompute.hpp"
#include "lab/panel/registration.hpp"
#include "monitor/record/bounded_file.hpp"

namespace takt::cli {
namespace {

constexpr const char* kCommand = "takt audit";

struct AuditOptions {
  std::string directory, recompute, panel, robot, world, policy_host, signed_by, time_by, registered_by;
  policy_host::Grants policy_may;
  std::size_t workers = 1;
  bool json = false, draft = false;
};

// "25%" or "6" of that many rows; at least one.
std::optional<std::size_t> rows_of(std::string_view text, std::size_t rows) {
  const bool is_share = text.ends_with('%');
  if (is_share) text.remove_suffix(1);
  double number = 0;
  const auto [end, error] = std::from_chars(text.data(), text.data() + text.size(), number);
  if (error != std::errc{} || end != text.data() + text.size() || !(number > 0) || (is_share && number > 100))
    return std::nullopt;
  if (!is_share && number != std::floor(number)) return std::nullopt;
  const double wanted = is_share ? std::ceil(number / 100 * static_cast<double>(rows)) : number;
  return static_cast<std::size_t>(std::min(wanted, static_cast<double>(rows)));
}

std::uint64_t nonce() {
  std::random_device device;
  return (std::uint64_t{device()} << 32U) | device();
}

std::expected<lab::Recomputed, std::string> recomputed(const lab::Artifact& artifact, const AuditOptions& options,
                                                       std::size_t rows) {
  auto panel = lab::load_panel(options.panel.empty() ? artifact.folder.panel() : options.panel);
  if (!panel) return std::unexpected(panel.error());
  panel->robot = options.robot;
  lab::keep_what_ran(artifact.manifest, *panel);
  std::optional<lab::UnpackedInputs> kept;
  if (options.panel.empty()) {
    auto unpacked = lab::UnpackedInputs::unpack(artifact.folder);
    if (!unpacked) return std::unexpected(unpacked.error());
    kept.emplace(std::move(*unpacked));
    for (lab::PanelTask& task : panel->tasks) {
      const auto robot = kept->robots().find(std::string(evidence::kTaskNames[static_cast<std::size_t>(task.task)]));
      if (robot != kept->robots().end()) task.robot = robot->second;
    }
  }
  auto contest = lab::Contest::prepare(std::move(*panel), {options.world, options.policy_host, options.policy_may});
  if (!contest) return std::unexpected(contest.error());
  return lab::recompute(artifact, *contest, lab::drawn_rows(rows, artifact.rows.size(), nonce()), options.workers);
}

std::expected<std::string, std::string> signer(const AuditOptions& options) {
  const auto key = monitor::read_file(options.signed_by);
  if (!key) return std::unexpected(key.error());
  return lab::check_signature(options.directory, *key);
}

std::expected<lab::TimeStamp, std::string> stamp(const AuditOptions& options) {
  const auto certificates = monitor::read_file(options.time_by);
  if (!certificates) return std::unexpected(certificates.error());
  return lab::check_time(options.directory, *certificates);
}

std::expected<lab::Registered, std::string> registration(const lab::Artifact& artifact, const AuditOptions& options) {
  const auto key = monitor::read_file(options.registered_by);
  if (!key) return std::unexpected(key.error());
  std::optional<std::string> certificates;
  if (!options.time_by.empty()) {
    auto text = monitor::read_file(options.time_by);
    if (!text) return std::unexpected(text.error());
    certificates = std::move(*text);
  }
  return lab::check_registration(artifact, *key, certificates);
}

lab::Vouching vouching(const AuditOptions& options) {
  lab::Vouching vouching;
  if (!options.signed_by.empty()) vouching.signed_by = signer(options);
  if (vouching.signed_by && !options.time_by.empty()) vouching.stamped = stamp(options);
  return vouching;
}

int audit_run(const AuditOptions& options) {
  if (!options.recompute.empty() || options.draft || !options.registered_by.empty())
    return refuse(kExitUsage,
                  fmt::format("{}: {} is a run folder: --recompute, --draft and --registered-by are for a panel's "
                              "artifact",
                              kCommand, options.directory));
  const auto run = monitor::open_run(options.directory);
  if (!run) return fail(kCommand, run.error());
  lab::RunAudit result = lab::audit_run(*run);
  result.vouching = vouching(options);
  fmt::print("{}", options.json ? json_line(lab::to_json(result)) + "\n" : lab::audit_text(result));
  return result.is_consistent() ? kExitOk : kExitFailed;
}

std::vector<lab::PlannedRollout> drawn(const lab::Panel& panel, std::size_t count) {
  const auto plan = lab::plan_of(panel, {});
  std::vector<lab::PlannedRollout> some;
  for (const std::size_t one : lab::drawn_rows(count, plan.size(), nonce())) some.push_back(plan[one]);
  return some;
}

std::expected<lab::Recomputed, std::string> recomputed(const evidence::Attestation& attestation,
                                                       const AuditOptions& options) {
  auto panel = lab::attested_panel(attestation);
  if (!panel) return std::unexpected(panel.error());
  panel->robot = options.robot;
  const auto count = rows_of(options.recompute, lab::plan_of(*panel, {}).size());
  if (!count) return std::unexpected("write a number of rollouts or a share, such as 6 or 25%");
  auto contest = lab::Contest::prepare(std::move(*panel), {options.world, options.policy_host, options.policy_may});
  if (!contest) return std::unexpected(contest.error());
  return lab::recompute(attestation, *contest, drawn(contest->panel(), *count), options.workers);
}

int audit_attestation(const AuditOptions& options) {
  if (options.json || options.draft || !options.signed_by.empty() || !options.registered_by.empty())
    return refuse(kExitUsage, fmt::format("{}: {} is an attestation: --json, --draft, --signed-by and --registered-by "
                                          "are for folders",
                                          kCommand, options.directory));
  if (options.recompute.empty() != options.robot.empty() || !options.panel.empty())
    return refuse(kExitUsage, fmt::format("{}: an attestation holds its panel, and no robot: write --recompute with "
                                          "--robot",
                                          kCommand));
  const auto text = monitor::read_file(options.directory);
  if (!text) return fail(kCommand, text.error());
  const auto attestation = evidence::attestation_of(*text);
  if (!attestation) return fail(kCommand, fmt::format("{} {}", options.directory, attestation.error()));
  std::optional<lab::Recomputed> again;
  if (!options.recompute.empty()) {
    auto made = recomputed(*attestation, options);
    if (!made) return fail(kCommand, "--recompute: " + made.error());
    again = std::move(*made);
  }
  fmt::print("{}", lab::audit_text(*attestation, again));
  return again && !again->differences.empty() ? kExitFailed : kExitOk;
}

int audit(const AuditOptions& options) {
  if (!options.time_by.empty() && options.signed_by.empty() && options.registered_by.empty())
    return refuse(kExitUsage, fmt::format("{}: --time-by needs --signed-by or --registered-by", kCommand));
  if (std::filesystem::is_regular_file(options.directory)) return audit_attestation(options);
  if (std::filesystem::exists(monitor::RunFolder(options.directory).ticks())) return audit_run(options);
  if (!options.robot.empty() && options.panel.empty())
    return refuse(kExitUsage, fmt::format("{}: an artifact keeps its robot files: --robot needs --panel", kCommand));
  const auto artifact = lab::open_artifact(options.directory);
  if (!artifact) return fail(kCommand, artifact.error());
  if (options.draft) {
    const auto drafted = lab::draft_post_mortems(*artifact);
    if (!drafted) return fail(kCommand, drafted.error());
    fmt::print(stderr, "{} post-mortems drafted in {}\n", *drafted, config::printable(artifact->folder.post_mortems()));
  }
  lab::Audit result = lab::audit(*artifact, lab::panel_promise(artifact->folder.panel()));
  if (!options.recompute.empty()) {
    const auto rows = rows_of(options.recompute, artifact->rows.size());
    if (!rows)
      return refuse(kExitUsage, fmt::format("{}: --recompute {}: write a number of rows or a share, such as 6 or 25%",
                                            kCommand, options.recompute));
    auto again = recomputed(*artifact, options, *rows);
    if (!again) return fail(kCommand, "--recompute: " + again.error());
    result.recomputed = std::move(*again);
  }
  result.vouching = vouching(options);
  if (!options.registered_by.empty()) result.registered = registration(*artifact, options);
  if (options.json) {
    fmt::print("{}\n", json_line(lab::to_json(result)));
  } else {
    fmt::print("{}", lab::audit_text(result));
  }
  return result.is_consistent() ? kExitOk : kExitFailed;
}

}  // namespace

void add_audit(CLI::App& app, int& exit_code) {
  CLI::App* command = add_lab_command(app, "audit");
  auto options = std::make_shared<AuditOptions>();
  command->add_option("DIR", options->directory, "artifact, run folder, or file of takt panel attest")->required();
  command->add_flag("--json", options->json, "print the audit as one line of JSON (docs/evidence.md)");
  command->add_flag("--draft", options->draft, "first draft a post-mortem for every failed rollout that has none");
  auto* const recompute = command->add_option("--recompute", options->recompute,
                                              "N or P%: compute so many rows anew, drawn at random, and compare");
  auto* const panel = command->add_option("--panel", options->panel,
                                          "with --recompute: the panel file that the artifact was made from;\n"
                                          "default: what the artifact keeps");
  panel->needs(recompute);
  command
      ->add_option("--robot", options->robot,
                   "with --recompute of an attestation, or with --panel: the robot file that the panel was run with")
      ->needs(recompute);
  add_world(*command, options->world)->needs(recompute);
  add_policy_host(*command, options->policy_host)->needs(recompute);
  add_policy_may(*command, options->policy_may)->needs(recompute);
  command->add_option("--workers", options->workers, "with --recompute: processes that share the work")
      ->check(CLI::Range(1, 1024))
      ->needs(recompute);
  command->add_option("--signed-by", options->signed_by, "public key, PEM: it has to be signed by it (takt seal)");
  command->add_option("--registered-by", options->registered_by,
                      "public key, PEM: the panel has to be registered by it before it ran (takt seal PANEL)");
  command->add_option("--time-by", options->time_by,
                      "certificates, PEM: the signature has to be stamped by an authority of theirs,\n"
                      "and so has the registration, if it is stamped");
  command->footer(
      "Example: takt audit artifacts/smoke --recompute 25%\n"
      "Exit codes: 0 nothing is missing and nothing contradicts itself; 1 something is or does, rows came\n"
      "out otherwise, or it is no artifact; 64 command line.");
  command->callback([options, &exit_code] { exit_code = audit(*options); });
}

}  // namespace takt::cli

// takt audit: is a panel's artifact ready to be audited, and what is missing.
#include <fmt/format.h>

#include <memory>

#include "cli/command.hpp"
#include "evidence/judge/audit.hpp"
#include "evidence/judge/post_mortem.hpp"
#include "evidence/panel/panel_promise.hpp"

namespace takt::cli {
namespace {

struct AuditOptions {
  std::string directory;
  bool json = false, draft = false;
};

int audit(const AuditOptions& options) {
  const auto artifact = panel::open_artifact(options.directory);
  if (!artifact) return fail("takt audit", artifact.error());
  if (options.draft) {
    const auto drafted = panel::draft_post_mortems(*artifact);
    if (!drafted) return fail("takt audit", drafted.error());
    fmt::print(stderr, "{} post-mortems drafted in {}\n", *drafted, artifact->folder.post_mortems());
  }
  const panel::Audit result = panel::audit(*artifact, panel::panel_promise(artifact->folder.panel()));
  if (options.json) {
    fmt::print("{}\n", panel::to_json(result).dump());
  } else {
    fmt::print("{}", panel::audit_text(result));
  }
  return result.is_ready() ? kExitOk : kExitFailed;
}

}  // namespace

void add_audit(CLI::App& app, int& exit_code) {
  CLI::App* command = app.add_subcommand("audit", "Say whether a panel's artifact is ready to be audited.");
  auto options = std::make_shared<AuditOptions>();
  command->add_option("DIR", options->directory, "artifact folder")->required();
  command->add_flag("--json", options->json, "print the audit as one line of JSON (docs/evidence.md)");
  command->add_flag("--draft", options->draft, "first draft a post-mortem for every failed rollout that has none");
  command->footer(
      "Example: takt audit artifacts/smoke\n"
      "Exit codes: 0 audit-ready; 1 not, with what is missing, or not an artifact.");
  command->callback([options, &exit_code] { exit_code = audit(*options); });
}

}  // namespace takt::cli

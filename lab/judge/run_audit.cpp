// SPDX-License-Identifier: Apache-2.0
#include "lab/judge/run_audit.hpp"

#include <fmt/format.h>

namespace takt::lab {

bool RunAudit::is_consistent() const {
  // An output that the run does not record may have been anything.
  const bool reproduces = replay && replay->reproduces() && replay->not_compared.empty();
  return seal && seal->closed && seal->altered.empty() && reproduces && vouching.holds();
}

bool RunAudit::is_ready() const {
  return is_consistent() && vouching.is_signed();
}

RunAudit audit_run(const monitor::RecordedRun& run) {
  return {.run_id = run.manifest.run_id,
          .seal = monitor::check_run_seal(run.folder),
          .replay = evidence::replay(run, 0),
          .vouching = {}};
}

std::string audit_text(const RunAudit& audit) {
  std::string text = fmt::format("{:<20}{}\n", "run", audit.run_id), rests;
  const auto line = [&](const char* what, const std::string& says) { text += fmt::format("{:<20}{}\n", what, says); };
  const auto also = [&](const std::string& part) { rests += (rests.empty() ? "" : "; ") + part; };
  if (!audit.seal) {
    line("seal", "missing: " + audit.seal.error());
    also("not sealed");
  } else {
    line("seal", fmt::format("{} files, {} segments", audit.seal->files, audit.seal->segments));
    if (audit.seal->events_behind != 0)
      line("", fmt::format("not sealed: the last {} bytes of events.jsonl, written after the run was closed",
                           audit.seal->events_behind));
    for (const std::string& sentence : audit.seal->altered) line("", "differs: " + sentence);
    if (!audit.seal->closed) line("", "missing: the recorder was ended before it closed the run");
    also(!audit.seal->altered.empty() ? "not as it was recorded" : audit.seal->closed ? "sealed" : "sealed in part");
  }
  if (!audit.replay) {
    line("replay", "missing: " + audit.replay.error());
    also("not replayed");
  } else {
    const std::string said = evidence::replay_text(*audit.replay);
    line("replay", said.substr(0, said.find('\n')));
    also(!audit.replay->reproduces()          ? "does not reproduce"
         : audit.replay->not_compared.empty() ? "replayed"
                                              : "replayed in part: outputs are not recorded");
  }
  text += vouching_lines(audit.vouching);
  also(audit.vouching.signed_by ? vouching_rests(audit.vouching) : "no signature was checked");
  line("rests on", rests);
  if (audit.is_ready()) return text + "audit-ready\n";
  return text + (audit.is_consistent() ? "consistent: --signed-by makes it audit-ready\n" : "not audit-ready\n");
}

nlohmann::ordered_json to_json(const RunAudit& audit) {
  nlohmann::ordered_json json{
      {"schema", kRunAuditSchema},       {"run_id", audit.run_id}, {"consistent", audit.is_consistent()},
      {"audit_ready", audit.is_ready()}, {"seal", nullptr},        {"replay", nullptr}};
  if (audit.seal)
    json["seal"] = {{"closed", audit.seal->closed},
                    {"files", audit.seal->files},
                    {"segments", audit.seal->segments},
                    {"events_behind", audit.seal->events_behind},
                    {"altered", audit.seal->altered}};
  if (audit.replay) json["replay"] = evidence::to_json(*audit.replay);
  add_vouching(audit.vouching, json);
  return json;
}

}  // namespace takt::lab

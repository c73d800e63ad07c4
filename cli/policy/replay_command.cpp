// SPDX-License-Identifier: Apache-2.0
// takt policy replay: does the network say again what it said in a run, and what would another have said?
#include <fmt/format.h>

#include <memory>

#include "cli/command.hpp"
#include "cli/json_line.hpp"
#include "config/load.hpp"
#include "evidence/policy/policy_replay.hpp"

namespace takt::cli {
namespace {

struct PolicyReplayArguments {
  std::string directory;
  evidence::PolicyReplayOptions options;
  bool json = false;
};

int replay(const PolicyReplayArguments& arguments) {
  constexpr std::string_view command = "takt policy replay";
  const auto run = monitor::open_run(arguments.directory);
  if (!run) return fail(command, run.error());
  const auto report = evidence::replay_policy(*run, arguments.options);
  if (!report) {
    const std::string& sentence = report.error().sentence;
    switch (report.error().why) {
      case evidence::PolicyReplayRefusal::Why::no_evidence:
        return fail(command, sentence);
      case evidence::PolicyReplayRefusal::Why::policy:
        return refuse(config::kExitBadConfiguration, sentence);
    }
  }
  if (arguments.json) {
    fmt::print("{}\n", json_line(evidence::to_json(*report)));
  } else {
    fmt::print("{}", evidence::policy_replay_text(*report));
  }
  if (!report->agrees()) return kExitFailed;
  return report->is_whole() ? kExitOk : kExitNotJudged;
}

}  // namespace

void add_policy_replay(CLI::App& policy, int& exit_code) {
  CLI::App* command = policy.add_subcommand(
      "replay", "Feed a run's recorded observations through the network again, or through another.");
  auto arguments = std::make_shared<PolicyReplayArguments>();
  command->add_option("DIR", arguments->directory, "run folder")->required();
  command->add_option("--with", arguments->options.with,
                      "another ONNX file: how far its targets are from the run's, had it been shown the same");
  command
      ->add_option("--tolerance", arguments->options.tolerance,
                   "difference of a target that is worth naming; rad, rad/s or Nm, of a slide m, m/s or N")
      ->capture_default_str()
      ->check(CLI::NonNegativeNumber);
  command->add_flag("--json", arguments->json, "one line of JSON");
  command->footer(
      "Example: takt policy replay runs/20261121T093300Z-arm6-3f9a2c --with config/arm6_reach.onnx\n"
      "Exit codes: 0 every answer reproduces bit for bit (--with another file: no target differs by more than the\n"
      "tolerance); 1 one does not, was altered, or the run has no policy inputs; 2 all that was judged does, but some\n"
      "could not be judged (an image's file is missing, say) or are missing; 64 command line; 65 the policy file is\n"
      "not the run's, or does not fit, or the policy was a program in Python or C.");
  command->callback([arguments, &exit_code] { exit_code = replay(*arguments); });
}

}  // namespace takt::cli

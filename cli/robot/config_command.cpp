// SPDX-License-Identifier: Apache-2.0
// takt config check | show | keys: what a robot file says, what is wrong with it, and what it may say.
#include <fmt/format.h>
#include <sys/wait.h>
#include <unistd.h>

#include <algorithm>
#include <cstdio>
#include <memory>
#include <nlohmann/json.hpp>
#include <set>

#include "cli/command.hpp"
#include "cli/hand_over.hpp"
#include "cli/json_line.hpp"
#include "cli/robot/plant_check.hpp"
#include "cli/run/checked_robot.hpp"
#include "cli/run/policy_check.hpp"
#include "cli/world_option.hpp"
#include "config/cautions.hpp"
#include "config/json_schema.hpp"
#include "config/key_table.hpp"
#include "config/load.hpp"
#include "config/printable.hpp"
#include "config/units.hpp"
#include "evidence/attestation/attestation.hpp"

namespace takt::cli {
namespace {

struct ConfigOptions {
  std::string file;
  bool json = false;
  bool strict = false;        // check: cautions refuse
  std::string policy_host{};  // check: not ours
  std::string world{};        // check: plays the mechanics
  std::string recompute{};    // check: so many rollouts of each attestation
};

int refuse_file(const std::string& problems, bool json) {
  if (json) {
    nlohmann::json lines = nlohmann::json::array();
    for (std::size_t begin = 0; begin < problems.size();) {
      const std::size_t end = std::min(problems.find('\n', begin), problems.size());
      lines.push_back(problems.substr(begin, end - begin));
      begin = end + 1;
    }
    fmt::print("{}\n", json_line(nlohmann::json{{"valid", false}, {"problems", lines}}));
    return config::kExitBadConfiguration;
  }
  return refuse(config::kExitBadConfiguration, first_problems(problems));
}

std::string lines_of(const std::vector<std::string>& cautions) {
  std::string lines;
  for (const std::string& caution : cautions) lines += (lines.empty() ? "" : "\n") + caution;
  return lines;
}

// Which silence degrades the robot, next to how often the policy speaks.
std::string contract_sentence(const config::RobotConfig& robot) {
  const config::Freshness& contract = robot.freshness;
  const Duration allowed{static_cast<std::int64_t>(contract.epsilon * static_cast<double>(contract.window.ns))};
  const Duration by_share = allowed + robot.control.period;
  const Duration after = robot.degraded.after;
  const Duration silence = after > Duration{} ? std::min(after, by_share) : by_share;
  const Duration played = robot.policy ? robot.policy->step_period * robot.policy->steps : contract.max_age;
  const std::string max_age = config::format_duration(contract.max_age);
  const std::string from = played < contract.max_age ? fmt::format("the chunk's end at {} (max_age {})",
                                                                   config::format_duration(played), max_age)
                                                     : "max_age " + max_age;
  std::string sentence =
      fmt::format("a silence of {} beyond {} degrades the robot", config::format_duration(silence), from);
  if (robot.policy && silence <= robot.policy->period)
    sentence += fmt::format("; the policy answers every {}: one late answer may be enough",
                            config::format_duration(robot.policy->period));
  return sentence;
}

// The lab's, in a process of its own: `takt audit` of one attestation.
int audit_of(const std::string& attestation, const ConfigOptions& options) {
  std::vector<std::string> words{"takt",    "audit",     attestation, "--recompute", options.recompute,
                                 "--robot", options.file};
  if (!options.world.empty()) words.insert(words.end(), {"--world", options.world});
  if (!options.policy_host.empty()) words.insert(words.end(), {"--policy-host", options.policy_host});
  std::vector<char*> argv;
  for (std::string& word : words) argv.push_back(word.data());
  argv.push_back(nullptr);
  std::fflush(nullptr);
  const pid_t child = ::fork();
  if (child == 0) ::_exit(hand_over(kLabProgram, argv.data()));
  int status = 0;
  if (child < 0 || ::waitpid(child, &status, 0) != child || !WIFEXITED(status)) return kExitUnavailable;
  return WEXITSTATUS(status);
}

// Of what the robot is to stay on its feet by: rollouts of each attestation that it names come out as they are said to?
int recompute_shown(const ConfigOptions& options, const config::RobotConfig& robot) {
  std::set<std::string> attestations;
  for (const config::Offer& offer : config::offered_as_safe(robot))
    if (config::is_shown(offer.shown_by)) attestations.insert(offer.shown_by);
  int worst = kExitOk;
  for (const std::string& one : attestations) {
    const int code = audit_of(one, options);
    if (code == kExitUsage || code == kExitUnavailable) return code;
    if (code != kExitOk) worst = config::kExitBadConfiguration;
  }
  if (attestations.empty()) fmt::print("recompute: the file names no attestation\n");
  return worst;
}

int check(const ConfigOptions& options) {
  const auto checked = check_robot_file(options.file);
  if (!checked) return refuse_file(checked.error(), options.json);
  const config::RobotConfig& robot = checked->robot;
  std::string refused = options.policy_host.empty() ? refused_by_policy_host(robot) : "";
  if (const std::string plant = refused_by_plant(robot, options.world); !plant.empty())
    refused += (refused.empty() ? "" : "\n") + plant;
  if (!refused.empty()) return refuse_file(refused, options.json);
  const std::vector<std::string> cautions = cautions_of(robot);
  if (options.strict && !cautions.empty()) return refuse_file(lines_of(cautions), options.json);
  if (options.json) {
    nlohmann::json buses = nlohmann::json::array();
    for (const drivers::BusLoad& load : checked->loads)
      buses.push_back({{"bus", load.bus}, {"drives", load.drives}, {"load", load.load}, {"undivided", load.undivided}});
    const nlohmann::json json{
        {"valid", true},         {"robot", robot.robot}, {"joints", robot.joints.size()},
        {"buses", buses},        {"cautions", cautions}, {"shown", evidence::standing_of(robot).shown},
        {"sha256", robot.sha256}};
    fmt::print("{}\n", json_line(json));
    return kExitOk;
  }
  fmt::print("{}: robot {}, {} joints, sha256 {}\n", config::printable(options.file), robot.robot, robot.joints.size(),
             robot.sha256);
  for (const drivers::BusLoad& load : checked->loads)
    fmt::print("bus {}: {} drives, {:.0f} % of its bit rate at worst{}\n", load.bus, load.drives, 100 * load.load,
               load.undivided > load.load
                   ? fmt::format("; every drive in every tick would take {:.0f} %", 100 * load.undivided)
                   : "");
  for (const std::string& shown : evidence::standing_of(robot).shown) fmt::print("shown: {}\n", shown);
  fmt::print("contract: {}\n", contract_sentence(robot));
  for (const std::string& caution : cautions) fmt::print("note: {}\n", caution);
  return options.recompute.empty() ? kExitOk : recompute_shown(options, robot);
}

int show(const ConfigOptions& options) {
  const auto robot = config::load(options.file);
  if (!robot) return refuse_file(robot.error(), options.json);
  const std::string text = config::with_every_default(*robot);
  if (options.json)
    fmt::print("{}\n", json_line(nlohmann::json{{"sha256", robot->sha256}, {"resolved", text}}));
  else
    fmt::print("{}", text);
  return kExitOk;
}

std::shared_ptr<ConfigOptions> add_file_command(CLI::App& parent, int& exit_code, const char* word, const char* what,
                                                const char* footer, int (*run)(const ConfigOptions&)) {
  CLI::App* command = parent.add_subcommand(word, what);
  auto options = std::make_shared<ConfigOptions>();
  command->add_option("FILE", options->file, "robot file")->required();
  command->add_flag("--json", options->json, "one line of JSON");
  command->footer(footer);
  command->callback([run, options, &exit_code] { exit_code = run(*options); });
  return options;
}

}  // namespace

void add_config(CLI::App& app, int& exit_code) {
  CLI::App* parent = app.add_subcommand("config", "Check, show or import a robot file.");
  parent->require_subcommand(1);
  const auto checked = add_file_command(
      *parent, exit_code, "check", "Say what is wrong with a robot file, or that nothing is.",
      "Example: takt config check config/arm6.yaml\n"
      "Also what takt-policy-host would refuse of an ONNX policy, and takt-plant of `simulation`.\n"
      "Exit codes: 0 valid, 65 not (one line per problem: file:line:column: what; how to correct), or\n"
      "an attestation came out otherwise; 69 --recompute without takt-lab.",
      check);
  parent->get_subcommand("check")->add_flag("--strict", checked->strict, "refuse a file with notes, too");
  parent->get_subcommand("check")->add_option(
      "--policy-host", checked->policy_host,
      "program that `takt run` will start instead of takt-policy-host: the policy is its own affair");
  add_world(*parent->get_subcommand("check"), checked->world);
  parent->get_subcommand("check")
      ->add_option("--recompute", checked->recompute,
                   "N or P%: of each attestation in shown_by, compute so many rollouts anew (takt-lab), and compare")
      ->excludes(parent->get_subcommand("check")->get_option("--json"));
  add_file_command(*parent, exit_code, "show", "Print the file with every default written out, in base units.",
                   "Example: takt config show config/arm6.yaml\nExit codes: 0 shown, 65 not valid.", show);
  CLI::App* keys = parent->add_subcommand("keys", "Print the reference of every key, as a Markdown table.");
  keys->footer("Example: takt config keys | grep freshness\nExit codes: 0.");
  keys->callback([&exit_code] {
    fmt::print("{}", config::key_table());
    exit_code = kExitOk;
  });
  CLI::App* schema = parent->add_subcommand("schema", "Print the JSON Schema of robot files, for editors.");
  schema->footer(
      "Example: takt config schema >takt.robot.schema.json\n"
      "First line of a robot file, for yaml-language-server: # yaml-language-server: $schema=takt.robot.schema.json\n"
      "Exit codes: 0.");
  schema->callback([&exit_code] {
    fmt::print("{}", config::json_schema());
    exit_code = kExitOk;
  });
  add_config_new(*parent, exit_code);
  add_config_import(*parent, exit_code);
}

}  // namespace takt::cli

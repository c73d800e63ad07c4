// takt arm, stop, reset, mark, status: one request to the executive each.
#include <fmt/format.h>

#include <cstdio>
#include <memory>
#include <nlohmann/json.hpp>

#include "cli/command.hpp"
#include "cli/run/status_text.hpp"
#include "config/load.hpp"
#include "config/paths.hpp"
#include "executive/ipc/rendezvous.hpp"

namespace takt::cli {
namespace {

constexpr auto kAnswerWithin = std::chrono::milliseconds(2000);

struct Options {
  std::string runtime_dir;
  std::string robot_file;
  bool json = false;
  bool now = false;
};

// Where the robot runs, or the exit code after its sentence was printed.
std::expected<std::string, int> runtime_dir_of(const Options& options) {
  if (!options.runtime_dir.empty()) return options.runtime_dir;
  const auto robot = config::load(options.robot_file);
  if (!robot) {
    fmt::print(stderr, "{}\n", robot.error());
    return std::unexpected(config::kExitBadConfiguration);
  }
  return config::default_runtime_directory(robot->robot);
}

void print_reply(OperatorVerb verb, const OperatorReply& reply, const Options& options) {
  const auto sentences = sentences_of(reply);
  if (options.json) {
    const nlohmann::json json{
        {"done", reply.done != 0}, {"sentences", sentences}, {"status", status_json(reply.status, reply.incident)}};
    fmt::print("{}\n", json.dump());
    return;
  }
  if (verb == OperatorVerb::status) fmt::print("{}", status_text(reply.status, reply.incident));
  for (const std::string& sentence : sentences) fmt::print(reply.done != 0 ? stdout : stderr, "{}\n", sentence);
  if (verb != OperatorVerb::status && reply.done != 0 && sentences.empty())
    fmt::print("mode {}\n", name(reply.status.tick.mode));
}

int request(OperatorVerb verb, const Options& options) {
  const auto directory = runtime_dir_of(options);
  if (!directory) return directory.error();
  const auto reply = ipc::ask(config::executive_socket(*directory), verb, kAnswerWithin);
  if (!reply) {
    if (options.json)
      fmt::print("{}\n", nlohmann::json{{"done", false}, {"sentences", {reply.error()}}, {"status", nullptr}}.dump());
    else
      fmt::print(stderr, "no executive answers in {}: {}\n", *directory, reply.error());
    return kExitUnavailable;
  }
  print_reply(verb, *reply, options);
  return verb == OperatorVerb::status || reply->done != 0 ? kExitOk : kExitFailed;
}

void add(CLI::App& app, int& exit_code, OperatorVerb verb, const char* word, const char* what, const char* footer) {
  CLI::App* command = app.add_subcommand(word, what);
  auto options = std::make_shared<Options>();
  CLI::Option_group* where = command->add_option_group("where", "which running robot");
  where->add_option("--runtime-dir", options->runtime_dir, "its runtime directory");
  where->add_option("--robot", options->robot_file, "its robot file; runs in /run/takt/NAME");
  where->require_option(1);
  command->add_flag("--json", options->json, "one line of JSON");
  command->footer(footer);
  command->callback(
      [verb, options, &exit_code] { exit_code = request(options->now ? OperatorVerb::deenergise : verb, *options); });
  if (verb == OperatorVerb::press_stop)
    command->add_flag("--now", options->now, "take the drives' power away at once, in every mode: what hangs falls");
}

}  // namespace

void add_arm(CLI::App& app, int& exit_code) {
  add(app, exit_code, OperatorVerb::arm, "arm", "Enable the drives and let the policy move the robot.",
      "Example: takt arm --robot config/arm6.yaml\n"
      "Exit codes: 0 arming, 1 refused (what is missing, one per line), 65 configuration, 69 not running.");
}

void add_stop(CLI::App& app, int& exit_code) {
  add(app, exit_code, OperatorVerb::press_stop, "stop",
      "Stop softly: damping until the robot rests, then hold. A second time: no power, in every mode.",
      "Example: takt stop --robot config/arm6.yaml\n"
      "The second stop may come 0.2 s after the first, until the stop is reset. What hangs falls.\n"
      "Exit codes: 0 stopping, 65 configuration, 69 not running, or handed over without an answer.");
}

void add_reset(CLI::App& app, int& exit_code) {
  add(app, exit_code, OperatorVerb::reset, "reset", "Clear a latched stop or fault: back to standby.",
      "Example: takt reset --robot config/arm6.yaml\n"
      "Exit codes: 0 reset, 1 refused (what still holds), 65 configuration, 69 not running.");
}

void add_mark(CLI::App& app, int& exit_code) {
  add(app, exit_code, OperatorVerb::mark, "mark", "Mark this instant in the run; takt report lists the marks.",
      "Example: takt mark --robot config/arm6.yaml\n"
      "Exit codes: 0 marked, 1 the control thread does not answer, 65 configuration, 69 not running.");
}

void add_status(CLI::App& app, int& exit_code) {
  add(app, exit_code, OperatorVerb::status, "status", "Mode, age of the command, misses, overruns.",
      "Example: takt status --robot config/arm6.yaml --json\n"
      "Exit codes: 0 running, 65 configuration, 69 not running.");
}

}  // namespace takt::cli

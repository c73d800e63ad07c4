// SPDX-License-Identifier: Apache-2.0
// takt arm, stop, reset, mark, status: one request to the executive each.
#include <fmt/format.h>
#include <fmt/ranges.h>
#include <unistd.h>

#include <algorithm>
#include <array>
#include <cstdio>
#include <fstream>
#include <memory>
#include <nlohmann/json.hpp>
#include <string>
#include <thread>
#include <vector>

#include "cli/command.hpp"
#include "cli/json_line.hpp"
#include "cli/run/status_text.hpp"
#include "cli/running_robots.hpp"
#include "config/load.hpp"
#include "config/paths.hpp"
#include "config/printable.hpp"
#include "executive/ipc/rendezvous.hpp"

namespace takt::cli {
namespace {

constexpr const char* kReplySchema = "takt.reply/1";
constexpr auto kOperatorAnswersWithin = std::chrono::milliseconds(2000);

struct OperatorOptions {
  std::string runtime_dir;
  std::string robot_file;
  bool json = false;
  bool now = false;
  bool all = false;
  std::vector<std::string> text;  // of a mark, word by word
};

// The value of `robot: NAME`, at the beginning of a line. Nothing else in the file is looked at: a robot can be stopped
// while its file is being edited, and without what reads all of it.
std::expected<std::string, Refusal> robot_named_in(const std::string& path) {
  constexpr std::string_view kKey = "robot:", kSpace = " \t\r";
  std::ifstream file(path);
  for (std::string line; std::getline(file, line);) {
    std::string_view value = line;
    if (!value.starts_with(kKey)) continue;
    value = value.substr(0, value.find('#')).substr(kKey.size());
    value.remove_prefix(std::min(value.find_first_not_of(kSpace), value.size()));
    value = value.substr(0, value.find_last_not_of(kSpace) + 1);
    if (value.size() >= 2 && (value.front() == '"' || value.front() == '\'') && value.back() == value.front())
      value = value.substr(1, value.size() - 2);
    if (!value.empty()) return std::string(value);
  }
  return std::unexpected(Refusal{config::kExitBadConfiguration,
                                 fmt::format("{}: {}; name the robot's --runtime-dir", config::printable(path),
                                             file.eof() ? "no line begins with `robot: NAME`" : "cannot be read")});
}

bool runs(const std::string& name) {
  const std::vector<RunningRobot> robots = running_robots(places_of_this_user());
  return std::ranges::find(robots, name, &RunningRobot::name) != robots.end();
}

std::expected<std::string, Refusal> runtime_dir_of(const OperatorOptions& options) {
  if (!options.runtime_dir.empty()) return options.runtime_dir;
  std::string name;
  if (!options.robot_file.empty()) {
    const bool is_file = access(options.robot_file.c_str(), F_OK) == 0;
    auto named = is_file || !runs(options.robot_file) ? robot_named_in(options.robot_file) : options.robot_file;
    if (!named) return std::unexpected(named.error());
    name = std::move(*named);
  }
  auto running = the_running_robot(places_of_this_user(), name);
  if (!running) return std::unexpected(running.error());
  return std::move(running->runtime_directory);
}

// Before the executive was asked. `sentence`: for a person, where it says more than a program needs.
int refuse_request(const Refusal& refusal, bool json, const std::string& sentence = {}) {
  if (json)
    fmt::print("{}\n",
               json_line(nlohmann::json{
                   {"schema", kReplySchema}, {"done", false}, {"sentences", {refusal.sentence}}, {"status", nullptr}}));
  else
    fmt::print(stderr, "{}\n", sentence.empty() ? refusal.sentence : sentence);
  return refusal.exit_code;
}

nlohmann::json what_runs_json(const WhatRuns& runs) {
  return {{"robot", runs.robot},
          {"file", runs.file},
          {"config_hash", runs.config_hash},
          {"policy_hash", runs.policy_hash},
          {"version", runs.version}};
}

std::string what_runs_text(const WhatRuns& runs) {
  const std::string file = runs.file.empty() ? "" : ", " + runs.file;
  return fmt::format("robot      {}{}; hashes: file {}, policy {}\n", runs.robot, file, runs.config_hash,
                     runs.policy_hash);
}

// What keeps the robot where it is, or does not; empty: it was not asked to stop.
std::string_view after_stop(OperatorVerb verb, Mode mode) {
  const bool is_stop =
      verb == OperatorVerb::press_stop || verb == OperatorVerb::stop || verb == OperatorVerb::deenergise;
  if (!is_stop) return "";
  if (mode == Mode::standby) return ": no drive has power; the next `takt arm` moves the robot";
  if (mode != Mode::damped_stop && mode != Mode::fault_latched) return "";
  return verb == OperatorVerb::press_stop ? ": `takt arm` is refused until `takt reset`, a second stop or a restart"
                                          : ": `takt arm` is refused until `takt reset` or a restart";
}

void print_reply(OperatorVerb verb, const OperatorReply& reply, const OperatorOptions& options,
                 const std::string& directory) {
  const auto sentences = sentences_of(reply);
  if (options.json) {
    nlohmann::json json{{"schema", kReplySchema},
                        {"done", reply.done != 0},
                        {"sentences", sentences},
                        {"status", status_json(reply.status, reply.incident)}};
    if (verb == OperatorVerb::status) json["runs"] = what_runs_json(what_runs_in(directory));
    fmt::print("{}\n", json_line(json));
    return;
  }
  if (verb == OperatorVerb::status)
    fmt::print("{}{}", status_text(reply.status, reply.incident), what_runs_text(what_runs_in(directory)));
  for (const std::string& sentence : sentences) fmt::print(reply.done != 0 ? stdout : stderr, "{}\n", sentence);
  if (verb != OperatorVerb::status && reply.done != 0 && sentences.empty())
    fmt::print("mode {}{}\n", name(reply.status.tick.mode), after_stop(verb, reply.status.tick.mode));
}

struct Stopped {
  RunningRobot robot;
  std::expected<OperatorReply, std::string> reply = std::unexpected("");
};

int exit_code_of(const Stopped& stopped) {
  if (!stopped.reply) return kExitUnavailable;
  return stopped.reply->done != 0 ? kExitOk : kExitFailed;
}

std::string text_of(OperatorVerb verb, const Stopped& stopped) {
  if (!stopped.reply)
    return fmt::format("no executive answers in {}: {}", stopped.robot.runtime_directory, stopped.reply.error());
  const auto sentences = sentences_of(*stopped.reply);
  const Mode mode = stopped.reply->status.tick.mode;
  return sentences.empty() ? fmt::format("mode {}{}", name(mode), after_stop(verb, mode))
                           : fmt::format("{}", fmt::join(sentences, "; "));
}

nlohmann::json json_of(OperatorVerb verb, const Stopped& stopped) {
  nlohmann::json json{{"robot", stopped.robot.name},
                      {"runtime_dir", stopped.robot.runtime_directory},
                      {"done", exit_code_of(stopped) == kExitOk},
                      {"sentences", {text_of(verb, stopped)}},
                      {"status", nullptr}};
  if (stopped.reply) json["status"] = status_json(stopped.reply->status, stopped.reply->incident);
  return json;
}

// Each in a thread of its own: one that hangs keeps no other from being stopped. A stop as a program asks for it: it
// may be repeated, and is never a second press, which would take the power of a robot that was stopped before.
int stop_all(OperatorVerb asked, bool json) {
  const OperatorVerb verb = asked == OperatorVerb::press_stop ? OperatorVerb::stop : asked;
  std::vector<Stopped> all;
  for (RunningRobot& robot : running_robots_anywhere(places_of_this_user())) all.push_back({.robot = std::move(robot)});
  if (all.empty()) return refuse_request(the_running_robot(places_of_this_user(), {}).error(), json);
  {
    std::vector<std::jthread> threads;
    threads.reserve(all.size());
    for (Stopped& one : all)
      threads.emplace_back([verb, &one] {
        const std::string socket = config::executive_socket(one.robot.runtime_directory);
        one.reply = ipc::ask(socket, verb, kOperatorAnswersWithin);
      });
  }
  int exit_code = kExitOk;
  nlohmann::json robots = nlohmann::json::array();
  for (const Stopped& one : all) {
    exit_code = std::max(exit_code, exit_code_of(one));
    if (json)
      robots.push_back(json_of(verb, one));
    else
      fmt::print(exit_code_of(one) == kExitOk ? stdout : stderr, "{}: {}\n", one.robot.name, text_of(verb, one));
  }
  if (json) fmt::print("{}\n", json_line(nlohmann::json{{"schema", "takt.replies/1"}, {"robots", robots}}));
  return exit_code;
}

// Where none runs that a command finds by itself: those that it must be told of.
std::string elsewhere(const OperatorOptions& options) {
  if (!options.runtime_dir.empty()) return {};
  std::string lines;
  for (const RunningRobot& robot : running_robots_anywhere(places_of_this_user()))
    lines += fmt::format("\n  elsewhere {}: --runtime-dir {}", robot.name, robot.runtime_directory);
  return lines;
}

// Who stops "the" robot must not turn away from another that moves on.
void tell_others(const OperatorOptions& options, const std::string& stopped) {
  if (!options.runtime_dir.empty() || !options.robot_file.empty()) return;
  for (const RunningRobot& robot : running_robots_anywhere(places_of_this_user()))
    if (robot.runtime_directory != stopped)
      fmt::print(stderr, "note: {} runs on: takt stop --runtime-dir {}, or takt stop --all\n", robot.name,
                 robot.runtime_directory);
}

int request(OperatorVerb verb, const OperatorOptions& options) {
  if (options.all) return stop_all(verb, options.json);
  auto directory = runtime_dir_of(options);
  if (!directory && directory.error().exit_code == kExitUsage && verb == OperatorVerb::press_stop)
    directory.error().sentence += "\n  all of them: takt stop --all";
  if (!directory && directory.error().exit_code == kExitUnavailable) directory.error().sentence += elsewhere(options);
  if (!directory) return refuse_request(directory.error(), options.json);
  std::string text;
  for (const std::string& word : options.text) text += (text.empty() ? "" : " ") + word;
  if (text.size() > ipc::kLongestMark)
    return refuse_request({kExitUsage, fmt::format("takt mark: {} bytes of text, and at most {} are kept: say less",
                                                   text.size(), ipc::kLongestMark)},
                          options.json);
  const auto reply = ipc::ask(config::executive_socket(*directory), verb, kOperatorAnswersWithin, 0, text);
  if (!reply)
    return refuse_request({kExitUnavailable, reply.error()}, options.json,
                          fmt::format("no executive answers in {}: {}", *directory, reply.error()));
  print_reply(verb, *reply, options, *directory);
  if (!options.json && !after_stop(verb, reply->status.tick.mode).empty()) tell_others(options, *directory);
  return verb == OperatorVerb::status || reply->done != 0 ? kExitOk : kExitFailed;
}

void add(CLI::App& app, int& exit_code, OperatorVerb verb, const char* word, const char* what, const char* footer) {
  CLI::App* command = app.add_subcommand(word, what);
  auto options = std::make_shared<OperatorOptions>();
  CLI::Option_group* where = command->add_option_group("where", "which running robot, where there are several");
  where->add_option("--runtime-dir", options->runtime_dir, "its runtime directory");
  where->add_option("--robot", options->robot_file, "its robot file, or its name");
  if (verb == OperatorVerb::press_stop)  // what a hand types in a hurry
    for (const char* const alias : {"halt", "kill", "disarm"}) command->alias(alias);
  if (verb == OperatorVerb::press_stop)
    where->add_flag("--all", options->all,
                    "every robot of this user and of the units; softly, however often it is asked");
  where->require_option(0, 1);
  command->add_flag("--json", options->json, "one line of JSON");
  command->footer(footer);
  command->callback(
      [verb, options, &exit_code] { exit_code = request(options->now ? OperatorVerb::deenergise : verb, *options); });
  if (verb == OperatorVerb::mark)
    command->add_option("TEXT", options->text, "what it is: a few words, kept with the mark");
  if (verb == OperatorVerb::press_stop)
    command->add_flag("--now", options->now, "take the drives' power away at once, in every mode: what hangs falls");
}

}  // namespace

void add_arm(CLI::App& app, int& exit_code) {
  add(app, exit_code, OperatorVerb::arm, "arm", "Enable the drives and let the policy move the robot.",
      "Example: takt arm\n"
      "Exit codes: 0 arming, 1 refused (what is missing, one per line), 64 several run, 65 configuration, 69 none "
      "runs.");
}

void add_stop(CLI::App& app, int& exit_code) {
  add(app, exit_code, OperatorVerb::press_stop, "stop",
      "Stop softly: damping until the robot rests, then hold. A second time: no power, in every mode.",
      "Example: takt stop, takt stop --all\n"
      "`takt halt`, `takt kill` and `takt disarm` are the same.\n"
      "The second stop may come 0.2 s after the first, until the stop is reset. What hangs falls.\n"
      "After one stop of an armed robot `takt arm` is refused until `takt reset` or the executive's end; after the\n"
      "second, or --now, it is not.\n"
      "Exit codes: 0 stopping, 64 several run, 65 configuration, 69 none runs, or handed over without an answer.");
}

void add_reset(CLI::App& app, int& exit_code) {
  add(app, exit_code, OperatorVerb::reset, "reset", "Clear a latched stop or fault: back to standby.",
      "Example: takt reset\n"
      "Exit codes: 0 reset, 1 refused (what still holds), 64 several run, 65 configuration, 69 none runs.");
}

void add_mark(CLI::App& app, int& exit_code) {
  add(app, exit_code, OperatorVerb::mark, "mark", "Mark this instant in the run; takt report lists the marks.",
      "Example: takt mark the gripper slips\n"
      "Exit codes: 0 marked, 1 the control thread does not answer, 64 several run, 65 configuration, 69 none runs.");
}

void add_status(CLI::App& app, int& exit_code) {
  add(app, exit_code, OperatorVerb::status, "status", "Mode, age of the command, misses, overruns.",
      "Example: takt status --json\n"
      "Exit codes: 0 running, 64 several run, 65 configuration, 69 none runs.");
}

std::span<const AddCommand> operator_commands() {
  static constexpr std::array kCommands{add_arm, add_stop, add_reset, add_mark, add_status};
  return kCommands;
}

}  // namespace takt::cli

// SPDX-License-Identifier: Apache-2.0
// takt top: a running robot, live in a terminal.
#include <fmt/format.h>
#include <unistd.h>

#include <chrono>
#include <cstdio>
#include <future>
#include <memory>
#include <nlohmann/json.hpp>
#include <optional>
#include <thread>

#include "cli/command.hpp"
#include "cli/evidence/trace_snapshot.hpp"
#include "cli/json_line.hpp"
#include "cli/run/status_text.hpp"
#include "cli/running_robots.hpp"
#include "cli/top/attachment.hpp"
#include "cli/top/keys.hpp"
#include "cli/top/picture_json.hpp"
#include "cli/top/screen.hpp"
#include "cli/top/terminal.hpp"
#include "config/load.hpp"
#include "config/paths.hpp"
#include "executive/contract/monotonic_clock.hpp"
#include "executive/ipc/rendezvous.hpp"

namespace takt::cli {
namespace {

namespace top = monitor::top;

constexpr std::chrono::milliseconds kFramePeriod{100};
constexpr std::chrono::milliseconds kTopAnswersWithin{2000};
constexpr int kLooksForATick = 20;  // of --once, kFramePeriod apart

struct TopOptions {
  std::string robot_file, runtime_dir;
  bool once = false, json = false, ascii = false;
};

std::string joined(const std::vector<std::string>& sentences) {
  std::string text;
  for (const std::string& sentence : sentences) text += (text.empty() ? "" : "; ") + sentence;
  return text;
}

// The live view: one look, one screen, the keys typed meanwhile, ten times a second.
class Console {
 public:
  Console(const config::RobotConfig& robot, const std::string& runtime_directory, top::Glyphs glyphs)
      : view_(robot),
        attachment_(robot, runtime_directory, view_),
        keys_(robot.joints.size()),
        socket_(config::executive_socket(runtime_directory)),
        glyphs_(glyphs) {}

  void run(top::Terminal& terminal) {
    while (!terminal.ended() && !quit_) {
      const MonoTime now = monotonic_now();
      attachment_.look(now);
      take_snapshot_result(now);
      terminal.show(top::render(view_.picture(now), keys_.prompt(now), terminal.size(), glyphs_));
      for (const char key : top::keys_of(terminal.read(kFramePeriod)))
        if (const auto wish = keys_.press(key, monotonic_now())) fulfil(*wish);
    }
  }

 private:
  void fulfil(top::Wish wish) {
    switch (wish) {
      case top::Wish::quit:
        quit_ = true;
        return;
      case top::Wish::arm:
        return ask(OperatorVerb::arm, "arming");
      case top::Wish::stop:
        return ask(OperatorVerb::stop, "stopping");
      case top::Wish::reset:
        return ask(OperatorVerb::reset, "reset");
      case top::Wish::mark:
        return ask(OperatorVerb::mark, "marked");
      case top::Wish::snapshot:
        // Elsewhere: lttng takes its time, and a stop must not wait for it.
        if (!snapshot_) snapshot_ = std::async(std::launch::async, [] { return trace_snapshot(""); });
        return;
    }
  }

  void ask(OperatorVerb verb, std::string_view done) {
    const auto reply = ipc::ask(socket_, verb, kTopAnswersWithin);
    if (!reply) return keys_.note(reply.error(), true, monotonic_now());
    const std::string said = joined(sentences_of(*reply));
    const bool refused = reply->done == 0;
    keys_.note(said.empty() ? std::string(done) : (refused ? "refused: " : "") + said, refused, monotonic_now());
  }

  void take_snapshot_result(MonoTime now) {
    if (!snapshot_ || snapshot_->wait_for(std::chrono::seconds(0)) != std::future_status::ready) return;
    const auto where = snapshot_->get();
    snapshot_.reset();
    keys_.note(where ? "snapshot in " + *where : where.error().sentence, !where, now);
  }

  top::LiveView view_;
  top::Attachment attachment_;
  top::Keys keys_;
  std::string socket_;
  top::Glyphs glyphs_;
  std::optional<std::future<std::expected<std::string, Refusal>>> snapshot_;
  bool quit_ = false;
};

// The past that the rings hold makes one frame; only an executive that has just started keeps us waiting.
std::expected<top::Picture, Refusal> one_picture(const config::RobotConfig& robot, const std::string& directory) {
  top::LiveView view(robot);
  top::Attachment attachment(robot, directory, view);
  for (int look = 0;; ++look) {
    const MonoTime now = monotonic_now();
    attachment.look(now);
    top::Picture picture = view.picture(now);
    if (picture.link == top::Link::waiting) return std::unexpected(Refusal{kExitUnavailable, picture.why});
    if (picture.tick.tick != 0 || look == kLooksForATick) return picture;
    std::this_thread::sleep_for(kFramePeriod);
  }
}

int print_once(const config::RobotConfig& robot, const std::string& directory, const TopOptions& options,
               top::Glyphs glyphs) {
  const auto picture = one_picture(robot, directory);
  if (!picture) {
    fmt::print(stderr, "no executive answers in {}: {}\n", directory, picture.error().sentence);
    return picture.error().exit_code;
  }
  if (options.json) {
    fmt::print("{}\n", json_line(top::to_json(*picture)));
    return kExitOk;
  }
  const bool coloured = isatty(STDOUT_FILENO) != 0 && top::wants_colour();
  for (const top::Line& line : top::render(*picture, {}, {}, glyphs)) fmt::print("{}\n", encoded(line, coloured));
  return kExitOk;
}

struct Subject {
  config::RobotConfig robot;
  std::string runtime_directory;
};

std::expected<config::RobotConfig, Refusal> load_robot_file(const std::string& path) {
  auto robot = config::load(path);
  if (!robot) return std::unexpected(Refusal{config::kExitBadConfiguration, robot.error()});
  return std::move(*robot);
}

// Nothing named: the one that runs. Only its file named: where it runs, or will.
std::expected<Subject, Refusal> subject_of(const TopOptions& options) {
  Subject subject{{}, options.runtime_dir};
  if (!options.robot_file.empty()) {
    auto robot = load_robot_file(options.robot_file);
    if (!robot) return std::unexpected(robot.error());
    subject.robot = std::move(*robot);
    if (!subject.runtime_directory.empty()) return subject;
    subject.runtime_directory = config::default_runtime_directory(subject.robot.robot);
    const auto running = the_running_robot(places_of_this_user(), subject.robot.robot);
    if (running) subject.runtime_directory = running->runtime_directory;
    if (!running && running.error().exit_code != kExitUnavailable) return std::unexpected(running.error());
    return subject;
  }
  if (subject.runtime_directory.empty()) {
    const auto running = the_running_robot(places_of_this_user(), {});
    if (!running) return std::unexpected(running.error());
    subject.runtime_directory = running->runtime_directory;
  }
  const std::string file = remembered_robot_file(subject.runtime_directory);
  if (file.empty())
    return std::unexpected(Refusal{
        kExitUsage, fmt::format("which robot runs in {}? Name its file with --robot", subject.runtime_directory)});
  auto robot = load_robot_file(file);
  if (!robot) return std::unexpected(robot.error());
  subject.robot = std::move(*robot);
  return subject;
}

int run_top(const TopOptions& options) {
  const auto subject = subject_of(options);
  if (!subject) {
    fmt::print(stderr, "{}\n", subject.error().sentence);
    return subject.error().exit_code;
  }
  const auto& [robot, directory] = *subject;
  const top::Glyphs glyphs = options.ascii ? top::Glyphs::ascii : top::glyphs_of_locale();
  if (options.once) return print_once(robot, directory, options, glyphs);
  Console console(robot, directory, glyphs);
  const auto terminal = top::Terminal::open(top::wants_colour());
  if (!terminal) {
    fmt::print(stderr, "takt top: {}\n", terminal.error());
    return kExitUsage;
  }
  console.run(**terminal);
  return kExitOk;
}

}  // namespace

void add_top(CLI::App& app, int& exit_code) {
  CLI::App* command = app.add_subcommand("top", "A running robot, live: mode, ages, misses, buses, joints; arm, stop.");
  auto options = std::make_shared<TopOptions>();
  command->add_option("--robot", options->robot_file, "its robot file; default: what it was started with");
  command->add_option("--runtime-dir", options->runtime_dir, "its runtime directory; default: the running robot's");
  command->add_flag("--ascii", options->ascii, "no characters beyond ASCII; the default where the locale is not UTF-8");
  CLI::Option* const once = command->add_flag("--once", options->once, "print one frame of 80 x 24 and end");
  command->add_flag("--json", options->json, "with --once: the same as one line of JSON")->needs(once);
  command->footer(
      "Example: takt top\n"
      "Keys: a arm (asks), s stop, r reset, m mark, p trace snapshot, ? help, q quit. Waits for the executive, and for "
      "its return.\n"
      "Exit codes: 0 ended by q or a signal, or printed; 64 command line, several run, or no terminal; 65 "
      "configuration; "
      "69 no robot runs. See docs/top.md.");
  command->callback([options, &exit_code] { exit_code = run_top(*options); });
}

}  // namespace takt::cli

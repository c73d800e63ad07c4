// SPDX-License-Identifier: Apache-2.0
// takt bus: what is on a robot's CAN buses.
#include <fmt/format.h>
#include <unistd.h>

#include <csignal>
#include <cstdio>
#include <ctime>
#include <memory>

#include "cli/command.hpp"
#include "cli/quantity_option.hpp"
#include "cli/robot/bus_watch.hpp"
#include "cli/robot/direct_bus.hpp"
#include "executive/contract/monotonic_clock.hpp"

namespace takt::cli {
namespace {

struct BusOptions {
  std::string robot_file, runtime_dir;
  double seconds = 0;
  bool json = false, listen = false;
};

constexpr Duration kLookPeriod = milliseconds(5), kShowPeriod = milliseconds(500);
constexpr Duration kListenFirst = milliseconds(500);  // for commands of another program

volatile std::sig_atomic_t g_watch_interrupted = 0;

void pause_for(Duration span) {
  const timespec pause{span.ns / 1'000'000'000, span.ns % 1'000'000'000};
  ::nanosleep(&pause, nullptr);
}

void say_that_it_asks(bool json) {
  if (!json)
    fmt::print(stderr,
               "no other program asks the drives: this one does, and keeps them disabled (--listen: it does not)\n");
}

std::expected<int, Refusal> watch(const BusOptions& options) {
  const auto robot = load_robot(options.robot_file, options.runtime_dir);
  if (!robot) return std::unexpected(robot.error());
  std::vector<std::unique_ptr<drivers::CanBus>> buses;
  for (std::size_t bus = 0; bus < robot->config.buses.size(); ++bus) {
    auto opened = open_bus(*robot, bus);
    if (!opened) return std::unexpected(opened.error());
    buses.push_back(std::move(*opened));
  }
  BusWatch watched(robot->config, std::move(buses));
  std::signal(SIGINT, [](int) { g_watch_interrupted = 1; });
  const bool redraw = ::isatty(STDOUT_FILENO) != 0 && !options.json;
  const MonoTime started = monotonic_now();
  MonoTime shown = started;
  const auto over = [&](MonoTime now) {
    return g_watch_interrupted != 0 || (options.seconds > 0 && (now - started).seconds() >= options.seconds);
  };
  watched.count(started);
  // Held for as long as it may ask: no other process does meanwhile.
  std::expected<std::vector<drivers::InterfaceClaim>, Refusal> alone = std::unexpected(Refusal{});
  if (!options.listen) alone = require_alone(*robot);
  bool may_ask = alone.has_value(), asks = false;
  for (MonoTime now = started; !over(now); now = monotonic_now()) {
    if (may_ask && now - started >= kListenFirst) {
      may_ask = false;
      asks = !watched.heard_commands();
      if (asks) say_that_it_asks(options.json);
      if (asks) watched.begin_to_ask();
    }
    watched.listen();
    if (now - shown >= kShowPeriod && redraw) {
      watched.count(now);
      fmt::print("\x1b[H\x1b[2J{}", watched.table(now));
      std::fflush(stdout);
      shown = now;
    }
    pause_for(asks ? robot->config.control.period : kLookPeriod);
  }
  if (!redraw) watched.count(monotonic_now());
  fmt::print("{}{}", options.json ? watched.json(monotonic_now()) : watched.table(monotonic_now()),
             options.json ? "\n" : "");
  return kExitOk;
}

}  // namespace

void add_bus(CLI::App& app, int& exit_code) {
  CLI::App* bus = app.add_subcommand("bus", "What is on a robot's CAN buses.");
  bus->require_subcommand(1);
  add_bus_scan(*bus, exit_code);
  add_bus_zero(*bus, exit_code);
  add_bus_up(*bus, exit_code);
  add_bus_disable(*bus, exit_code);
  auto options = std::make_shared<BusOptions>();
  CLI::App* command = bus->add_subcommand("watch", "What the drives say, decoded, live.");
  command->add_option("--robot", options->robot_file, "robot file")->required();
  command->add_option("--runtime-dir", options->runtime_dir,
                      "where loopback buses are (default ROBOT in $XDG_RUNTIME_DIR/takt, as root /run/takt)");
  add_quantity(*command, "--seconds", options->seconds, "s", "end after this long; default: at Ctrl-C")
      ->check(CLI::PositiveNumber);
  command->add_flag("--json", options->json, "at the end, one line of JSON instead of the table");
  command->add_flag("--listen", options->listen, "send nothing, even if no other program asks the drives");
  command->footer(
      "Example: takt bus watch --robot robot.yaml --seconds 2\n"
      "Beside an executive, or another program whose commands are heard, it listens. Where there is none it asks the "
      "drives\nafter half a second: it tells them to be disabled, sets them up, and shows what they refuse.\n"
      "Replies per second are over the last half second, with --json or --seconds over the whole time.\n"
      "Exit codes: 0 watched, 64 command line, 65 configuration, 69 a bus is not there.");
  command->callback([options, &exit_code] {
    const auto done = watch(*options);
    if (!done) fmt::print(stderr, "takt bus watch: {}\n", done.error().sentence);
    exit_code = done ? *done : done.error().exit_code;
  });
}

}  // namespace takt::cli

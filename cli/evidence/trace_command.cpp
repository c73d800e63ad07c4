// SPDX-License-Identifier: Apache-2.0
// takt trace start, snapshot, stop: records the trace points of all Takt processes of this machine with LTTng's own
// tools.
#include <fmt/format.h>
#include <unistd.h>

#include <chrono>
#include <cstdio>
#include <expected>
#include <filesystem>
#include <memory>
#include <optional>
#include <thread>
#include <vector>

#include "cli/command.hpp"
#include "cli/evidence/trace_snapshot.hpp"
#include "cli/evidence/traceable_processes.hpp"
#include "cli/run/external_tool.hpp"
#include "config/printable.hpp"
#include "executive/contract/mode.hpp"
#include "monitor/record/run_folder.hpp"

namespace takt::cli {
namespace {

constexpr const char* kSession = "takt";
// Per core 8 x 256 KiB: several seconds of a 1 kHz loop with a policy, so that a slow disk loses nothing and a flight
// recorder has something to tell. Locked memory of the executive grows by it.
constexpr const char* kBufferSize = "--subbuf-size=256K";
constexpr const char* kBufferCount = "--num-subbuf=8";
// The consumer looks for full buffers by itself: without it the traced thread would wake it with a system call.
constexpr const char* kReadTimer = "--read-timer=200000";

using Done = std::expected<void, Refusal>;

constexpr const char* kTrigger = "takt-left-tracking";

struct TraceOptions {
  std::string output;
  bool flight_recorder = false;
  bool snapshot_on_leaving_tracking = false;
};

std::string first_line(const std::string& text) {
  return text.substr(0, text.find('\n'));
}

Done lttng(std::vector<std::string> arguments) {
  arguments.insert(arguments.begin(), {"lttng", "--no-sessiond"});
  const ToolResult result = run_tool(arguments);
  if (result.exit_code == 0) return {};
  if (result.exit_code == kToolMissing)
    return std::unexpected(Refusal{kExitUnavailable, "lttng is not installed: apt-get install lttng-tools"});
  return std::unexpected(
      Refusal{kExitFailed, fmt::format("lttng {} failed: {}", arguments[2], first_line(result.output))});
}

// LTTng's kernel modules are packages of their own (lttng-modules-dkms) and need root.
bool has_kernel_tracer() {
  return geteuid() == 0 && run_tool({"modprobe", "--dry-run", "--quiet", "lttng-tracer"}).exit_code == 0;
}

// User space only where there are no kernel modules, so that neither they nor root are needed.
Done ensure_session_daemon() {
  const Done running = lttng({"list"});
  if (running || running.error().exit_code == kExitUnavailable) return running;
  std::vector<std::string> daemon{"lttng-sessiond", "--daemonize"};
  if (!has_kernel_tracer()) daemon.emplace_back("--no-kernel");
  const ToolResult started = run_tool(std::move(daemon));
  if (started.exit_code == kToolMissing)
    return std::unexpected(Refusal{kExitUnavailable, "lttng-sessiond is not installed: apt-get install lttng-tools"});
  if (started.exit_code != 0)
    return std::unexpected(Refusal{kExitUnavailable, "lttng-sessiond did not start: " + first_line(started.output)});
  return {};
}

// Text of the first element of that name that has one.
std::string element(const std::string& xml, const std::string& name) {
  const std::string open = "<" + name + ">";
  for (std::size_t at = xml.find(open); at != std::string::npos; at = xml.find(open, at + 1)) {
    const std::size_t begin = at + open.size();
    const std::size_t end = xml.find('<', begin);
    if (end != std::string::npos && end != begin) return xml.substr(begin, end - begin);
  }
  return {};
}

// Where the running session writes; nothing when there is none. LTTng keeps a flight recorder's folder elsewhere.
std::optional<std::string> trace_directory() {
  const ToolResult listed = run_tool({"lttng", "--no-sessiond", "--mi", "xml", "list", kSession});
  if (listed.exit_code != 0) return std::nullopt;
  if (std::string path = element(listed.output, "path"); !path.empty()) return path;
  return element(
      run_tool({"lttng", "--no-sessiond", "--mi", "xml", "snapshot", "list-output", "--session", kSession}).output,
      "ctrl_url");
}

// Which thread had each core, beside our events: what kept a tick or an inference from running.
Done add_scheduling(const TraceOptions& options) {
  if (!lttng({"list", "--kernel"})) {
    fmt::print("without the kernel's scheduling events: no kernel tracer (root and lttng-modules-dkms)\n");
    return {};
  }
  std::vector<std::string> channel{"enable-channel", "--kernel",  kBufferSize, kBufferCount,
                                   kReadTimer,       "--session", kSession,    kSession};
  if (options.flight_recorder) channel.insert(channel.begin() + 1, "--overwrite");
  if (auto done = lttng(std::move(channel)); !done) return done;
  return lttng({"enable-event", "--kernel", "--session", kSession, "--channel", kSession,
                "sched_switch,sched_waking,sched_migrate_task,irq_handler_entry,irq_handler_exit"});
}

// The monitor says each change of mode; the session daemon acts on it. The control thread has no part in either.
Done snapshot_on_leaving_tracking() {
  constexpr auto kTracking = static_cast<int>(Mode::tracking);
  (void)lttng({"remove-trigger", kTrigger});  // of a session that was not ended by takt trace stop
  return lttng({"add-trigger", fmt::format("--name={}", kTrigger), "--condition=event-rule-matches",
                "--type=user:tracepoint", "--name=takt:mode_changed",
                fmt::format("--filter=previous_mode == {} && mode != {}", kTracking, kTracking),
                "--action=snapshot-session", kSession});
}

Done set_up(const TraceOptions& options) {
  std::vector<std::string> channel{"enable-channel", "--userspace", kBufferSize, kBufferCount,
                                   kReadTimer,       "--session",   kSession,    kSession};
  if (options.flight_recorder) channel.insert(channel.begin() + 1, "--overwrite");
  if (auto done = lttng(std::move(channel)); !done) return done;
  if (auto done = lttng({"add-context", "--userspace", "--session", kSession, "--channel", kSession, "--type=vpid"});
      !done)
    return done;
  if (auto done = lttng({"enable-event", "--userspace", "--session", kSession, "--channel", kSession, "takt:*"}); !done)
    return done;
  if (auto done = add_scheduling(options); !done) return done;
  if (options.snapshot_on_leaving_tracking) {
    if (auto done = snapshot_on_leaving_tracking(); !done) return done;
  }
  return lttng({"start", kSession});
}

// Running processes learn of a session daemon by themselves, but after one that was killed hard they look only every
// 5 s. A trace that has begun is one that they are in.
void wait_until_registered() {
  constexpr auto kLookEvery = std::chrono::milliseconds(50);
  constexpr auto kPatience = std::chrono::seconds(15);
  const auto deadline = std::chrono::steady_clock::now() + kPatience;
  std::vector<TraceableProcess> missing;
  while (true) {
    missing = traceable_processes();
    const std::string listing = run_tool({"lttng", "--no-sessiond", "list", "--userspace"}).output;
    std::erase_if(missing, [&](const TraceableProcess& process) { return is_registered(listing, process.pid); });
    if (missing.empty() || std::chrono::steady_clock::now() > deadline) break;
    std::this_thread::sleep_for(kLookEvery);
  }
  for (const TraceableProcess& process : missing)
    fmt::print(stderr, "takt trace: {} (process {}) has not joined the trace; restart it\n", process.program,
               process.pid);
}

Done start(const TraceOptions& options) {
  if (auto done = ensure_session_daemon(); !done) return done;
  if (const auto running = trace_directory())
    return std::unexpected(
        Refusal{kExitFailed, fmt::format("a trace already runs into {}; end it first: takt trace stop", *running)});
  const auto since_epoch = std::chrono::system_clock::now().time_since_epoch();
  const std::string directory = std::filesystem::absolute(
      options.output.empty() ? monitor::new_run_id("trace", since_epoch / std::chrono::nanoseconds(1))
                             : options.output);
  if (std::filesystem::exists(directory))
    return std::unexpected(
        Refusal{kExitUsage, fmt::format("--output {} exists already; name a new folder", directory)});
  std::vector<std::string> create{"create", kSession, "--output=" + directory};
  if (options.flight_recorder) create.emplace_back("--snapshot");
  if (auto done = lttng(std::move(create)); !done) return done;
  if (auto done = set_up(options); !done) {
    (void)lttng({"destroy", kSession});
    return done;
  }
  wait_until_registered();
  fmt::print("{} {}\n",
             options.flight_recorder ? "keeping the last seconds; takt trace snapshot writes them to" : "tracing into",
             directory);
  return {};
}

std::expected<std::string, Refusal> running_trace() {
  if (auto installed = lttng({"list"}); !installed && installed.error().exit_code == kExitUnavailable)
    return std::unexpected(installed.error());
  if (auto directory = trace_directory()) return *directory;
  return std::unexpected(Refusal{kExitUnavailable, "no trace runs: takt trace start"});
}

Done stop() {
  const auto directory = running_trace();
  if (!directory) return std::unexpected(directory.error());
  (void)lttng({"remove-trigger", kTrigger});  // there may be none
  if (auto done = lttng({"stop", kSession}); !done) return done;
  if (auto done = lttng({"destroy", kSession}); !done) return done;
  if (std::filesystem::exists(*directory))
    fmt::print("trace in {}\n", config::printable(*directory));
  else
    fmt::print("nothing was written\n");
  return {};
}

Done snapshot(const TraceOptions& options) {
  const auto into = trace_snapshot(options.output);
  if (!into) return std::unexpected(into.error());
  fmt::print("snapshot in {}\n", *into);
  return {};
}

int exit_code_of(const Done& done) {
  if (done) return kExitOk;
  fmt::print(stderr, "takt trace: {}\n", done.error().sentence);
  return done.error().exit_code;
}

}  // namespace

std::expected<std::string, Refusal> trace_snapshot(const std::string& output) {
  const auto directory = running_trace();
  if (!directory) return std::unexpected(directory.error());
  std::vector<std::string> record{"snapshot", "record", "--session", kSession};
  std::string into = output.empty() ? *directory : std::filesystem::absolute(output).string();
  if (!output.empty()) record.push_back("file://" + into);
  if (auto done = lttng(std::move(record)); !done)
    return std::unexpected(
        Refusal{done.error().exit_code, done.error().sentence + "; snapshots need takt trace start --flight-recorder"});
  return into;
}

void add_trace(CLI::App& app, int& exit_code) {
  CLI::App* command = app.add_subcommand("trace", "Record every Takt process of this machine with LTTng.");
  command->require_subcommand(1);
  command->footer(
      "Example: takt trace start --output /var/tmp/t1; takt trace stop; takt trace review /var/tmp/t1\n"
      "Exit codes: 0 done, 1 refused, 64 command line, 69 lttng-tools is missing or no trace runs. See "
      "docs/tracing.md.");
  auto options = std::make_shared<TraceOptions>();

  CLI::App* begin = command->add_subcommand("start", "Begin a trace; starts a session daemon when none runs.");
  begin->add_option("--output", options->output, "folder to make; default: a new one here");
  CLI::Option* const flight_recorder =
      begin->add_flag("--flight-recorder", options->flight_recorder,
                      "write nothing; keep the last seconds in memory for takt trace snapshot");
  begin
      ->add_flag("--snapshot-on-leaving-tracking", options->snapshot_on_leaving_tracking,
                 "write a snapshot each time a robot leaves tracking")
      ->needs(flight_recorder);
  begin->callback([options, &exit_code] { exit_code = exit_code_of(start(*options)); });

  CLI::App* now = command->add_subcommand("snapshot", "Write down what a flight recorder remembers.");
  now->add_option("--output", options->output, "folder to write into; default: the one given at the start");
  now->callback([options, &exit_code] { exit_code = exit_code_of(snapshot(*options)); });

  CLI::App* end = command->add_subcommand("stop", "End the trace and say where it lies.");
  end->callback([&exit_code] { exit_code = exit_code_of(stop()); });
}

}  // namespace takt::cli

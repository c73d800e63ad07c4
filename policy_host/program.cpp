// SPDX-License-Identifier: Apache-2.0
#include "policy_host/program.hpp"

#include <fmt/format.h>
#include <spdlog/spdlog.h>
#include <sys/resource.h>
#include <unistd.h>

#include <CLI/CLI.hpp>
#include <atomic>
#include <cerrno>
#include <cstdio>
#include <cstring>
#include <exception>
#include <filesystem>
#include <memory>
#include <string>
#include <string_view>
#include <utility>
#include <vector>

#include "config/load.hpp"
#include "config/trouble/kinds.hpp"
#include "executive/log/program_log.hpp"
#include "executive/program/program.hpp"
#include "policy_host/boundary.hpp"
#include "policy_host/fenced_load.hpp"
#include "policy_host/host.hpp"
#include "policy_host/host_faults.hpp"
#include "policy_host/policy_fit.hpp"

namespace takt::policy_host {
namespace {

constexpr std::string_view kFenced = "--fenced";

// An exception that leaves an engine, on whichever thread.
[[noreturn]] void end_for_exception() {
  try {
    if (const auto thrown = std::current_exception()) std::rethrow_exception(thrown);
    fmt::print(stderr, "takt-policy-host: ended itself\n");
  } catch (const std::exception& error) {
    fmt::print(stderr, "takt-policy-host: the engine failed: {}\n", error.what());
  } catch (...) {
    fmt::print(stderr, "takt-policy-host: the engine failed\n");
  }
  _exit(kExitInternal);
}

int refuse(const std::string& sentence) {
  return program::refuse(config::kExitBadConfiguration, sentence);
}

void be_nice(int level) {
  if (setpriority(PRIO_PROCESS, 0, level) != 0) {
    spdlog::warn("policy.nice {} was not granted: {}; the host runs at the default level", level, std::strerror(errno));
  }
}

std::string text_of(Fence fence, std::optional<int> cpu) {
  switch (fence) {
    case Fence::none:
      return "no processor is the executive's alone";
    case Fence::by_mask:
      return fmt::format(
          "kept off processor {} by its mask; this kernel takes no seccomp filter, so that a library "
          "could come back",
          *cpu);
    case Fence::by_kernel:
      return fmt::format("kept off processor {} by the kernel", *cpu);
  }
  return "";
}

struct Options : program::RobotOptions {
  std::vector<std::string> faults;
  std::uint64_t fault_seed = 1;
  bool fallback = false, fenced = false;
  std::string candidate;  // file; empty: not one

  [[nodiscard]] Role role() const {
    if (!candidate.empty()) return Role::candidate_policy;
    return fallback ? Role::fallback_policy : Role::policy;
  }
};

// A fence is one thread's and of what it starts, and libraries began threads before main(): so the program begins anew.
int begin_fenced(const config::RobotConfig& robot, char** argv) {
  if (const auto off = keep_off_processor(robot.control.cpu); !off) return refuse(off.error());
  for (const std::string& gap : fence_in({})) spdlog::warn("{}", gap);
  std::vector<char*> arguments;
  for (; *argv != nullptr; ++argv)
    if (std::string_view(*argv) != kFenced) arguments.push_back(*argv);
  arguments.push_back(nullptr);
  execv("/proc/self/exe", arguments.data());
  return refuse(fmt::format("takt-policy-host: cannot begin anew: {}", std::strerror(errno)));
}

int serve(const Options& options, std::vector<HostFaultWindow> faults, const LoadPolicy& load, char** argv) {
  auto robot = config::load(options.robot);
  if (!robot) return refuse(robot.error());
  if (options.fenced) return begin_fenced(*robot, argv);
  if (options.fallback) {
    const config::Fallback* const fallback = config::fallback_policy_of(*robot);
    if (fallback == nullptr)
      return refuse(options.robot + ": has no fallback policy; name one of kind `policy` in degraded.fallback");
    robot = config::seen_by_fallback(*robot, *fallback);
  }
  if (!options.candidate.empty() && robot->policy)
    robot->policy->file = std::filesystem::absolute(options.candidate).lexically_normal();
  if (const auto fine = check_policy_section(*robot); !fine) return refuse(fine.error());
  const config::Policy& section = *robot->policy;
  const auto hash = config::policy_hash(section.file);
  if (!hash) return refuse(hash.error());
  const auto loaded = load_fenced(*robot, section.requests_in_flight, load);
  if (!loaded) return refuse(loaded.error());
  std::vector<Policy*> engines;
  for (const auto& policy : loaded->policies) engines.push_back(policy.get());

  const std::string directory = program::runtime_directory_of(options, *robot);
  be_nice(section.nice);
  spdlog::info("policy {} ({:016x}) for robot {}: {} values in, {} steps of {} out", section.file, *hash, robot->robot,
               engines.front()->input_size(), section.steps, config::outputs_per_step(*robot));
  spdlog::info("engine: {}; {} threads of its own; {}", engines.front()->description(), loaded->threads,
               text_of(loaded->fence, robot->control.cpu));
  for (const std::string& fault : options.faults) spdlog::warn("does wrong on request: {}", fault);
  HostFaults wrong(std::move(faults), options.fault_seed);
  Host(*robot, directory, *hash, engines, std::move(wrong), options.role()).run(program::stop_on_signals());
  return 0;
}

}  // namespace

int run_policy_host(int argc, char** argv, const LoadPolicy& load) {
  CLI::App app{"Runs a robot's learned policy: waits for observations, infers, publishes action chunks."};
  Options options;
  program::add_robot(app, options, "robot file");
  program::add_runtime_directory(app, options);
  app.add_flag("--fallback", options.fallback,
               "be the robot's fallback policy (degraded.fallback), beside the host of its policy");
  app.add_flag(std::string(kFenced), options.fenced,
               "first give up files, signals to other processes and tracing, for a unit (docs/policies.md)");
  app.add_option("--candidate", options.candidate,
                 "be a candidate beside the robot's policy: another file for the same observation and action")
      ->excludes("--fallback");
  app.add_option("--fault", options.faults,
                 "do something wrong, for tests: 'FROM for LENGTH: FAULT', FROM counted from tracking, FAULT one of " +
                     trouble::forms(trouble::Place::policy_host) + " (docs/panels-real-time.md)")
      ->allow_extra_args(false);
  app.add_option("--fault-seed", options.fault_seed, "what its chances are drawn from");
  app.footer("Example: " + std::filesystem::path(argv[0]).filename().string() +
             " --robot config/arm6.yaml --runtime-dir /run/takt/arm6\n"
             "Exit codes: 0 ended by a signal, 64 usage, 65 configuration or policy refused, 70 the engine "
             "failed.");
  if (const auto ended = program::parse(app, argc, argv)) return *ended;
  auto faults = parse_host_faults(options.faults);
  if (!faults) return program::refuse(kExitUsage, faults.error());
  const Role role = options.role();
  log::log_to_stderr(role == Role::candidate_policy  ? "candidate-host"
                     : role == Role::fallback_policy ? "fallback-host"
                                                     : "policy-host");
  program::stop_on_signals();
  std::set_terminate(end_for_exception);
  return serve(options, std::move(*faults), load, argv);
}

}  // namespace takt::policy_host

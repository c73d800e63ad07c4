// SPDX-License-Identifier: Apache-2.0
#include "cli/run/contention.hpp"

#include <fmt/format.h>
#include <signal.h>

#include <algorithm>
#include <chrono>

namespace takt::cli {

std::expected<void, Refusal> Contention::apply(const Event& event) {
  switch (event.action) {
    case ActionKind::hog:
      return hog(event);
    case ActionKind::throttle:
      return throttle(event);
    case ActionKind::crowd:
      return crowd(event);
    case ActionKind::load:
      return load(event);
    case ActionKind::unload:
      return unload(event);
    case ActionKind::freeze:
    case ActionKind::thaw:
    case ActionKind::kill:
    case ActionKind::start:
    case ActionKind::arm:
    case ActionKind::stop:
    case ActionKind::reset:
    case ActionKind::fault:
      return {};
  }
  return {};
}

std::vector<int> Contention::control_cpus() const {
  if (robot_.control.cpu) return {*robot_.control.cpu};
  return usable_cpus();
}

std::expected<void, Refusal> Contention::occupy(const HogLoad& load) {
  if (auto started = hogs_.start(load); !started) return std::unexpected(Refusal{kExitSetUpRefused, started.error()});
  return {};
}

std::expected<void, Refusal> Contention::hog(const Event& event) {
  if (event.process == ProcessName::policy)
    return occupy({.cpus = usable_cpus(), .fifo_priority = 1, .length = event.length});
  return occupy({.cpus = control_cpus(), .fifo_priority = robot_.control.priority + 1, .length = event.length});
}

// Below the control thread, so that it takes nothing from it by itself; and an ordinary process beside it, for whose
// sake the kernel takes the core from both.
std::expected<void, Refusal> Contention::throttle(const Event& event) {
  for (const int priority : {1, 0})
    if (auto started = occupy({.cpus = control_cpus(), .fifo_priority = priority, .length = event.length}); !started)
      return started;
  return {};
}

std::expected<void, Refusal> Contention::crowd(const Event& event) {
  return occupy({.cpus = usable_cpus(),
                 .per_cpu = event.count,
                 .nice = robot_.policy ? robot_.policy->nice : 0,
                 .length = event.length});
}

std::expected<void, Refusal> Contention::load(const Event& event) {
  for (std::size_t i = 0; i < event.count; ++i) {
    auto started = ChildProcess::start({.name = event.command.front(),
                                        .arguments = event.command,
                                        .log_path = load_log_,
                                        .parent_death_signal = SIGKILL});
    if (!started) return std::unexpected(Refusal{kExitUnavailable, started.error()});
    loads_.push_back({event.command, std::move(*started)});
  }
  return {};
}

// The oldest ones of this command: another load may still have time.
std::expected<void, Refusal> Contention::unload(const Event& event) {
  for (std::size_t i = 0; i < event.count; ++i) {
    const auto load = std::ranges::find(loads_, event.command, &Load::command);
    if (load == loads_.end()) break;
    if (!load->process.alive())
      return std::unexpected(
          Refusal{kExitFailed, fmt::format("the load {} {} before its time\n{}", load->process.options().name,
                                           load->process.how_it_ended(), load->process.last_words())});
    load->process.end(std::chrono::seconds(1));
    loads_.erase(load);
  }
  return {};
}

}  // namespace takt::cli

// SPDX-License-Identifier: Apache-2.0
// What `takt run --at 'T: ACTION'` makes happen, T after tracking began. Actions: `freeze PROCESS DURATION` (SIGSTOP,
// then SIGCONT), `kill PROCESS` (SIGKILL), `start PROCESS` (one that died), `arm`, `stop`, `reset`; processes: policy,
// monitor, plant, executive. Contention for processors (cpu_hog.hpp): `hog control DURATION` occupies the control
// thread's core above its priority; `hog policy DURATION` every core below the control thread's priority and above the
// policy host's; `throttle control DURATION` uses up the real-time budget of the control thread's core from below it;
// `crowd policy N DURATION` puts N ordinary processes, as nice as the policy host, on every core;
// `load N DURATION COMMAND` runs a command of the user's N times at once, for a device that only it knows. And what the
// policy host does wrong by its option --fault, at the same clock.
#pragma once

#include <cstdint>
#include <expected>
#include <string>
#include <string_view>
#include <vector>

#include "executive/contract/mono_time.hpp"

namespace takt::cli {

enum class ActionKind : std::uint8_t {
  freeze,
  thaw,
  kill,
  start,
  hog,
  throttle,
  crowd,
  load,
  unload,
  arm,
  stop,
  reset,
  fault  // the policy host does it to itself, told so by its command line (policy_host/host_faults.hpp)
};
std::string_view name(ActionKind action);
// fallback: the host of the fallback policy.
enum class ProcessName : std::uint8_t { plant, executive, monitor, policy, fallback };
inline constexpr std::size_t kProcessCount = 5;
std::string_view name(ProcessName process);

struct Event {
  Duration at;
  ActionKind action = ActionKind::stop;
  ProcessName process = ProcessName::policy;  // freeze, thaw, kill, start; hog: executive or policy; throttle, crowd
  std::string text;                           // for messages: "freeze policy 300 ms"; fault: the value of --fault
  Duration length = {};                       // freeze, hog, throttle, crowd, load, fault
  std::size_t count = 0;                      // crowd: processes per core; load, unload
  std::vector<std::string> command = {};      // load, unload
};

// "300ms", "300 ms", "20 s". The error says how to write it.
std::expected<Duration, std::string> parse_duration(std::string_view text);
// In order of time; a freeze brings its thaw along. `policy_arguments`: of takt-policy-host, whose --fault are events.
std::expected<std::vector<Event>, std::string> parse_scenario(const std::vector<std::string>& lines,
                                                              const std::vector<std::string>& policy_arguments = {});
// The scenario file among further options of takt-plant; empty: none.
std::string plant_scenario_of(const std::vector<std::string>& plant_arguments);
// "--at '3 s: kill policy'", as its user would look for it on the command line.
std::string as_given(const Event& event);
// The end of an earlier one, which the run's end brings as well.
bool is_end(const Event& event);
// Whose instants all lie within a run of `duration`. The error says which does not.
std::expected<void, std::string> check_instants(const std::vector<Event>& events, Duration duration);

}  // namespace takt::cli

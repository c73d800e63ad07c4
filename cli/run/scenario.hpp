// SPDX-License-Identifier: Apache-2.0
// What `takt run --at 'T: ACTION'` makes happen, T after tracking began: lines of config/trouble/line.hpp, actions of
// config/trouble/kinds.hpp. And what the policy host does wrong by its option --fault, at the same clock.
#pragma once

#include <cstdint>
#include <expected>
#include <string>
#include <string_view>
#include <vector>

#include "config/trouble/kinds.hpp"
#include "executive/contract/mono_time.hpp"

namespace takt::cli {

using trouble::ActionKind;
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

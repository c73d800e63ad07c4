// SPDX-License-Identifier: Apache-2.0
// The way of a command through the processes: sense -> observation published -> inference -> command published -> read
// by a tick -> on the bus. Joined by observation id and command sequence. Pure.
#pragma once

#include <array>
#include <cstdint>
#include <optional>
#include <string_view>
#include <vector>

#include "lab/trace/timeline.hpp"

namespace takt::lab {

// One accepted command. An instant is unset where the trace has no event for it.
struct CommandChain {
  std::uint64_t sequence = 0, observation_id = 0;
  std::uint64_t tick = 0;     // that used it first
  std::int64_t host_pid = 0;  // 0: no policy host's events
  MonoTime sensed{};          // oldest sample it rests on, outside sensors included
  MonoTime observed{};        // the observation was published
  MonoTime inferred_from{}, inferred_to{};
  MonoTime published{};  // the command lay in the mailbox
  MonoTime consumed{};   // now of the tick that used it first
  MonoTime actuated{};   // the tick had handed its setpoints to the bus
  AgeParts told{};       // age in parts at first use, as the executive said it
  [[nodiscard]] bool is_whole() const {
    return sensed.is_set() && observed.is_set() && inferred_from.is_set() && inferred_to.is_set() &&
           published.is_set() && consumed.is_set();
  }
};

enum class Stage : std::uint8_t { sense, queue, infer, publish, consume, actuate, total };
inline constexpr std::array<std::string_view, 7> kStageNames{"sense",   "queue",   "infer", "publish",
                                                             "consume", "actuate", "total"};
// From which instant of a chain to which; nothing when one of them is unset.
std::optional<Duration> stage_of(const CommandChain& chain, Stage stage);

struct Chains {
  std::vector<CommandChain> accepted;  // in the order of ticks
  std::uint64_t refused = 0;           // messages the executive read and refused
  // Of the accepted ones, those for which the trace lacks an event:
  std::uint64_t without_observation = 0, without_inference = 0, without_publish = 0, without_tick = 0;
};
// Of the executive with this pid. Answers of policy hosts with another configuration are not considered.
Chains chains_of(const Timeline& timeline, std::int64_t executive_pid);

}  // namespace takt::lab

// SPDX-License-Identifier: Apache-2.0
#include "executive/runtime/journal.hpp"

#include <fmt/format.h>
#include <spdlog/spdlog.h>

#include <string>

#include "config/joint_units.hpp"
#include "executive/pipeline/joint_watch.hpp"

namespace takt::runtime {
namespace {

// "wrong_shape 25, corrupt 1": counts that grew, from index `first` on.
template <class Cause, std::size_t N>
std::string growth(const std::uint64_t (&now)[N], const std::uint64_t (&before)[N], std::size_t first) {
  std::string text;
  for (std::size_t i = first; i < N; ++i) {
    if (now[i] == before[i]) continue;
    if (!text.empty()) text += ", ";
    text += fmt::format("{} {}", name(static_cast<Cause>(i)), now[i] - before[i]);
  }
  return text;
}

}  // namespace

void Journal::transition(const TickRecord& record, const std::optional<incident::Incident>& incident) {
  const TickRecordHeader& tick = record.header;
  const bool expected = tick.cause == Cause::operator_arm || tick.cause == Cause::drives_enabled ||
                        tick.cause == Cause::operator_reset || tick.cause == Cause::contract_restored;
  spdlog::log(expected ? spdlog::level::info : spdlog::level::warn,
              "{} -> {}: {} (tick {}, age {:.1f} ms, misses {} of {}){}{}", name(tick.previous_mode), name(tick.mode),
              name(tick.cause), tick.tick, tick.age.total().milliseconds(), tick.window_misses, tick.window_ticks,
              tick.player == Player::fallback ? ": the fallback policy took over" : "",
              incident ? ": " + incident->sentence : std::string());
}

void Journal::policy_change(const TickRecord& record) {
  const TickRecordHeader& tick = record.header;
  const PolicyChange change = tick.candidate.change;
  const bool expected = change == PolicyChange::asked || change == PolicyChange::swapped ||
                        change == PolicyChange::back || change == PolicyChange::confirmed;
  spdlog::log(expected ? spdlog::level::info : spdlog::level::warn,
              "change of policy: {} (tick {}, {}, candidate {:016x}): {} is in charge", name(change), tick.tick,
              name(tick.mode), tick.candidate.policy_hash,
              tick.candidate.in_charge != 0 ? "the candidate" : "the robot's own policy");
}

void Journal::moved_unheard(const TickRecord& record, std::size_t index, const config::Joint& joint) {
  spdlog::warn(
      "joint {}: reads {:.4f} {} after a silence of its drive, more than {:g} {} from before: it was moved, or its "
      "drive lost its zero (tick {}, {})",
      joint.name, record.joints[index].feedback.q, config::kJointPosition.unit(joint.kind),
      static_cast<double>(pipeline::kMovedUnheard) * config::per_rad(joint), config::kJointPosition.unit(joint.kind),
      record.header.tick, name(record.header.mode));
}

void Journal::summarise(MonoTime now, const StatusSnapshot& status) {
  if (now - spoke_at_ < seconds(1)) return;
  if (const auto missed = growth<OverrunCause>(status.overruns, said_.overruns, 1); !missed.empty()) {
    spdlog::warn("missed periods: {} (skipped {} since start)", missed, status.tick.skipped_periods);
  }
  constexpr auto kFirstRefusal = static_cast<std::size_t>(Arrival::contended);
  if (const auto refused = growth<Arrival>(status.arrivals, said_.arrivals, kFirstRefusal); !refused.empty()) {
    spdlog::warn("commands refused: {}", refused);
  }
  spoke_at_ = now;
  said_ = status;
}

std::string status_line(const StatusSnapshot& status) {
  return fmt::format("{}, command {}, skipped periods {}", name(status.tick.mode),
                     name(status.tick.seats[Seat::policy].freshness), status.tick.skipped_periods);
}

}  // namespace takt::runtime

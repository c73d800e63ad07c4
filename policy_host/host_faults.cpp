// SPDX-License-Identifier: Apache-2.0
#include "policy_host/host_faults.hpp"

#include <fmt/format.h>

#include <algorithm>
#include <cmath>
#include <utility>

#include "config/printable.hpp"
#include "config/trouble/line.hpp"
#include "executive/contract/mode.hpp"
#include "policy_host/bad_actions.hpp"

namespace takt::policy_host {
namespace {

constexpr Duration kBurstEvery = seconds(1);

}  // namespace

std::expected<std::vector<HostFaultWindow>, std::string> parse_host_faults(std::span<const std::string> lines) {
  std::vector<HostFaultWindow> windows;
  for (const std::string& line : lines) {
    const auto given = trouble::parse_line(line, trouble::Place::policy_host);
    if (!given) return std::unexpected(fmt::format("--fault '{}': {}", config::printable(line), given.error()));
    windows.push_back({given->at, given->length, given->row->as<HostFault>(), given->dose});
  }
  return windows;
}

HostFaults::HostFaults(std::vector<HostFaultWindow> windows, std::uint64_t seed)
    : windows_(std::move(windows)), random_(seed) {}

void HostFaults::see(const Observation& observation) {
  if (!tracking_since_.is_set() && observation.mode == static_cast<std::uint8_t>(Mode::tracking))
    tracking_since_ = observation.published_at;
}

const HostFaultWindow* HostFaults::active(HostFault fault, MonoTime at) const {
  if (!tracking_since_.is_set()) return nullptr;
  const auto holds = [&](const HostFaultWindow& window) {
    const MonoTime begins = tracking_since_ + window.from;
    return window.fault == fault && at >= begins && at < begins + window.length;
  };
  const auto found = std::ranges::find_if(windows_, holds);
  return found == windows_.end() ? nullptr : &*found;
}

double HostFaults::dose(HostFault fault, MonoTime at) const {
  const HostFaultWindow* const window = active(fault, at);
  return window == nullptr ? 0 : window->dose;
}

Duration HostFaults::publish_delay(MonoTime at) const {
  return {std::llround(dose(HostFault::publish_delay, at))};
}

Duration HostFaults::take_callbacks(MonoTime at) {
  const HostFaultWindow* const window = active(HostFault::queue_growth, at);
  if (window == nullptr || (next_burst_.is_set() && at < next_burst_)) return {};
  next_burst_ = at + kBurstEvery;
  return {std::llround(static_cast<double>(kCallback.ns) * window->dose)};
}

void HostFaults::spoil(CommandChunk& chunk, MonoTime at) {
  const BadActions bad{.nan_share = dose(HostFault::bad_actions_nan, at),
                       .range_share = dose(HostFault::bad_actions_range, at),
                       .joint_shift = static_cast<std::size_t>(dose(HostFault::wrong_joint_order, at))};
  const std::size_t joint = random_() % chunk.header.joint_count;
  const std::size_t step = random_() % chunk.header.step_count;
  policy_host::spoil(chunk, bad, {joint, step, static_cast<double>(random_() >> 11U) * 0x1p-53});
}

}  // namespace takt::policy_host

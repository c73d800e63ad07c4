// SPDX-License-Identifier: Apache-2.0
#include "policy_host/host_faults.hpp"

#include <fmt/format.h>

#include <algorithm>
#include <array>
#include <cmath>
#include <optional>
#include <sstream>
#include <string_view>
#include <utility>

#include "config/units.hpp"
#include "executive/contract/mode.hpp"
#include "policy_host/bad_actions.hpp"

namespace takt::policy_host {
namespace {

constexpr Duration kBurstEvery = seconds(1);

struct Grammar {
  HostFault fault;
  std::string_view name;
  double least, most;
};
// In the order of HostFault. publish_delay is a time, bounded in ns.
constexpr std::array<Grammar, 5> kGrammar{{
    {HostFault::publish_delay, "publish_delay", 1, 1e10},
    {HostFault::queue_growth, "queue_growth", 1, kMostCallbacks},
    {HostFault::bad_actions_nan, "bad_actions_nan", 0, 1},
    {HostFault::bad_actions_range, "bad_actions_range", 0, 1},
    {HostFault::wrong_joint_order, "wrong_joint_order", 1, 63},
}};
constexpr std::string_view kHowTo =
    "write 'FROM for LENGTH: FAULT', such as '3 s for 2 s: publish_delay 100 ms'; FAULT one of `publish_delay TIME` "
    "(up "
    "to 10 s), `queue_growth CALLBACKS` (1 to 200), `bad_actions_nan SHARE`, `bad_actions_range SHARE`, "
    "`wrong_joint_order PLACES` (1 to 63)";

std::optional<Duration> read_time(std::istream& words) {
  std::string number, unit;
  words >> number >> unit;
  const auto time = config::parse_quantity(number + ' ' + unit, config::Dimension::time);
  if (!time || *time < 0) return std::nullopt;
  return Duration{std::llround(*time)};
}

std::optional<double> read_dose(std::istream& words, HostFault fault) {
  if (fault == HostFault::publish_delay) {
    const auto delay = read_time(words);
    return delay ? std::optional(static_cast<double>(delay->ns)) : std::nullopt;
  }
  std::string number;
  words >> number;
  const auto dose = config::parse_number(number);
  return dose ? std::optional(*dose) : std::nullopt;
}

std::optional<HostFaultWindow> parse(std::string line) {
  const std::size_t colon = line.find(':');
  if (colon == std::string::npos) return std::nullopt;
  line[colon] = ' ';
  std::istringstream words(line);
  std::string keyword, name, rest;
  const auto from = read_time(words);
  words >> keyword;
  const auto length = read_time(words);
  words >> name;
  const auto* const found = std::ranges::find(kGrammar, name, &Grammar::name);
  if (!from || !length || keyword != "for" || found == kGrammar.end()) return std::nullopt;
  const auto dose = read_dose(words, found->fault);
  if (!dose || *dose < found->least || *dose > found->most || words >> rest) return std::nullopt;
  return HostFaultWindow{*from, *length, found->fault, *dose};
}

}  // namespace

std::expected<std::vector<HostFaultWindow>, std::string> parse_host_faults(std::span<const std::string> lines) {
  std::vector<HostFaultWindow> windows;
  for (const std::string& line : lines) {
    const auto window = parse(line);
    if (!window) return std::unexpected(fmt::format("--fault '{}': {}", line, kHowTo));
    windows.push_back(*window);
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

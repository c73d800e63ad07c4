// SPDX-License-Identifier: Apache-2.0
#include "tests/exploration/stop_book.hpp"

#include <fmt/format.h>

#include <algorithm>

#include "config/stop_causes.hpp"
#include "executive/pipeline/mode_machine.hpp"

namespace takt::exploration {
namespace {

using config::StopHow;

bool is_active(const TickRecordHeader& header, Cause cause) {
  return (header.causes_active >> static_cast<unsigned>(cause) & 1U) != 0;
}

Cause worse(Cause a, Cause b) {
  return pipeline::reaction(a).severity >= pipeline::reaction(b).severity ? a : b;
}

}  // namespace

const config::StopConfig* StopBook::rule_of(Cause cause) const {
  const auto found = std::ranges::find(robot_.stops, name(cause), &config::StopConfig::name);
  return found == robot_.stops.end() ? nullptr : &*found;
}

StopHow StopBook::how_of(Cause cause) const {
  const config::StopConfig* const rule = rule_of(cause);
  return rule == nullptr ? StopHow::rest : rule->how;
}

// Whose way: a worse cause takes over with its own; but one by the fallback policy does not begin in a stop that goes
// on, and any other cause ends it.
void StopBook::follow(const TickRecordHeader& header) {
  const bool begins = header.previous_mode != Mode::damped_stop;
  if (begins) {
    cause_ = header.cause;
    since_ = rest_counts_from_ = header.now;
    moves_ = header.previous_mode == Mode::tracking || header.previous_mode == Mode::degraded;
  }
  Cause by_policy = Cause::none, other = Cause::none;
  for (const Cause cause : config::kStopCauses) {
    if (!is_active(header, cause)) continue;
    Cause& worst = how_of(cause) == StopHow::policy ? by_policy : other;
    worst = worse(worst, cause);
  }
  const Cause before = cause_;
  if (how_of(cause_) != StopHow::policy)
    cause_ = worse(cause_, other);
  else if (other != Cause::none)
    cause_ = other;
  else
    cause_ = worse(cause_, by_policy);
  const bool same_stop = how_of(before) == StopHow::policy && how_of(cause_) == StopHow::policy;
  if (cause_ != before && !same_stop) since_ = header.now;
  const config::StopConfig* const rule = rule_of(cause_);
  const bool ends = rule != nullptr && rule->how != StopHow::damping && rule->longest > Duration{};
  const bool is_over = ends && header.now - since_ >= rule->longest;
  way_ = is_over ? StopHow::rest : how_of(cause_);
  met_.insert({how_of(cause_), is_over});
  moves_ = moves_ && way_ == StopHow::policy && header.player == Player::fallback;
  if (way_ == StopHow::policy && !moves_) way_ = StopHow::rest;
}

void StopBook::judge(const TickRecordHeader& header) {
  const bool falls_back = header.player == Player::fallback;
  if (mode_ == Mode::damped_stop && header.previous_mode == Mode::damped_stop && player_ == Player::fallback &&
      header.cause == Cause::operator_reset)
    breaks("reset_waits: a reset took the power of a robot that the fallback policy moved");
  if (header.mode == Mode::damped_stop && header.player != Player::none && !falls_back)
    breaks(fmt::format("stop_by_policy: the {} moves a stopped robot", name(header.player)));
  if (header.mode == Mode::damped_stop && falls_back && way_ != StopHow::policy)
    breaks(fmt::format("stop_by_policy: the fallback policy moves a robot that {} stopped", name(cause_)));
  if (falls_back && header.seats[Seat::fallback].freshness != Freshness::fresh &&
      header.seats[Seat::fallback].freshness != Freshness::aging)
    breaks("stop_by_policy: the fallback policy moves the robot and has no usable command");
  const config::Fallback* const policy = config::fallback_policy_of(robot_);
  const Duration longest = policy != nullptr ? policy->longest : Duration{};
  if (falls_back && fallback_since_.is_set() && longest > Duration{} && header.now - fallback_since_ >= longest)
    breaks("stop_ends: the fallback policy moves the robot for longer than it may");
  const Duration degraded = robot_.degraded.longest;
  if (header.mode == Mode::degraded && degraded > Duration{} && degraded_since_.is_set() &&
      header.now - degraded_since_ >= degraded)
    breaks("degraded_ends: the robot is degraded for longer than it may be");
}

void StopBook::tick(const TickRecordHeader& header) {
  if (header.mode != Mode::degraded) degraded_since_ = {};
  if (header.player != Player::fallback) fallback_since_ = {};
  if (header.mode == Mode::damped_stop) {
    follow(header);
    if (player_ == Player::fallback && header.player != Player::fallback) rest_counts_from_ = header.now;
  } else {
    rest_counts_from_ = {};
  }
  judge(header);
  if (header.mode == Mode::degraded && !degraded_since_.is_set()) degraded_since_ = header.now;
  if (header.player == Player::fallback && !fallback_since_.is_set()) fallback_since_ = header.now;
  mode_ = header.mode;
  player_ = header.player;
}

}  // namespace takt::exploration

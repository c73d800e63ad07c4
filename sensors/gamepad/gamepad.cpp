// SPDX-License-Identifier: Apache-2.0
#include "sensors/gamepad/gamepad.hpp"

#include <algorithm>
#include <cmath>
#include <limits>
#include <utility>

namespace takt::sensors {
namespace {

constexpr double kDeadZone = 0.08;  // of the way from the middle

double deflection(const Stick& stick, std::int32_t position) {
  const double middle = (static_cast<double>(stick.minimum) + stick.maximum) / 2;
  const double way = (static_cast<double>(stick.maximum) - stick.minimum) / 2;
  const double at = (position - middle) / way;
  const double beyond = std::clamp((std::abs(at) - kDeadZone) / (1 - kDeadZone), 0.0, 1.0);
  return std::copysign(beyond, stick.reversed ? -at : at);
}

MonoTime time_of(const input_event& event) {
  return MonoTime{} + seconds(event.input_event_sec) + microseconds(event.input_event_usec);
}

}  // namespace

float float_within(double value, double low, double high) {
  const auto nearest = static_cast<float>(std::clamp(value, low, high));
  constexpr float kEndless = std::numeric_limits<float>::infinity();
  if (nearest > high) return std::nextafter(nearest, -kEndless);
  if (nearest < low) return std::nextafter(nearest, kEndless);
  return nearest;
}

Gamepad::Gamepad(GamepadMapping mapping) : mapping_(std::move(mapping)), deflections_(mapping_.sticks.size(), 0.0) {}

void Gamepad::move(std::uint16_t code, std::int32_t position) {
  for (std::size_t i = 0; i < mapping_.sticks.size(); ++i) {
    const Stick& stick = mapping_.sticks[i];
    if (stick.code != code) continue;
    const bool believable = position >= stick.minimum && position <= stick.maximum;
    if (!believable) held_ = false;
    deflections_[i] = believable ? deflection(stick, position) : 0;
  }
}

void Gamepad::take(const input_event& event, MonoTime now) {
  if (event.type == EV_SYN && event.code == SYN_DROPPED) {
    held_ = false;
    dropped_ = true;
    std::ranges::fill(deflections_, 0.0);
    return;
  }
  if (dropped_) {  // what stands before the next report is what is left of it
    dropped_ = !(event.type == EV_SYN && event.code == SYN_REPORT);
    return;
  }
  const bool is_lie = time_of(event) > now;
  if (event.type == EV_KEY && event.code == mapping_.dead_man)
    held_ = !is_lie && (event.value == 1 || (held_ && event.value != 0));
  if (is_lie) {
    held_ = false;
    return;
  }
  if (event.type == EV_ABS) move(event.code, event.value);
  heard_at_ = std::max(heard_at_, time_of(event));
}

std::optional<std::vector<float>> Gamepad::wish(MonoTime now) const {
  if (!held_ || now - heard_at_ > mapping_.still_for) return std::nullopt;
  const config::CommandLimits& limits = mapping_.limits;
  std::vector<float> values(deflections_.size());
  for (std::size_t i = 0; i < values.size(); ++i) {
    const double middle = limits.when_absent[i];
    const double end = deflections_[i] > 0 ? limits.maximum[i] : limits.minimum[i];
    values[i] = float_within(middle + std::abs(deflections_[i]) * (end - middle), limits.minimum[i], limits.maximum[i]);
  }
  return values;
}

}  // namespace takt::sensors

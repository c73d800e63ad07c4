// SPDX-License-Identifier: Apache-2.0
#include "simulation/scenario_player.hpp"

#include <fmt/format.h>

#include <algorithm>
#include <cmath>
#include <numbers>
#include <utility>

namespace takt::simulation {
namespace {

Duration time_of(const FaultEvent& event) {
  return {std::llround(event.dose)};
}

void add_to_line(const FaultEvent& event, LineFaults& line) {
  line.deaf |= event.kind == FaultKind::deaf;
  line.silent |= event.kind == FaultKind::silent;
  line.repeat |= event.kind == FaultKind::repeat;
  if (event.kind == FaultKind::delay) line.delay = std::max(line.delay, time_of(event));
  if (event.kind == FaultKind::drop) line.drop = std::max(line.drop, event.dose);
  FeedbackFaults& feedback = line.feedback;
  feedback.freeze |= event.kind == FaultKind::freeze;
  feedback.frozen_position |= event.kind == FaultKind::frozen_position;
  feedback.reversed |= event.kind == FaultKind::reversed;
  if (event.kind == FaultKind::wrap) feedback.offset += 2 * std::numbers::pi;
  if (event.kind == FaultKind::jump) feedback.offset += event.dose;
  if (event.kind == FaultKind::scale) feedback.scale *= event.dose;
}

void add_to_bus(const FaultEvent& event, BusFaults& bus) {
  if (event.kind == FaultKind::error_passive) bus.state = std::max(bus.state, BusState::error_passive);
  if (event.kind == FaultKind::bus_off) bus.state = std::max(bus.state, BusState::bus_off);
  if (event.kind == FaultKind::down) bus.state = BusState::down;
  bus.babble |= event.kind == FaultKind::babble;
  if (event.kind == FaultKind::drop) bus.drop = std::max(bus.drop, event.dose);
}

void add_to_sensor(const FaultEvent& event, MonoTime began, SensorFaults& sensor) {
  if (event.kind == FaultKind::drop) sensor.drop = std::max(sensor.drop, event.dose);
  if (event.kind == FaultKind::lies) sensor.lies = std::max(sensor.lies, event.dose);
  sensor.frozen |= event.kind == FaultKind::freeze;
  if (event.kind != FaultKind::burst || time_of(event) < sensor.burst) return;
  sensor.burst = time_of(event);
  sensor.burst_since = began;
}

void add_to_body(const FaultEvent& event, BodyTrouble& body) {
  if (event.kind == FaultKind::payload) {
    body.payload = event.dose;
    body.loaded = event.body;
  }
  if (event.kind == FaultKind::friction) body.friction *= event.dose;
  if (event.kind != FaultKind::push) return;
  body.towards = event.along;
  body.force = event.dose;
  body.pushed = event.body;
}

}  // namespace

ScenarioPlayer::ScenarioPlayer(Scenario scenario, const config::RobotConfig& robot, Log log)
    : buses_(robot.buses.size()), sensors_(robot.sensors.size()), log_(std::move(log)) {
  for (FaultEvent& event : scenario.events) events_.push_back({std::move(event), Phase::waiting, {}});
}

void ScenarioPlayer::say(MonoTime now, const FaultEvent& event, const std::string& what) const {
  log_(fmt::format("at {:.3f} s: {}: {}", (now - started_).seconds(), event.target_name, what));
}

void ScenarioPlayer::advance(Plant& plant) {
  if (!started_.is_set()) started_ = plant.now();
  watch_drives(plant);
  bool changed = false;
  for (Progress& progress : events_) changed |= move_on(progress, plant);
  if (changed) apply(plant);
  for (const Progress& progress : events_)
    if (progress.phase == Phase::active && progress.event.kind == FaultKind::power_cycle)
      plant.drive(progress.event.target).power_cycle(plant.now());
}

void ScenarioPlayer::watch_drives(Plant& plant) {
  enabled_at_.resize(plant.joint_count());
  for (std::size_t joint = 0; joint < enabled_at_.size(); ++joint)
    if (!enabled_at_[joint].is_set() && plant.drive(joint).state() == DeviceState::enabled)
      enabled_at_[joint] = plant.now();
}

MonoTime ScenarioPlayer::begin_of(const FaultEvent& event, const Plant& plant) const {
  if (!event.after_enabled) return started_ + event.at;
  if (event.strikes == Target::joint)
    return enabled_at_[event.target].is_set() ? enabled_at_[event.target] + event.at : MonoTime{};
  MonoTime last;
  for (std::size_t joint = 0; joint < enabled_at_.size(); ++joint) {
    if (event.strikes == Target::bus && plant.bus_of(joint) != event.target) continue;
    if (!enabled_at_[joint].is_set()) return {};
    last = std::max(last, enabled_at_[joint]);
  }
  return last.is_set() ? last + event.at : last;
}

bool ScenarioPlayer::move_on(Progress& progress, Plant& plant) {
  const FaultEvent& event = progress.event;
  switch (progress.phase) {
    case Phase::waiting: {
      const MonoTime due = begin_of(event, plant);
      if (!due.is_set() || plant.now() < due) return false;
      progress.began = plant.now();
      begin(progress, plant);
      return true;
    }
    case Phase::active:
      if (!event.lasts || plant.now() - progress.began < *event.lasts) return false;
      progress.phase = Phase::over;
      say(plant.now(), event, "end of " + text_of(event));
      return true;
    case Phase::over:
      return false;
  }
  return false;
}

void ScenarioPlayer::begin(Progress& progress, Plant& plant) {
  const FaultEvent& event = progress.event;
  say(plant.now(), event, text_of(event));
  progress.phase = Phase::active;
  if (event.kind == FaultKind::error) {
    plant.drive(event.target).inject(event.error);
    progress.phase = Phase::over;
  }
  if (event.kind == FaultKind::power_cycle && !event.lasts) {
    plant.drive(event.target).power_cycle(plant.now());
    progress.phase = Phase::over;
  }
}

void ScenarioPlayer::add(const Progress& progress, const Plant& plant, std::vector<LineFaults>& lines) {
  const FaultEvent& event = progress.event;
  switch (event.strikes) {
    case Target::joint:
      if (event.kind == FaultKind::foreign_commands)
        buses_[plant.bus_of(event.target)].rivals_of.push_back(event.target);
      else
        add_to_line(event, lines[event.target]);
      return;
    case Target::bus:
      return add_to_bus(event, buses_[event.target]);
    case Target::sensor:
      return add_to_sensor(event, progress.began, sensors_[event.target]);
    case Target::body:
      return add_to_body(event, body_);
  }
}

void ScenarioPlayer::apply(Plant& plant) {
  std::vector<LineFaults> lines(plant.joint_count());
  for (BusFaults& bus : buses_) bus = {};
  for (SensorFaults& sensor : sensors_) sensor = {};
  body_ = {};
  for (const Progress& progress : events_)
    if (progress.phase == Phase::active) add(progress, plant, lines);
  for (std::size_t joint = 0; joint < lines.size(); ++joint) plant.set_line(joint, lines[joint]);
}

}  // namespace takt::simulation

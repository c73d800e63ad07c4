// SPDX-License-Identifier: Apache-2.0
// Plays a scenario on a plant: turns each event's fault on and off when its time comes, and says so. Pure, virtual
// time. Faults that overlap add up: the longer delay, the larger loss, the worse bus state, the later push and payload
// hold.
// Thread rule: one thread at a time.
#pragma once

#include <functional>
#include <string>
#include <vector>

#include "simulation/bus_trouble.hpp"
#include "simulation/plant.hpp"
#include "simulation/scenario.hpp"
#include "simulation/sensor_path.hpp"
#include "simulation/troubled_mechanics.hpp"

namespace takt::simulation {

class ScenarioPlayer {
 public:
  using Log = std::function<void(const std::string& line)>;
  ScenarioPlayer(Scenario scenario, const config::RobotConfig& robot, Log log);

  // Call before every step of `plant`. Sets the drives' faults; what the others suffer is read with on_bus() and its
  // like.
  void advance(Plant& plant);
  [[nodiscard]] const BusFaults& on_bus(std::size_t bus) const { return buses_[bus]; }
  [[nodiscard]] const SensorFaults& on_sensor(std::size_t sensor) const { return sensors_[sensor]; }
  [[nodiscard]] const BodyTrouble& on_body() const { return body_; }

 private:
  enum class Phase : std::uint8_t { waiting, active, over };
  struct Progress {
    FaultEvent event;
    Phase phase = Phase::waiting;
    MonoTime began;
  };
  void watch_drives(Plant& plant);
  // When the event begins; unset: not known yet.
  [[nodiscard]] MonoTime begin_of(const FaultEvent& event, const Plant& plant) const;
  bool move_on(Progress& progress, Plant& plant);  // true: something began or ended
  void begin(Progress& progress, Plant& plant);
  void apply(Plant& plant);
  void add(const Progress& progress, const Plant& plant, std::vector<LineFaults>& lines);
  void say(MonoTime now, const FaultEvent& event, const std::string& what) const;

  std::vector<Progress> events_;
  std::vector<BusFaults> buses_;
  std::vector<SensorFaults> sensors_;
  BodyTrouble body_;
  Log log_;
  MonoTime started_;
  std::vector<MonoTime> enabled_at_;  // per joint, unset before
};

}  // namespace takt::simulation

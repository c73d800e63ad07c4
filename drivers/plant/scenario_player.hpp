// Plays a scenario on a plant: turns each event's fault on and off when its time comes, and says so. Pure, virtual
// time. Faults that overlap add up: the longer delay, the larger loss, the worse bus state holds.
// Thread rule: one thread at a time.
#pragma once

#include <functional>
#include <string>
#include <vector>

#include "drivers/plant/bus_trouble.hpp"
#include "drivers/plant/plant.hpp"
#include "drivers/plant/scenario.hpp"

namespace takt::plant {

class ScenarioPlayer {
 public:
  using Log = std::function<void(const std::string& line)>;
  ScenarioPlayer(Scenario scenario, std::size_t bus_count, Log log);

  // Call before every step of `plant`. Sets the drives' faults; what buses suffer is read with on_bus().
  void advance(Plant& plant);
  [[nodiscard]] const BusFaults& on_bus(std::size_t bus) const { return buses_[bus]; }

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
  void say(MonoTime now, const FaultEvent& event, const std::string& what) const;

  std::vector<Progress> events_;
  std::vector<BusFaults> buses_;
  Log log_;
  MonoTime started_;
  std::vector<MonoTime> enabled_at_;  // per joint, unset before
};

}  // namespace takt::plant

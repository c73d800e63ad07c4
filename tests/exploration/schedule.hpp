// What goes wrong in one exploration, and when: drawn from a seed, so that a seed says it all. A schedule is a list
// that can be shortened: each event stands for itself.
#pragma once

#include <cstdint>
#include <string>
#include <vector>

#include "executive/contract/mono_time.hpp"

namespace takt::exploration {

enum class Happening : std::uint8_t {
  stall_in_clock,    // the port does not return for `length`
  stall_in_send,     //
  stall_in_receive,  //
  late_wake_ups,     // every wake-up of the stretch comes `length / 8` late, at most 3 ms
  policy_silent,     // for `length`
  policy_slow,       // answers take `length / 4` more, at most 200 ms
  policy_nonsense,   // what it says is not finite
  drive_silent,      // obeys, is not heard
  drive_deaf,        // hears nothing
  drive_repeats,     // everything it says arrives twice
  drive_late,        // everything it says arrives 8 ms later
  drive_error,       // finds an error; stays until cleared
  drive_restarts,    // supply off for `length`
  bus_off,           //
  frames_lost,       // a third of what crosses the bus
  shove,             // the joint is given 2 rad/s more
  operator_stop,     //
  operator_deenergise,
  recorder_ends,  // for `length`, nothing is written
};
inline constexpr unsigned kHappenings = 19;

struct Event {
  Happening what = Happening::operator_stop;
  Duration at;            // after the start
  Duration length;        // of what lasts
  std::size_t joint = 0;  // or bus, as far as it has one
  [[nodiscard]] Duration end() const { return at + length; }
};

// Between the second and the last second of `lasting`; between 1 and 8 events.
std::vector<Event> draw(std::uint64_t seed, std::size_t joints, std::size_t buses, Duration lasting);
std::string text(const Event& event);

}  // namespace takt::exploration

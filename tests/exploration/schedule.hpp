// SPDX-License-Identifier: Apache-2.0
// What goes wrong in one exploration, and when: drawn from a seed, so that a seed says it all. A schedule is a list
// that can be shortened: each event stands for itself.
#pragma once

#include <cstdint>
#include <string>
#include <vector>

#include "executive/contract/mono_time.hpp"

namespace takt::exploration {

// What lasts, lasts for the event's `length`.
enum class Happening : std::uint8_t {
  stall_in_clock,     // the port does not return for `length`
  stall_in_send,      //
  stall_in_receive,   //
  late_wake_ups,      // every wake-up of the stretch comes `length / 8` late, at most 3 ms
  policy_silent,      //
  policy_slow,        // answers take `length / 4` more, at most 200 ms
  policy_nonsense,    // what it says is not finite
  drive_silent,       // obeys, is not heard
  drive_deaf,         // hears nothing
  drive_repeats,      // everything it says arrives twice
  drive_late,         // what it says arrives in bunches, every 12 ms
  drive_error,        // finds an error; stays until cleared
  drive_restarts,     // without power
  drive_taken_away,   // a stranger disables it, again and again
  drive_hot,          // a Damiao drive says that its winding has 130 degrees
  shove,              // the joint is given 2 rad/s more
  hurl,               // the joint is given 40 rad/s more
  bus_off,            //
  bus_down,           // the interface is gone
  bus_error_passive,  // the controller warns
  bus_refuses,        // every other of our frames is not taken
  bus_overflows,      // a frame is lost on our side in every millisecond
  bus_babbles,        // a drive's heartbeat comes twenty times a tick, where one has a heartbeat
  bus_has_stranger,   // malformed frames on a drive's id
  frames_undated,     // what arrives has no time of receipt
  frames_lost,        // a third of what crosses the bus
  recorder_ends,      // nothing is written
  operator_stop,
  operator_deenergise,
  computer_sleeps,          // between two ticks
  computer_sleeps_in_tick,  // where a bus is read or written
  shutdown,                 // for good
  torque_output_fails,      // is not set, and says so; torque stays as it was
  imu_silent,               // publishes nothing
  imu_lies,                 // says what is no unit quaternion
  base_leans,               // 1.5 rad
  fallback_silent,          // the fallback policy, where the robot has one
  imu_frozen,               // says old values under fresh stamps
  imu_late,                 // what it says is 30 ms old
  // Of a joint, and drawn by draw_motion:
  no_stiffness,      // policies ask for kp 0
  little_stiffness,  // a tenth of the default
  no_damping,        // policies ask for kd 0
  little_damping,    //
  asks_far,          // policies ask for a position 0.8 rad further
  hand_holds,        // a hand holds the joint where it is, then lets go
  hand_pulls,        // a hand pulls with a third of the joint's torque
  says_frozen,       // its feedback lies under fresh stamps: the reading stays, of every other event the position only
  says_jump,         // position 0.3 rad further
  says_wrap,         // position a turn less
  says_sign,         // position the other way, of every other event the velocity, too
  says_scale,        // half as much motion again, likewise
  says_repeated,     // every other reading is the one before
  says_future,       // stamped `length` ahead, at most 1 s
  // Of the candidate, which runs where one of them is drawn:
  candidate_swap,      // a person asks for it
  candidate_back,      //
  candidate_silent,    // lasts
  candidate_nonsense,  // lasts: what it says is not finite
};
inline constexpr unsigned kHappenings = 57;
static_assert(kHappenings <= 64);  // World keeps sets of them

// What Event::index counts; of what is neither, nothing.
constexpr bool is_of_joint(Happening what) {
  return (what >= Happening::drive_silent && what <= Happening::hurl) ||
         (what >= Happening::no_stiffness && what <= Happening::says_future);
}
constexpr bool is_lie(Happening what) {
  return what >= Happening::says_frozen && what <= Happening::says_future;
}
constexpr bool is_of_candidate(Happening what) {
  return what >= Happening::candidate_swap && what <= Happening::candidate_nonsense;
}
constexpr bool is_of_bus(Happening what) {
  return what >= Happening::bus_off && what <= Happening::frames_lost;
}

struct Event {
  Happening what = Happening::operator_stop;
  Duration at;            // after the start
  Duration length;        // of what lasts
  std::size_t index = 0;  // of the joint or bus
  [[nodiscard]] Duration end() const { return at + length; }
};

// A lie by which a drive's words contradict each other, or what was asked of it; found within kFoundWithin. Of a sign
// and a scale every other one is of the velocity, too: then drive and tick agree about a motion that is another one.
inline constexpr Duration kFoundWithin = milliseconds(500);
constexpr bool shows(const Event& lie) {
  const bool is_even = lie.length.ns / milliseconds(1).ns % 2 == 0;
  if (lie.what == Happening::says_repeated) return false;  // of every other reading a little late
  return (lie.what != Happening::says_sign && lie.what != Happening::says_scale) || is_even;
}

// Between the second and the last second of `lasting`; between 1 and 8 events.
std::vector<Event> draw(std::uint64_t seed, std::size_t joints, std::size_t buses, Duration lasting);
// The same, and in front of it what makes a stop dangerous: gains that a policy leaves out for most of the time,
// targets that are far, hands; `lies`: in feedback, too; `candidate`: a candidate that is swapped in, dies, is taken
// back.
struct Motions {
  bool lies = false, candidate = false;
};
std::vector<Event> draw_motion(std::uint64_t seed, std::size_t joints, std::size_t buses, Duration lasting,
                               Motions with);
std::string text(const Event& event);

}  // namespace takt::exploration

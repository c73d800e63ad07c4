// SPDX-License-Identifier: Apache-2.0
// Everything that Takt does wrong on purpose, in one table: its name, where it is written and so who carries it out,
// what it strikes, its dose with the unit, how long it lasts, and what a panel's kind is made of where processes are
// real. Pages that list kinds are held to it by tests/config/trouble/kinds_test.cpp.
#pragma once

#include <cstdint>
#include <span>
#include <string>
#include <string_view>

#include "config/fields.hpp"
#include "config/units.hpp"
#include "executive/contract/mono_time.hpp"

namespace takt::trouble {

inline constexpr Duration kLongestTime = seconds(1'000'000'000);  // that a line can say; the sum of two fits a Duration

enum class Place : std::uint8_t {
  run,          // `takt run --at`: its supervisor
  policy_host,  // takt-policy-host --fault: the host itself
  plant,        // a scenario (docs/plant-scenarios.md): the simulator
  panel         // a panel (docs/panels.md): the rollout in virtual time; with real processes the three above
};

// A place's kinds, in the order of its rows. What switches over them carries them out.
enum class ActionKind : std::uint8_t {
  freeze,
  kill,
  start,
  hog,
  throttle,
  crowd,
  load,
  arm,
  stop,
  reset,
  thaw,    // without a row: the end of freeze
  unload,  // likewise, of load
  fault    // likewise: the policy host does it to itself
};
enum class HostFault : std::uint8_t {
  publish_delay,
  queue_growth,
  bad_actions_nan,
  bad_actions_range,
  wrong_joint_order
};
enum class FaultKind : std::uint8_t {
  error,
  power_cycle,
  silent,
  deaf,
  repeat,
  delay,
  drop,
  foreign_commands,
  error_passive,
  bus_off,
  down,
  babble,
  frozen_position,
  reversed,
  wrap,
  jump,
  scale,
  freeze,
  burst,
  lies,
  push,
  payload,
  friction
};
enum class Trouble : std::uint8_t {
  none,
  sensor_burst,
  sensor_dropout,
  camera_freeze,
  sensor_lies,
  estimator_delay,
  inference_stall,
  inference_mean_shift,
  gpu_contention,
  queue_growth,
  publish_delay,
  policy_crash,
  policy_freeze,
  bad_actions_nan,
  bad_actions_range,
  wrong_joint_order,
  scheduler_preemption,
  cpu_hog,
  rt_throttling,
  can_loss,
  can_delay,
  bus_off,
  feedback_frozen,
  feedback_repeated,
  feedback_reversed,
  feedback_jump,
  feedback_scale,
  push,
  payload,
  friction,
  operator_stop,
};
inline constexpr std::size_t kTroubleCount = 31;

struct Dose {
  std::string_view unit = {};  // "ms", "rad", "N", "kg", or what a plain number counts, such as "share"; empty: no dose
  double least = 0, most = 0;  // in `unit`
  double moderate = 0;         // panels: if none is written
  bool more_than_least = false, whole = false;

  [[nodiscard]] config::Dimension dimension() const;  // of `unit`
  [[nodiscard]] double in_base() const;               // one `unit` in base units (config/units.hpp)
  [[nodiscard]] config::Range range() const;          // in base units
};

// How a dose and a window become instants and lengths of the mechanism.
enum class When : std::uint8_t {
  window,
  once,
  for_dose,                // instead of the window
  each_second,             // of the window, for the dose
  each_second_within,      // likewise, and no longer than the window
  push_each_second,        // likewise, for kPushLength
  each_tenth_of_a_second,  // from an instant drawn once, for the dose
  at_random                // kPreemptionsPerSecond, for the dose
};
enum class Whom : std::uint8_t { nothing, each_joint, one_joint, each_bus, first_bus, each_sensor, body };

// What a panel's kind is with real processes.
struct Real {
  Place by = Place::panel;     // panel: nothing does it, and `as` says why
  std::string_view as = {};    // there: kind, and what it strikes
  std::string_view then = {};  // after the dose
  When when = When::window;
  Whom whom = Whom::nothing;  // plant
};

// What a kind strikes: in a line one of the words, in a scenario one of the keys.
struct Targets {
  std::string_view told = {};  // in help
  std::span<const std::string_view> words = {};
};

struct Row {
  Place place = Place::run;
  std::uint8_t kind = 0;  // of the place's enumeration
  std::string_view name;
  Targets strikes = {};
  Dose dose = {};
  Duration longest = {};  // zero: it has no length
  std::string_view effect = {};
  bool takes_command = false;  // a line's last words
  Real real = {};

  template <class Kind>
  [[nodiscard]] Kind as() const {
    return static_cast<Kind>(kind);
  }
};

std::span<const Row> rows(Place place);
// Null: the place has no such kind.
const Row* find(Place place, std::string_view name);
inline const Row& row_of(ActionKind kind) {
  return rows(Place::run)[static_cast<std::size_t>(kind)];
}
inline const Row& row_of(HostFault kind) {
  return rows(Place::policy_host)[static_cast<std::size_t>(kind)];
}
inline const Row& row_of(FaultKind kind) {
  return rows(Place::plant)[static_cast<std::size_t>(kind)];
}
inline const Row& row_of(Trouble kind) {
  return rows(Place::panel)[static_cast<std::size_t>(kind)];
}

// "hog control|policy DURATION": how it is written in a line; of all kinds of the place, with semicolons.
std::string form(const Row& row);
std::string forms(Place place);
// What an unknown name is answered with: the place's kinds, and where it is one.
std::string known_kinds(Place place, std::string_view name);

}  // namespace takt::trouble

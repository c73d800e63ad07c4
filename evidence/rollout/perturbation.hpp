// SPDX-License-Identifier: Apache-2.0
// What a rollout may be troubled by: the kinds of a panel in config/trouble/kinds.hpp. A perturbation acts inside one
// window of virtual time; what it draws comes from the rollout's seed. docs/panels.md shows the kinds.
#pragma once

#include <array>
#include <cstdint>
#include <span>
#include <string>
#include <string_view>
#include <vector>

#include "config/trouble/kinds.hpp"
#include "executive/contract/mono_time.hpp"

namespace takt::evidence {

using trouble::Trouble;

inline std::span<const trouble::Row> perturbation_kinds() {
  return trouble::rows(trouble::Place::panel);
}
// Null: no such name.
inline const trouble::Row* find_perturbation(std::string_view name) {
  return trouble::find(trouble::Place::panel, name);
}

struct Perturbation {
  Trouble trouble = Trouble::none;
  double dose = 0;
  Duration from, length;  // window, since the rollout's start
  std::string load = {};  // gpu_contention with real processes: the command that keeps the GPU busy; empty: none named
  std::string body = {};  // push, payload: of the robot's MJCF; empty: the tool, or the root
  std::vector<Perturbation> with = {};  // act besides, each in a window of its own; every trouble at most once
};
// Times at which some perturbations repeat, from the start of the window on.
inline constexpr Duration kRepeat = seconds(1);
inline constexpr Duration kHogEvery = milliseconds(100);  // cpu_hog
inline constexpr double kPreemptionsPerSecond = 10;       // scheduler_preemption

// The perturbation of one rollout at its own instants, with what acts besides. Outside a trouble's window, and for
// every other trouble, the dose is 0.
class Disturbance {
 public:
  Disturbance(const Perturbation& perturbation, MonoTime rollout_started);

  [[nodiscard]] bool has(Trouble trouble) const { return strike(trouble).is_there; }
  [[nodiscard]] double dose(Trouble trouble, MonoTime at) const {
    const Strike& one = strike(trouble);
    return at >= one.begins && at < one.ends ? one.dose : 0;
  }
  [[nodiscard]] const std::string& body(Trouble trouble) const { return strike(trouble).body; }
  // The same as milliseconds.
  [[nodiscard]] Duration delay(Trouble trouble, MonoTime at) const;
  // Doses that say "this long out of every second": true for the first `dose` ms of each kRepeat.
  [[nodiscard]] bool in_first_part(Trouble trouble, MonoTime at) const;
  // Which kRepeat of the window `at` lies in, from 1; 0 outside.
  [[nodiscard]] std::int64_t turn(Trouble trouble, MonoTime at) const;
  // Of a trouble that it has not: unset.
  [[nodiscard]] MonoTime begins(Trouble trouble) const { return strike(trouble).begins; }
  // Crash, freeze and bus-off last as long as their dose says, the others as long as their window.
  [[nodiscard]] MonoTime ends(Trouble trouble) const { return strike(trouble).ends; }
  // Of the first and of the last of all.
  [[nodiscard]] MonoTime begins() const { return begins_; }
  [[nodiscard]] MonoTime ends() const { return ends_; }

 private:
  struct Strike {
    bool is_there = false;
    double dose = 0;
    MonoTime begins, ends;
    std::string body;
  };
  [[nodiscard]] const Strike& strike(Trouble trouble) const { return strikes_[static_cast<std::size_t>(trouble)]; }
  void add(const Perturbation& perturbation, MonoTime rollout_started);

  std::array<Strike, trouble::kTroubleCount> strikes_;
  MonoTime begins_, ends_;
};

}  // namespace takt::evidence

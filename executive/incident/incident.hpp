// SPDX-License-Identifier: Apache-2.0
// Why did it stop? Every stop and every fault becomes one incident, made here and nowhere else, from tick records;
// every surface (status, run, top, report, page, diagnostics, Prometheus, OpenTelemetry, post-mortem) tells its
// sentence.
//
// An incident is the entry into damped_stop or fault_latched; a damped stop that a fault catches up with is two. Its
// chain leads from the first sign that was still there, or gone for less than kSignLasts, to the stop itself. Signs are
// looked for since the robot was last armed: a tick whose drives, buses, replies or command deviate, or in which a
// cause holds. What came first need not be what did it; it is where to begin to look.
#pragma once

#include <cstdint>
#include <optional>
#include <string>
#include <utility>
#include <vector>

#include "config/robot_config.hpp"
#include "executive/contract/tick_record.hpp"

namespace takt::incident {

struct IncidentLink {
  std::uint64_t tick = 0;
  MonoTime at;
  std::string what;  // "joint elbow: silent"
};

struct Incident {
  std::uint64_t tick = 0;  // that entered `to`
  MonoTime at;
  Mode from = Mode::standby, to = Mode::standby;
  Cause cause = Cause::none;
  bool asked = false;            // the operator wanted it: no fault, no page is sent
  std::string where{};           // "joint elbow", "bus can0"; several are joined by ", "; empty: the robot as a whole
  std::uint32_t error_code = 0;  // the drive's own, of the first joint named; 0 none
  std::string detail{};          // in the drive's own words: "joint elbow: over-temperature"
  std::vector<IncidentLink> chain{};  // oldest first; the last one is the stop itself
  std::string done{};                 // what the executive did
  std::string clears_when{};          // of the reaction table
  std::string sentence{};             // all of the above; no line end, never empty
  // What would have kept this rule from firing, found by replay where a recording is at hand (evidence/review); no line
  // end. Empty: no recording, or replay cannot say.
  std::string counterfactual{};
};

// A stop that a person asked for.
bool is_asked(Cause cause);

// Every change of mode that the reaction table knows: the mode entered, and why. So that counts are there before the
// first one happens.
std::vector<std::pair<Mode, Cause>> possible_transitions();

// Of a record in which the robot became degraded: "degraded at tick 1034: command_late: no usable command came for
// 10 ms (degraded.after); the newest is 157 ms old". No line end.
std::string degraded_sentence(const TickRecord& record, const config::RobotConfig& robot);

inline constexpr Duration kSignLasts = milliseconds(100);

// Follows a robot tick by tick. Allocates when something is wrong. Thread rule: one thread at a time, never the control
// thread.
class IncidentWatch {
 public:
  explicit IncidentWatch(const config::RobotConfig& robot);

  // The incident that this tick is; nothing: it is none. In order; gaps are allowed.
  std::optional<Incident> tick(const TickRecord& record);
  // The newest since this was made, over and done with or not.
  [[nodiscard]] const std::optional<Incident>& latest() const { return latest_; }
  // The robot still stands in the newest.
  [[nodiscard]] bool stands() const { return stands_; }

 private:
  struct Sign {
    std::uint64_t tick = 0;  // that began it; 0: never seen
    MonoTime since, last;
    std::uint32_t code = 0;  // of a drive's error, or a bus's state
  };
  struct Heard {
    MonoTime stamp, at;
    std::uint64_t tick = 0;
  };
  void forget();
  void look(const TickRecord& record);
  void look_at_time(const TickRecordHeader& header);
  void look_at_joint(const TickRecord& record, std::size_t joint);
  [[nodiscard]] std::vector<IncidentLink> chain(const TickRecordHeader& header) const;
  [[nodiscard]] std::string words(const TickRecord& record) const;
  [[nodiscard]] std::string just_clamped(const TickRecordHeader& header) const;
  [[nodiscard]] std::string bad_commands(const TickRecordHeader& header) const;
  [[nodiscard]] Incident made_of(const TickRecord& record) const;

  config::RobotConfig robot_;
  std::vector<Sign> causes_, errors_, silences_, clamped_, buses_;
  std::vector<Heard> heard_;
  Sign command_, fallback_, stall_;
  Duration longest_stall_;                  // of stall_
  Arrival refused_ = Arrival::none;         // the newest command that was not accepted
  OverrunCause late_ = OverrunCause::none;  // the newest period that was lost
  std::uint64_t late_tick_ = 0;             // that told so
  std::optional<Incident> latest_;
  bool stands_ = false;
};

}  // namespace takt::incident

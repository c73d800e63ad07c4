// SPDX-License-Identifier: Apache-2.0
// The numbers of a run, computed from its recorded ticks alone: metrics.json, the terminal report and the HTML report
// all show these.
//
// Ages and miss rates are over the ticks that relied on the policy (the mode before the tick was tracking or degraded).
// Per tick: age of the command in use at each such tick; a miss is a tick whose command was stale or missing.
// Per command: age at first use (sense + queue + infer + publish); a miss is a command that grew past max_age, or ran
// out of steps, while it was the one in use, so that a stall of the policy is one miss; commands refused because their
// observation had expired are misses as well. Times are nanoseconds.
#pragma once

#include <array>
#include <cstdint>
#include <expected>
#include <map>
#include <nlohmann/json.hpp>
#include <optional>
#include <span>
#include <string>
#include <string_view>
#include <vector>

#include "executive/incident/incident.hpp"
#include "monitor/judge/chunk_monitors.hpp"
#include "monitor/judge/freshness_statistics.hpp"
#include "monitor/judge/load_watch.hpp"
#include "monitor/judge/sensor_ages.hpp"
#include "monitor/record/recorded_run.hpp"

namespace takt::monitor {

inline constexpr std::size_t kAgePartCount = 6;
inline constexpr std::array<std::string_view, kAgePartCount> kAgePartNames{"sense",   "queue", "infer",
                                                                           "publish", "hold",  "total"};

// What became of a change of policy that was asked for, or that a candidate on probation brought about.
struct NotedPolicyChange {
  std::uint64_t tick = 0;
  MonoTime at;
  PolicyChange change = PolicyChange::none;
  bool candidate_in_charge = false;  // from that tick on
  std::uint64_t candidate = 0;       // hash
};

// The policy beside the one in charge, over the ticks of tracking in which there was one.
struct CandidateMetrics {
  std::uint64_t ticks = 0, fresh_ticks = 0;
  std::uint64_t ticks_beyond_range = 0, ticks_beyond_limits = 0;  // of some joint
  std::array<std::uint64_t, kArrivalCount> arrivals{};
  Quantiles age;
  Quantiles distance;  // nanoradians, of the targets of the farthest joint from those played
};

// An instant that an operator pointed at while the robot ran.
struct Mark {
  std::uint64_t tick = 0;
  MonoTime at;
  std::string text = {};  // what the operator said of it, printable; empty: nothing
};

// What the ticks do not say of a stop.
struct StopOrigin {
  std::string scripted;  // "--at '3 s: kill policy', 612 ms before"; empty: nothing scripted explains it (script.hpp)
  std::string ended;     // "takt-policy-host was killed by SIGKILL"; empty: no process was missing
  std::string said;      // "policy: its host left (..., pid 91), 640 ms before"; empty: the policy's host said nothing
  std::string told_by;   // file that tells of it, where the record does not reach it; empty: the ticks
};

// Which other process made the commands of a policy's host, as that host says.
struct CommandSource {
  MonoTime at;
  std::string role;                  // "policy", "fallback policy", "candidate policy"
  std::string what;                  // "policy server far (0110...)"; printable
  std::uint64_t first_sequence = 0;  // of its first command, in the session of that instant
  std::uint64_t superseded = 0;      // sources before it that followed too fast to be recorded
};

// Who asked for what of the robot, as the executive's kernel says.
struct NotedRequest {
  MonoTime at;
  std::string action;           // "arm"
  std::string program, answer;  // printable
  std::int64_t pid = 0, uid = 0;
  bool done = false;
};

struct RunMetrics {
  std::uint64_t ticks = 0, first_tick = 0, last_tick = 0;
  MonoTime start;  // of the first recorded tick
  Mode last_mode = Mode::standby;
  Duration span;                   // first to last recorded tick
  std::uint64_t relied_ticks = 0;  // that relied on the policy
  std::array<Quantiles, kAgePartCount> age_per_tick;
  std::array<Quantiles, kAgePartCount> age_per_command;  // hold is zero by definition
  std::vector<SensorAge> sensors;                        // outside ones, of what the policy was shown
  MissRate misses_per_tick, misses_per_command;
  Quantiles lateness, work;  // of every tick
  // By what the controllers say; of a bus that does not say, none.
  std::array<Quantiles, kMaxBuses> tick_to_wire;
  Quantiles age_on_wire;  // of every tick that played a command, on every bus
  std::array<std::uint64_t, kModeCount> ticks_in_mode{};
  std::array<std::uint64_t, kMoverCount> ticks_of_player{};  // whose chunk the robot followed
  std::map<std::uint64_t, std::uint64_t> ticks_of_policy;    // hash -> ticks in which the robot followed its chunk
  std::optional<CandidateMetrics> candidate;                 // none: no candidate ever ran
  std::vector<NotedPolicyChange> policy_changes;             // the first kListedPolicyChanges
  std::uint64_t policy_change_count = 0;
  std::uint64_t ticks_without_fallback = 0;  // that relied on a policy while the fallback policy was not fresh
  std::array<std::uint64_t, kArrivalCount> arrivals{};
  std::array<std::uint64_t, kOverrunCauseCount> overruns{};
  std::uint64_t skipped_periods = 0, integration_errors = 0;      // within the recorded part
  std::array<std::uint64_t, kInterventionCount> interventions{};  // joint-ticks
  std::vector<Transition> transitions;
  std::uint64_t transition_count = 0;         // transitions holds the first kListedTransitions
  std::vector<incident::Incident> incidents;  // the first kListedIncidents
  std::uint64_t incident_count = 0;
  std::map<std::uint64_t, StopOrigin> stop_origins;  // by the incident's tick
  std::vector<NotedRequest> requests;                // in time
  std::vector<CommandSource> command_sources;        // in time; empty: the policies' hosts made them all
  // Why nothing can be said of the whole run, in a sentence; empty: the record reaches from the first tick to the end.
  std::string record_gap;
  std::vector<PolicyCatch> catches;  // of the chunk monitors, the first kListedCatches
  std::uint64_t catch_count = 0;
  std::vector<LoadMismatch> load_mismatches;  // the first kListedLoads
  std::vector<Mark> marks;                    // the first kListedMarks
  std::uint64_t mark_count = 0;
  std::map<std::string, std::uint64_t> losses;  // "tick overwritten" -> entries
  std::uint64_t missing_ticks = 0;              // gaps in the tick numbers
  std::uint64_t stood_by_ticks = 0;             // left out of quiet standby (standby_thinner.hpp); no gap
  ScanReport scan;
};
inline constexpr std::size_t kListedTransitions = 1000;
inline constexpr std::size_t kListedMarks = 1000;
inline constexpr std::size_t kListedLoads = 1000;
inline constexpr std::size_t kListedPolicyChanges = 1000;
inline constexpr std::size_t kListedIncidents = 1000;

void note(RunMetrics& metrics, incident::Incident incident);
void note(RunMetrics& metrics, const ChunkMonitors& monitors);
void note(RunMetrics& metrics, std::span<const LoadMismatch> found);
// The gravest comes first: what was not requested, faults before stops; among equals the oldest.
std::vector<incident::Incident> by_gravity(std::vector<incident::Incident> incidents);

std::expected<RunMetrics, std::string> metrics_of(const RecordedRun& run);
nlohmann::ordered_json to_json(const RunMetrics& metrics, const RecordedRun& run);
nlohmann::ordered_json to_json(const Quantiles& quantiles);
nlohmann::ordered_json to_json(const MissRate& misses);
// Computes and writes metrics.json.
std::expected<RunMetrics, std::string> write_metrics(const RecordedRun& run);

std::string_view name(Verdict verdict);

}  // namespace takt::monitor

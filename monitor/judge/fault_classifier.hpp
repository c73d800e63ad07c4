// SPDX-License-Identifier: Apache-2.0
// Why was the deadline missed? Reads a run's ticks and gives every stretch of trouble one verdict with its evidence in
// a sentence: "inference_stall: tau_infer 212 ms against a median of 14 ms".
//
// A stretch begins with a tick that relied on the policy and missed (stale or missing command), refused a command, met
// wrong content, or lost a period, or that entered degraded, damped_stop or fault_latched by no person's wish. It ends
// when 100 ms passed without another one (a second, if samples were wrong); if no command came until then, with the
// next command or after one second. Its evidence also takes in max_age before it began, because what made a command
// late happened before it was late.
//
// A stretch may have several causes. It is read in segments, each up to the next command that is accepted or refused
// for its age, and the rules judge each segment that holds trouble. A lost period counts beside a late command or a
// refused one. A segment that no rule explains goes with the one before it. Causes with less than a fiftieth of the
// stretch's troubled ticks and without a stop are left out.
//
// A troubled tick lies between a segment's first trouble and its end; standing after a stop counts for the stop's
// cause.
//
// The rules, in order; the first that holds gives the verdict. "Stands out" means: more above its median over the run's
// untroubled commands than a fifth of max_age, and more than any other part.
//   0 the computer was suspended                                           platform_stall
//   1 feedback_lost, or a drive that missed its commands, while the loop itself stood still as 5
//     feedback_lost while replies of the oldest joint came and left it old  estimator_lag
//     a drive or bus cause; a bus not up                                    actuator_or_bus_fault
//   2 samples of the IMU or of an outside sensor were frozen or mirrored
//     (content_watch.hpp)                                                   sensor_backlog
//     a refused command, bad_commands, stamps backwards, targets out of range,
//     targets of other joints (content_watch.hpp)                           controller_integration_error
//   3 imu_lost                                                             sensor_backlog
//   4 tau_infer stands out                                                  inference_stall
//     tau_queue stands out                                                  middleware_queue_growth
//     tau_publish stands out: if the control thread itself woke late by half of it, as 5; else middleware_queue_growth
//     tau_sense stands out: if joint feedback was late by half of it        estimator_lag; else sensor_backlog
//   5 a period was lost: preempted or blocked                               scheduler_preemption
//     own_overrun                                                           controller_integration_error
//     page_fault, platform_stall, not known                                 platform_stall
//   6 no command came for more than max_age, or commands come from another
//     session of the policy than before                                    inference_stall
//   7 more than a tenth of the drives' replies did not come                 actuator_or_bus_fault
//   8 otherwise                                                             unknown
// Refused: for its content or order.
// What it cannot see: replies late on the wire but stamped when they came, and what content_watch.hpp names.
#pragma once

#include <array>
#include <cstdint>
#include <deque>
#include <expected>
#include <map>
#include <nlohmann/json.hpp>
#include <optional>
#include <span>
#include <string>
#include <string_view>
#include <vector>

#include "executive/contract/command_chunk.hpp"
#include "executive/contract/tick_record.hpp"
#include "monitor/judge/content_watch.hpp"
#include "monitor/record/recorded_run.hpp"

namespace takt::monitor {

enum class Fault : std::uint8_t {
  sensor_backlog,
  estimator_lag,
  inference_stall,
  middleware_queue_growth,
  scheduler_preemption,
  controller_integration_error,
  platform_stall,
  actuator_or_bus_fault,
  unknown,
};
inline constexpr std::size_t kFaultCount = 9;
inline constexpr std::array<std::string_view, kFaultCount> kFaultNames{
    "sensor_backlog",          "estimator_lag",         "inference_stall",
    "middleware_queue_growth", "scheduler_preemption",  "controller_integration_error",
    "platform_stall",          "actuator_or_bus_fault", "unknown"};
constexpr std::string_view name(Fault fault) {
  return kFaultNames[static_cast<std::size_t>(fault)];
}

// What a stretch of trouble came to. The graver, the larger.
enum class Gravity : std::uint8_t { late, missed, stopped };
inline constexpr std::array<std::string_view, 3> kGravityNames{"late", "missed", "stopped"};
constexpr std::string_view name(Gravity gravity) {
  return kGravityNames[static_cast<std::size_t>(gravity)];
}

struct FaultVerdict {
  Fault fault = Fault::unknown;
  std::uint64_t first_tick = 0, last_tick = 0;  // with trouble
  MonoTime at;
  std::string sentence;  // begins with the fault's name
  // late: nothing but late wake-ups; missed: commands missed or refused, or degraded; stopped: without a request.
  Gravity gravity = Gravity::missed;
  Duration lateness{};             // the latest wake-up
  std::uint64_t missed_ticks = 0;  // that relied on the policy and had no usable command
  std::uint64_t troubled_ticks = 0;
};
// The gravest comes first; among equals the oldest.
std::vector<FaultVerdict> by_gravity(std::vector<FaultVerdict> verdicts);

// What stretches with one verdict came to. Ordered by what hurts: a stop before any number of missed ticks.
struct FaultCost {
  std::uint64_t stops = 0, missed_ticks = 0, troubled_ticks = 0, stretches = 0;
  friend auto operator<=>(const FaultCost&, const FaultCost&) = default;
};

struct FaultSummary {
  std::array<std::uint64_t, kFaultCount> counts{};
  std::array<FaultCost, kFaultCount> costs{};
  std::vector<FaultVerdict> verdicts;  // the gravest kListedVerdicts, oldest first
  [[nodiscard]] std::uint64_t total() const;
  [[nodiscard]] double share(Fault fault) const;  // of all causes' troubled ticks; 0..1
};
inline constexpr std::size_t kListedVerdicts = 1000;
inline constexpr double kTellingShare = 0.02;  // a cause with less is not told apart from the others

struct FaultRules {
  Duration max_age;
  Duration period;
  std::vector<std::string> joints;  // names for sentences; may be empty
  WatchedContent content = {};
};
FaultRules fault_rules_of(const config::RobotConfig& robot);

// What one tick contributes to a verdict.
struct FaultClue {
  std::uint64_t tick = 0;
  MonoTime now;
  bool is_trouble = false, is_miss = false;
  Gravity gravity = Gravity::late;  // if it is trouble
  Duration lateness;
  std::uint64_t skipped = 0;   // periods since the tick before
  std::uint32_t slept_ms = 0;  // the computer, since the tick before
  OverrunCause overrun = OverrunCause::none;
  Arrival arrival = Arrival::none;
  std::uint64_t ran_backwards = 0;        // commands since the tick before
  std::optional<AgeParts> command_parts;  // of the command that arrived, hold zero
  Duration feedback_age;                  // of the oldest joint
  std::size_t feedback_joint = 0;
  std::uint64_t replies = 0, replies_due = 0;
  bool is_old = false, is_old_and_replied = false;  // the oldest joint
  bool bus_is_bad = false, target_clamped = false;
  WrongContent content;
  Cause cause = Cause::none;      // of a transition
  bool is_other_session = false;  // of the policy, than at the tick before
  MonoTime command_before;        // when the newest command before this tick came; unset: none did
};

// What a stretch of trouble, or a segment of it, holds, gathered from its clues.
struct FaultEvidence {
  std::uint64_t first_tick = 0, last_tick = 0;
  MonoTime at, last_trouble;  // unset: no trouble
  std::uint64_t troubled_ticks = 0;
  bool has_miss = false, command_came = false;
  Gravity gravity = Gravity::late;
  std::array<Duration, 4> worst_parts{};  // sense, queue, infer, publish: the largest of each
  Duration worst_lateness;
  OverrunCause overrun = OverrunCause::none;  // the first
  std::uint64_t overruns = 0, skipped = 0;
  std::uint32_t slept_ms = 0;                 // the longest sleep of the computer
  std::map<Arrival, std::uint64_t> refusals;  // for content or order
  std::uint64_t ran_backwards = 0;
  Duration feedback_age;
  std::size_t feedback_joint = 0;
  std::uint64_t replies = 0, replies_due = 0;
  std::uint64_t old_ticks = 0, old_replied_ticks = 0;  // with an old joint; of them, in which it replied
  WrongContent content;
  bool bus_was_bad = false;
  Cause fault_cause = Cause::none;  // drive or bus cause of a transition
  bool bad_commands = false, imu_lost = false, other_session = false;
  std::uint64_t missed_ticks = 0, clamped_ticks = 0;
  Duration silence;       // longest time without a command, until the stop
  Duration sense_before;  // tau_sense of the command before the segment
  void take(const FaultClue& clue);
  void take(const FaultEvidence& other);
};

// Samples whose values nothing can rely on: wrong targets are what comes of them.
constexpr bool met_wrong_sensing(const FaultEvidence& evidence) {
  return evidence.content.frozen_samples + evidence.content.mirrored_samples != 0;
}

struct FaultStretch {
  FaultEvidence whole;
  std::vector<FaultEvidence> segments{1};  // in order; neighbours are merged when there are kMostSegments
  bool has_ended_segment = false;          // by the tick before
  Duration sense;                          // tau_sense of the newest command
  void take(const FaultClue& clue);
};
inline constexpr std::size_t kMostSegments = 512;

struct FaultBaseline {
  std::array<Duration, 4> parts{};  // medians: sense, queue, infer, publish
  Duration feedback_age;            // median of the oldest joint's
};

// The rules, pure.
FaultVerdict judge(const FaultEvidence& evidence, const FaultBaseline& baseline, const FaultRules& rules);
// One verdict for each cause.
std::vector<FaultVerdict> judge(const FaultStretch& stretch, const FaultBaseline& baseline, const FaultRules& rules);

// Reads ticks in order, each command (optional, but without it commands refused for their age have no parts) before the
// tick that read it. Memory: two words per command and tick. Thread rule: one thread at a time.
class FaultClassifier {
 public:
  explicit FaultClassifier(FaultRules rules) : rules_(std::move(rules)), content_(rules_.content) {}
  void command(const CommandChunk& chunk);
  void command(const RecordedCommand& command);  // of another sender than the policy: ignored
  // What the policy was shown, near the tick in which it was: optional, as the commands.
  void sample(std::size_t sensor, std::uint64_t sequence, MonoTime sensed_at, std::span<const float> values) {
    content_.sample(sensor, sequence, sensed_at, values);
  }
  void image(std::size_t sensor, std::uint64_t sequence, MonoTime sensed_at, std::string_view content) {
    content_.image(sensor, sequence, sensed_at, content);
  }
  void input(const RecordedPolicyInput& recorded);  // its samples
  void image(const ShownImage& image) { content_.image(image.sensor, image.sequence, image.sensed_at, image.sha256); }
  void tick(const TickRecord& record);
  // Ends an open stretch and judges them all. Call once.
  FaultSummary finish();

 private:
  struct Published {
    MonoTime at, oldest_feedback;
  };
  FaultClue clue_of(const TickRecord& record);
  [[nodiscard]] std::optional<AgeParts> parts_of_arrival(const TickRecordHeader& header) const;
  void remember_observation(const TickRecord& record, MonoTime oldest_feedback);
  void follow(const FaultClue& clue);
  void open(const FaultClue& clue);
  void note_standstill(const TickRecordHeader& header);
  void note_baseline(const FaultClue& clue);
  [[nodiscard]] FaultBaseline baseline() const;

  FaultRules rules_;
  ContentWatch content_;
  std::optional<CommandHeader> command_;  // read by the tick to come
  std::map<std::uint64_t, Published> observations_;
  std::optional<TickRecordHeader> before_;
  std::vector<std::uint8_t> replies_before_;
  MonoTime last_command_;
  std::deque<FaultClue> recent_;  // the last max_age, while nothing is open
  std::optional<FaultStretch> open_;
  std::vector<FaultStretch> closed_;
  bool is_standing_ = false;  // after a stop by a fault
  std::array<std::vector<std::int64_t>, 4> calm_parts_, all_parts_;
  std::vector<std::int64_t> calm_feedback_;
};

// All of a recorded run.
std::expected<FaultSummary, std::string> classify_run(const RecordedRun& run);

// "inference_stall 3, platform_stall 1" and the gravest sentences; what cost nothing but late wake-ups is one line per
// fault. "none" without any.
std::string fault_text(const FaultSummary& summary, std::size_t most_sentences = 5);
nlohmann::ordered_json to_json(const FaultSummary& summary);

}  // namespace takt::monitor

// SPDX-License-Identifier: Apache-2.0
#include "evidence/review/counterfactual.hpp"

#include <fmt/format.h>
#include <fmt/ranges.h>

#include <algorithm>
#include <cmath>
#include <cstring>
#include <memory>
#include <numeric>
#include <optional>
#include <utility>

#include "config/load.hpp"
#include "config/units.hpp"
#include "evidence/review/recorded_input.hpp"
#include "executive/pipeline/control_tick.hpp"
#include "executive/pipeline/mode_machine.hpp"
#include "executive/setup/tick_config_of.hpp"

namespace takt::evidence {
namespace {

// How a key's values are counted: in nanoseconds, millionths, ones.
enum class Unit : std::uint8_t { time, share, count };
constexpr double kMillion = 1e6;

// A rule that a key's value governs. All of them fire later, or not at all, the larger the value.
struct Rule {
  Cause cause;
  std::string_view key;
  Unit unit;
  std::int64_t (*value)(const config::RobotConfig& robot);
};

template <Duration config::Freshness::*field>
std::int64_t freshness(const config::RobotConfig& robot) {
  return (robot.freshness.*field).ns;
}
template <Duration config::FeedbackConfig::*field>
std::int64_t feedback(const config::RobotConfig& robot) {
  return (robot.feedback.*field).ns;
}
std::int64_t millionths(double share) {
  return std::llround(share * kMillion);
}
template <double config::BusFaults::*field>
std::int64_t bus_fault(const config::RobotConfig& robot) {
  return millionths(robot.bus_faults.*field);
}

constexpr Rule kRules[] = {
    {Cause::command_lost, "freshness.max_age", Unit::time, freshness<&config::Freshness::max_age>},
    {Cause::command_lost, "freshness.stop_after", Unit::time, freshness<&config::Freshness::stop_after>},
    {Cause::bad_commands, "freshness.bad_command_limit", Unit::count,
     [](const config::RobotConfig& robot) { return std::int64_t{robot.freshness.bad_command_limit}; }},
    {Cause::enable_timeout, "feedback.enable_timeout", Unit::time, feedback<&config::FeedbackConfig::enable_timeout>},
    {Cause::feedback_lost, "feedback.timeout", Unit::time, feedback<&config::FeedbackConfig::timeout>},
    {Cause::overrun, "control.late_share", Unit::share,
     [](const config::RobotConfig& robot) { return millionths(robot.control.late_share); }},
    {Cause::replies_lost, "bus_faults.replies_lost", Unit::share, bus_fault<&config::BusFaults::replies_lost>},
    {Cause::replies_repeated, "bus_faults.replies_repeated", Unit::share,
     bus_fault<&config::BusFaults::replies_repeated>},
    {Cause::replies_delayed, "bus_faults.replies_delayed", Unit::share, bus_fault<&config::BusFaults::replies_delayed>},
    {Cause::transmit_queue_full, "bus_faults.transmit_drops", Unit::share,
     bus_fault<&config::BusFaults::transmit_drops>},
    {Cause::receive_overflow, "bus_faults.receive_drops", Unit::share, bus_fault<&config::BusFaults::receive_drops>},
    {Cause::foreign_node, "bus_faults.foreign_frames", Unit::share, bus_fault<&config::BusFaults::foreign_frames>},
    {Cause::bus_babble, "bus_faults.babble", Unit::share, bus_fault<&config::BusFaults::babble>},
    {Cause::bus_error_passive, "bus_faults.error_passive", Unit::share, bus_fault<&config::BusFaults::error_passive>},
};

bool has_rule(Cause cause) {
  return std::ranges::find(kRules, cause, &Rule::cause) != std::end(kRules);
}

// These causes hold while the robot relies on the policy, or arms; the others in every mode.
bool waits_for_command(Cause cause) {
  return cause == Cause::command_lost || cause == Cause::enable_timeout;
}

std::string text_of(std::int64_t value, Unit unit) {
  switch (unit) {
    case Unit::time:
      return config::format_duration({value});
    case Unit::share:
      return fmt::format("{:g}", static_cast<double>(value) / kMillion);
    case Unit::count:
      return std::to_string(value);
  }
  return {};
}

// The largest 1, 2 or 5 times a power of ten in a tenth of the value.
std::int64_t step_of(std::int64_t value) {
  std::int64_t step = 1;
  while (step * 10 <= value / 10) step *= 10;
  for (const std::int64_t factor : {5, 2})
    if (step * factor <= value / 10) return step * factor;
  return step;
}

struct RecordedMoment {
  monitor::Bytes record;  // its used part
  std::vector<monitor::RecordedCommand> commands;
};

// What was recorded around one incident.
class Slice {
 public:
  explicit Slice(incident::Incident& about) : incident(&about) {}

  void command(const monitor::RecordedCommand& command) { pending_.push_back(command); }
  void tick(const TickRecord& record) {
    const TickRecordHeader& header = record.header;
    const bool follows = header.tick == last_ + 1;
    last_ = header.tick;
    if (is_over_) return;
    if (header.tick == 1) is_whole_ = true;
    if (header.tick > incident->tick) {
      const bool someone_acted =
          header.operator_request != OperatorRequest::none && header.operator_request != OperatorRequest::mark;
      is_over_ = !follows || someone_acted || header.now - incident->at > kReplayedBehind;
    } else if (!follows && header.tick != 1) {
      is_whole_ = false;
    }
    if (is_over_ || !is_whole_) return;
    if (header.mode == Mode::arming && header.previous_mode != Mode::arming) armed_at = header.tick;
    if (moments.size() == kMostTicks) return give_up(header.tick);
    const auto bytes = std::as_bytes(std::span(&record, 1)).first(record.used_bytes());
    std::erase_if(pending_, [&](const monitor::RecordedCommand& command) { return command.tick != header.tick; });
    moments.push_back({{bytes.begin(), bytes.end()}, std::exchange(pending_, {})});
    behind = header.now - incident->at;
  }
  void keyframe(const monitor::RecordedKeyframe& keyframe, Duration period) {
    const auto before = static_cast<std::uint64_t>(kReplayedBefore.ns / period.ns);
    const bool is_early = keyframe.tick + before <= incident->tick;
    if (!is_early && (is_whole_ || keyframe.tick >= incident->tick)) return;
    moments.clear();
    state = keyframe.state;
    is_whole_ = true;
  }
  // It leads up to the incident without a gap.
  [[nodiscard]] bool is_whole() const { return is_whole_ && behind >= Duration{0} && !moments.empty(); }

  incident::Incident* incident;
  monitor::Bytes state;  // a keyframe; empty: the recording's first tick is tick 1
  std::vector<RecordedMoment> moments;
  std::uint64_t armed_at = 0;  // tick of the newest arming in it; 0: before it
  Duration behind{-1};         // recorded behind the incident, as far as it can be judged

 private:
  void give_up(std::uint64_t tick) {
    is_over_ = tick > incident->tick;
    is_whole_ = is_over_;
    if (!is_whole_) moments.clear();
  }
  std::vector<monitor::RecordedCommand> pending_;  // of one tick
  std::uint64_t last_ = 0;
  bool is_whole_ = false, is_over_ = false;
};

struct Outcome {
  bool kept = false;               // what the rule waits for came before it fired
  Cause stopped_by = Cause::none;  // then, by another rule or the same
  Duration later{};                // after the incident
};

class Laboratory {
 public:
  Laboratory(const monitor::RecordedRun& run, const Slice& slice)
      : slice_(slice), cause_(slice.incident->cause), recorded_(recorded_config(run)) {}

  // The recorded configuration's decisions come out bit for bit, the incident among them.
  bool reproduces() {
    bool met = false;
    const bool whole = decide(recorded_, [&](const TickRecord& was, const TickRecord& is) {
      met |= is.header.tick == slice_.incident->tick && is.header.cause == cause_;
      return std::memcmp(&was, &is, was.used_bytes()) == 0;
    });
    return whole && met;
  }

  Outcome with(const config::RobotConfig& robot) {
    Outcome outcome;
    const pipeline::TickConfig config =
        setup::tick_config_of(robot, recorded_.policy.hash, recorded_.fallback_policy.hash);
    decide(config, [&](const TickRecord& was, const TickRecord& is) {
      if (is.header.tick < slice_.armed_at) return true;
      if (!outcome.kept && fires(is.header)) return false;
      outcome.kept |= is.header.tick >= slice_.incident->tick && is_over(was.header, is.header);
      // Behind a fault the drives say that they are off, because we took their power.
      if (outcome.kept && slice_.incident->to == Mode::fault_latched) return false;
      if (!outcome.kept || !stops(is.header)) return true;
      outcome.stopped_by = is.header.cause;
      outcome.later = is.header.now - slice_.incident->at;
      return false;
    });
    return outcome;
  }

  // The policy said something, or the joint was heard, behind the stop.
  bool ends_in_recording() {
    bool ends = false;
    decide(recorded_, [&](const TickRecord& was, const TickRecord&) {
      const bool behind = was.header.tick > slice_.incident->tick;
      ends |= behind && (waits_for_command(cause_) ? was.header.seats[Seat::policy].mailbox != Arrival::none
                                                   : !holds(was.header));
      return true;
    });
    return ends;
  }

 private:
  static bool stops(const TickRecordHeader& header) {
    return header.mode != header.previous_mode && pipeline::is_latched(header.mode);
  }
  [[nodiscard]] bool holds(const TickRecordHeader& header) const {
    return (header.causes_active & pipeline::bit(cause_)) != 0;
  }
  // Before what it waits for is there. While a command is waited for, any other stop ends the waiting.
  [[nodiscard]] bool fires(const TickRecordHeader& header) const {
    return waits_for_command(cause_) ? stops(header) : holds(header);
  }
  [[nodiscard]] bool is_over(const TickRecordHeader& was, const TickRecordHeader& is) const {
    if (cause_ == Cause::enable_timeout) return is.mode == Mode::tracking || is.mode == Mode::degraded;
    const SeatRecord& policy = is.seats[Seat::policy];
    if (cause_ == Cause::command_lost) return policy.arrival == Arrival::accepted && is_usable(policy.freshness);
    return !holds(was);
  }

  // Calls `visit(recorded, decided)` tick by tick while it returns true; false: it did not, or a message that this
  // configuration accepts was not kept whole.
  template <class Visit>
  bool decide(const pipeline::TickConfig& config, const Visit& visit) {
    const pipeline::TickStatePtr state = pipeline::make_tick_state(recorded_);
    if (!slice_.state.empty() && !pipeline::load(*state, recorded_, slice_.state)) return false;
    pipeline::remember_more(*state, config);
    for (const RecordedMoment& moment : slice_.moments) {
      std::memcpy(static_cast<void*>(was_.get()), moment.record.data(), moment.record.size());
      for (const monitor::RecordedCommand& command : moment.commands) input_.command(command);
      const pipeline::TickInput* input = input_.of(*was_);
      if (input == nullptr) return false;
      pipeline::control_tick(*state, *input, config, *output_);
      const Arrival arrival = output_->record.header.seats[Seat::policy].arrival;
      if (input_.is_by_header() && arrival == Arrival::accepted) return false;
      if (!visit(std::as_const(*was_), std::as_const(output_->record))) return false;
    }
    return true;
  }

  const Slice& slice_;
  Cause cause_;
  pipeline::TickConfig recorded_;
  RecordedInput input_;
  std::unique_ptr<TickRecord> was_ = std::make_unique<TickRecord>();
  std::unique_ptr<pipeline::TickOutput> output_ = std::make_unique<pipeline::TickOutput>();
};

// The smallest multiple of a round step, above the configured value and up to kLargestMultiple of it, that the loader
// takes and that keeps the rule from firing; by bisection. Empty: none does.
class Search {
 public:
  Search(const monitor::RecordedRun& run, const Rule& rule, Laboratory& laboratory)
      : run_(run),
        rule_(rule),
        laboratory_(laboratory),
        configured_(rule.value(run.robot)),
        step_(step_of(configured_)) {}

  std::string sentence() {
    std::int64_t taken = configured_ / step_;  // multiples of the step: the largest that the loader takes
    std::int64_t refused = kLargestMultiple * configured_ / step_ + 1;
    if (rule_.unit == Unit::share) refused = std::min(refused, (millionths(1) - 1) / step_ + 1);  // 1 switches it off
    while (refused - taken > 1) {
      const std::int64_t middle = std::midpoint(taken, refused);
      (tried(middle) ? taken : refused) = middle;
    }
    std::int64_t fires = configured_ / step_;
    std::int64_t kept = taken;
    Outcome best = kept == fires ? Outcome{} : outcome(kept);
    if (!best.kept) return {};
    while (kept - fires > 1) {
      const std::int64_t middle = std::midpoint(fires, kept);
      const Outcome found = outcome(middle);
      if (found.kept) best = found;
      (found.kept ? kept : fires) = middle;
    }
    std::string text =
        fmt::format("with {} {} (was {}, tried in steps of {}", rule_.key, text_of(kept * step_, rule_.unit),
                    text_of(configured_, rule_.unit), text_of(step_, rule_.unit));
    if (best.stopped_by != Cause::none)
      text += fmt::format("; then {} {:.1f} s later", name(best.stopped_by), best.later.seconds());
    return text + ")";
  }

 private:
  [[nodiscard]] std::expected<config::RobotConfig, std::string> tried(std::int64_t multiple) const {
    const config::Override other{std::string(rule_.key), text_of(multiple * step_, rule_.unit)};
    return config::with_overrides(run_.robot, std::span(&other, 1));
  }
  [[nodiscard]] Outcome outcome(std::int64_t multiple) const {
    const auto robot = tried(multiple);
    return robot ? laboratory_.with(*robot) : Outcome{};
  }
  const monitor::RecordedRun& run_;
  const Rule& rule_;
  Laboratory& laboratory_;
  std::int64_t configured_, step_;
};

std::string joined(const std::vector<std::string>& parts, std::string_view between) {
  return fmt::format("{}", fmt::join(parts, between));
}

std::string answer(const monitor::RecordedRun& run, const Slice& slice) {
  const incident::Incident& incident = *slice.incident;
  if (!slice.is_whole() || slice.behind < incident::kSignLasts) return {};
  Laboratory laboratory(run, slice);
  if (!laboratory.reproduces()) return {};
  std::vector<std::string> keys, found;
  for (const Rule& rule : kRules) {
    if (rule.cause != incident.cause) continue;
    keys.emplace_back(rule.key);
    if (std::string text = Search(run, rule, laboratory).sentence(); !text.empty()) found.push_back(std::move(text));
  }
  const std::string judged = fmt::format("the {:.1f} s recorded behind it", slice.behind.seconds());
  if (!found.empty())
    return fmt::format("by replay: {}, {}; judged on {}, in which the robot moves as it did, not as it would have",
                       joined(found, ", or "),
                       incident.to == Mode::fault_latched ? "this rule would not have fired" : "it would have gone on",
                       judged);
  const bool is_silence = waits_for_command(incident.cause) || incident.cause == Cause::feedback_lost;
  if (!is_silence || laboratory.ends_in_recording()) return {};
  return fmt::format("by replay: no other {} would have helped: nothing more came in {}", joined(keys, " or "), judged);
}

}  // namespace

void add_counterfactuals(std::vector<incident::Incident>& incidents, const monitor::RecordedRun& run) {
  std::vector<Slice> slices;
  for (const bool fault : {true, false})
    for (incident::Incident& incident : incidents)
      if (has_rule(incident.cause) && (incident.to == Mode::fault_latched) == fault && slices.size() < kMostAnswered)
        slices.emplace_back(incident);
  if (slices.empty()) return;
  const Duration period = run.robot.control.period;
  const auto scanned = monitor::scan_run(run, {.tick =
                                                   [&](const monitor::RecordedTick& tick) {
                                                     for (Slice& slice : slices) slice.tick(tick.record);
                                                   },
                                               .command =
                                                   [&](const monitor::RecordedCommand& command) {
                                                     for (Slice& slice : slices) slice.command(command);
                                                   },
                                               .keyframe =
                                                   [&](const monitor::RecordedKeyframe& keyframe) {
                                                     for (Slice& slice : slices) slice.keyframe(keyframe, period);
                                                   },
                                               .loss = {}});
  if (!scanned) return;
  for (const Slice& slice : slices) slice.incident->counterfactual = answer(run, slice);
}

}  // namespace takt::evidence

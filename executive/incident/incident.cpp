// SPDX-License-Identifier: Apache-2.0
#include "executive/incident/incident.hpp"

#include <fmt/format.h>

#include <algorithm>
#include <cmath>

#include "config/cautions.hpp"
#include "config/units.hpp"
#include "drivers/protocol/cause_detail.hpp"
#include "drivers/protocol/protocol_table.hpp"
#include "executive/contract/feedback_names.hpp"
#include "executive/contract/tick_facts.hpp"
#include "executive/incident/log_hint.hpp"
#include "executive/pipeline/mode_machine.hpp"

namespace takt::incident {
namespace {

constexpr std::uint64_t kSilentTicks = 3;                  // a reply may come a tick late
constexpr std::uint32_t kTargetsAlone = 0, kGainsToo = 1;  // what was brought into its range, or may have been
constexpr std::int64_t kStallShare = 4;                    // a quarter of feedback.timeout lost at once is worth a word

// Of causes: those that are something wrong.
bool is_sign(Cause cause) {
  const pipeline::Reaction& row = pipeline::reaction(cause);
  const bool stops = pipeline::is_latched(row.from(Mode::tracking)) || pipeline::is_latched(row.from(Mode::arming));
  return (stops || cause == Cause::contract_violated || cause == Cause::command_late) && !is_asked(cause);
}

// A record may say what no executive says: it may come from a file.
std::string_view clears_when(Cause cause) {
  if (static_cast<std::size_t>(cause) < kCauseCount) return pipeline::reaction(cause).clears_when;
  return "unknown: the record names a cause that does not exist";
}

// What brings to rest a robot, or what a fault leaves of it, where its file says no more.
std::string_view rest_text(const config::RobotConfig& robot) {
  if (robot.model) return "damped to rest and held";
  if (config::holds_at_once(robot)) return "braked joint by joint and held by stiffness alone, as it has no `model`";
  return "damped until it rests and then held; it has no `model`, so what its joints carry falls";
}

// ", after 5 s damped to rest and held"; empty: it does not end.
std::string until_text(const config::StopConfig& stop, const config::RobotConfig& robot) {
  return stop.longest > Duration{}
             ? fmt::format(", after {} {}", config::format_duration(stop.longest), rest_text(robot))
             : "";
}

std::string damped_text(const TickRecordHeader& header, const config::RobotConfig& robot) {
  using config::StopHow;
  const auto stop = std::ranges::find(robot.stops, name(header.cause), &config::StopConfig::name);
  switch (stop == robot.stops.end() ? StopHow::rest : stop->how) {
    case StopHow::rest:
      break;
    case StopHow::damping:
      return "the robot is damped, and never held";
    case StopHow::hold:
      return "the robot is braked and held" + until_text(*stop, robot);
    case StopHow::policy:
      if (header.player != Player::fallback) break;
      return fmt::format("the fallback policy moves the robot as long as it has something to say{}",
                         until_text(*stop, robot));
  }
  return fmt::format("the robot is {}", rest_text(robot));
}

// What a fault leaves of the robot (Limbs): one without a model is one limb, and one that may fall damps as a whole.
std::string left_text(const config::RobotConfig& robot) {
  if (robot.model)
    return fmt::format("what hangs on them damps, the other joints of their limbs hold, the rest of the robot is {}",
                       rest_text(robot));
  if (config::holds_at_once(robot)) return fmt::format("the rest of the robot is {}", rest_text(robot));
  return "every other joint damps and is never held, as the robot has no `model`; what they carry falls";
}

std::string done_text(const TickRecordHeader& header, const config::RobotConfig& robot) {
  const Cause cause = header.cause;
  if (cause == Cause::operator_deenergise) return "every drive lost its power; what hung fell";
  if (cause == Cause::internal_error) return "every joint only damps; the fault stays latched";
  if (cause == Cause::shutdown)
    return fmt::format("the robot is {}, then loses its power", robot.model ? "damped to rest" : rest_text(robot));
  if (header.mode != Mode::fault_latched) return damped_text(header, robot);
  return fmt::format("the failed drives get no power, {}; the fault stays latched", left_text(robot));
}

// Of the policy's commands.
std::string newest_text(const TickRecordHeader& header) {
  return header.seats[Seat::policy].freshness == Freshness::missing
             ? "none is left"
             : fmt::format("the newest is {:.0f} ms old", header.age.total().milliseconds());
}

std::string tilt_words(const TickRecordHeader& header, const config::Imu& limits) {
  const auto& turning = header.imu.angular_velocity;
  return fmt::format(
      "the base leans {:.2f} rad from upright (imu.tilt {:g}) and turns at {:.2f} rad/s "
      "(imu.angular_velocity {:g})",
      tilt_of(header.imu), limits.tilt, std::hypot(turning[0], turning[1], turning[2]), limits.angular_velocity);
}

std::string imu_words(const TickRecordHeader& header, const std::string& sensor) {
  switch (header.imu_verdict) {
    case ImuVerdict::absent:
      return fmt::format("nothing was ever read of sensor {}", sensor);
    case ImuVerdict::usable:
      return fmt::format("sensor {}: its newest sample is {:.0f} ms old, or says the same as all before it", sensor,
                         (header.now - header.imu.sensed_at).milliseconds());
    case ImuVerdict::from_future:
      return fmt::format("sensor {}: its newest sample is stamped {:.1f} ms ahead of now", sensor,
                         (header.imu.sensed_at - header.now).milliseconds());
    case ImuVerdict::backwards:
      return fmt::format("sensor {}: its stamps run backwards", sensor);
    case ImuVerdict::not_finite:
      return fmt::format("sensor {}: its newest sample has values that are no numbers", sensor);
    case ImuVerdict::not_unit:
      return fmt::format("sensor {}: its quaternion is no unit quaternion", sensor);
    case ImuVerdict::contradicts:
      return fmt::format("sensor {}: its rotation turns otherwise than its angular velocity says (imu.contradiction)",
                         sensor);
  }
  return {};
}

std::string sentence_of(const Incident& incident) {
  std::string text = incident.asked ? "stop asked for" : incident.to == Mode::fault_latched ? "fault" : "stop";
  text += fmt::format(" at tick {}: {}", incident.tick, name(incident.cause));
  if (!incident.detail.empty()) text += fmt::format(": {}", incident.detail);
  if (const IncidentLink& first = incident.chain.front(); !incident.asked && first.at < incident.at)
    text += fmt::format("; first sign {:.1f} ms before, at tick {}: {}", (incident.at - first.at).milliseconds(),
                        first.tick, first.what);
  return text + fmt::format("; done: {}; clears with: {}", incident.done, incident.clears_when);
}

}  // namespace

bool is_asked(Cause cause) {
  return cause == Cause::operator_stop || cause == Cause::operator_deenergise || cause == Cause::shutdown;
}

std::vector<std::pair<Mode, Cause>> possible_transitions() {
  std::vector<std::pair<Mode, Cause>> all;
  for (const pipeline::Reaction& row : pipeline::kReactions)
    for (std::size_t from = 0; from < kModeCount; ++from) {
      const std::pair change{row.to[from], row.cause};
      if (change.first != static_cast<Mode>(from) && std::ranges::find(all, change) == all.end()) all.push_back(change);
    }
  return all;
}

std::string degraded_sentence(const TickRecord& record, const config::RobotConfig& robot) {
  const TickRecordHeader& header = record.header;
  std::string what = drivers::cause_detail(header.cause, record, robot);
  if (header.cause == Cause::contract_violated)
    what = fmt::format("{} of the window's {} ticks had no usable command (freshness.epsilon {:g}); {}",
                       header.window_misses, header.window_ticks, robot.freshness.epsilon, newest_text(header));
  if (header.cause == Cause::command_late) {
    const double by_window_ms = robot.freshness.epsilon * robot.freshness.window.milliseconds();
    const double after_ms = robot.degraded.after.milliseconds();
    const bool is_after = after_ms > 0 && after_ms < by_window_ms;
    what = fmt::format("no usable command came for {:g} ms ({}); {}", is_after ? after_ms : by_window_ms,
                       is_after ? "degraded.after" : "freshness.epsilon of freshness.window", newest_text(header));
  }
  return fmt::format("degraded at tick {}: {}{}{}", header.tick, name(header.cause), what.empty() ? "" : ": ", what);
}

IncidentWatch::IncidentWatch(const config::RobotConfig& robot) : robot_(robot) {
  heard_.resize(robot_.joints.size());
  forget();
}

void IncidentWatch::forget() {
  causes_.assign(kCauseCount, {});
  errors_.assign(robot_.joints.size(), {});
  silences_.assign(robot_.joints.size(), {});
  clamped_.assign(robot_.joints.size(), {});
  buses_.assign(robot_.buses.size(), {});
  command_ = fallback_ = stall_ = {};
}

namespace {

// One more tick in which a sign shows.
template <class Sign>
void note(Sign& sign, const TickRecordHeader& header, std::uint64_t first_tick, MonoTime since,
          std::uint32_t code = 0) {
  const bool goes_on = sign.tick != 0 && header.now - sign.last <= kSignLasts && sign.code == code;
  if (!goes_on) sign = {first_tick, since, {}, code};
  sign.last = header.now;
}

}  // namespace

void IncidentWatch::look_at_joint(const TickRecord& record, std::size_t joint) {
  const TickRecordHeader& header = record.header;
  const JointFeedback& feedback = record.joints[joint].feedback;
  if (feedback.drive_state == DriveState::fault || feedback.error_code != 0)
    note(errors_[joint], header, header.tick, header.now, feedback.error_code);
  const InterventionMask marks = record.joints[joint].interventions;
  if ((marks & bit(Intervention::target_range)) != 0)
    note(clamped_[joint], header, header.tick, header.now,
         (marks & bit(Intervention::gain_limit)) != 0 ? kGainsToo : kTargetsAlone);
  Heard& heard = heard_[joint];
  if (heard.tick == 0 || feedback.received_at != heard.stamp)
    heard = {feedback.received_at, header.now, header.tick};
  else if (header.tick - heard.tick >= kSilentTicks * robot_.joints[joint].drive.every)
    note(silences_[joint], header, heard.tick + 1, heard.at + robot_.control.period);
}

void IncidentWatch::look(const TickRecord& record) {
  const TickRecordHeader& header = record.header;
  for (std::size_t cause = 1; cause < kCauseCount; ++cause)
    if ((header.causes_active >> cause & 1U) != 0 && is_sign(static_cast<Cause>(cause)))
      note(causes_[cause], header, header.tick, header.now);
  const std::size_t joints = std::min<std::size_t>(header.joint_count, robot_.joints.size());
  for (std::size_t joint = 0; joint < joints; ++joint) look_at_joint(record, joint);
  const std::size_t buses = std::min<std::size_t>(header.bus_count, robot_.buses.size());
  for (std::size_t bus = 0; bus < buses; ++bus)
    if (const BusState state = header.buses[bus].state; state != BusState::up)
      note(buses_[bus], header, header.tick, header.now, static_cast<std::uint32_t>(state));
  if (relies_on_policy(header) && !is_usable(header.seats[Seat::policy].freshness))
    note(command_, header, header.tick, header.now);
  if (header.player == Player::fallback || (fallback_.tick != 0 && header.previous_mode == Mode::degraded))
    note(fallback_, header, header.tick, header.now);
  if (header.seats[Seat::policy].arrival != Arrival::none && header.seats[Seat::policy].arrival != Arrival::accepted)
    refused_ = header.seats[Seat::policy].arrival;
  look_at_time(header);
}

// A wake-up this late is known at once, its cause one tick later.
void IncidentWatch::look_at_time(const TickRecordHeader& header) {
  if (header.overrun_cause != OverrunCause::none) {
    late_ = header.overrun_cause;
    late_tick_ = header.tick;
  }
  if (header.lateness * kStallShare < robot_.feedback.timeout) return;
  const std::uint64_t began = stall_.tick;
  note(stall_, header, header.tick, header.now - header.lateness);
  longest_stall_ = stall_.tick == began ? std::max(longest_stall_, header.lateness) : header.lateness;
}

std::vector<IncidentLink> IncidentWatch::chain(const TickRecordHeader& header) const {
  std::vector<IncidentLink> links;
  const auto add = [&](const Sign& sign, const auto& what) {
    if (sign.tick != 0 && sign.tick < header.tick && header.now - sign.last <= kSignLasts)
      links.push_back({sign.tick, sign.since, what()});
  };
  if (stall_.tick != 0 && header.now - stall_.last <= kSignLasts) {  // it may be this very tick's
    const std::string why = late_tick_ > stall_.tick ? fmt::format(" ({})", name(late_)) : "";
    links.push_back({stall_.tick, stall_.since,
                     fmt::format("the control loop stood still for {:.1f} ms{}", longest_stall_.milliseconds(), why)});
  }
  for (std::size_t joint = 0; joint < robot_.joints.size(); ++joint) {
    const config::Joint& known = robot_.joints[joint];
    add(errors_[joint], [&] {
      const std::uint32_t code = errors_[joint].code;
      return fmt::format("joint {}: {}", known.name, code == 0 ? "fault" : drivers::error_name(known.drive, code));
    });
    add(silences_[joint], [&] { return fmt::format("joint {}: silent", known.name); });
    add(clamped_[joint], [&] {
      return fmt::format("joint {}: {} out of range", known.name,
                         clamped_[joint].code == kGainsToo ? "gain or target" : "target");
    });
  }
  for (std::size_t bus = 0; bus < robot_.buses.size(); ++bus)
    add(buses_[bus], [&] {
      return fmt::format("bus {}: {}", robot_.buses[bus].name, name(static_cast<BusState>(buses_[bus].code)));
    });
  add(command_, [] { return std::string("no usable command"); });
  add(fallback_, [&] { return fmt::format("the fallback policy {} took over", robot_.degraded.fallback); });
  for (std::size_t cause = 1; cause < kCauseCount; ++cause)
    add(causes_[cause], [&] { return std::string(name(static_cast<Cause>(cause))); });
  std::ranges::stable_sort(links, {}, &IncidentLink::tick);
  links.push_back({header.tick, header.now, fmt::format("{} -> {}", name(header.previous_mode), name(header.mode))});
  return links;
}

// Clamping ends with the tick that stops the robot: what was clamped in the tick before tells which of the two it is.
// "targets were out of range in more than 25 % of the window (clamped_share), last of joint hip"; empty: none was.
std::string IncidentWatch::just_clamped(const TickRecordHeader& header) const {
  std::string joints;
  bool gains = false;
  for (std::size_t joint = 0; joint < robot_.joints.size(); ++joint) {
    const Sign& sign = clamped_[joint];
    if (sign.tick == 0 || header.now - sign.last >= robot_.control.period * 2) continue;
    joints += (joints.empty() ? "" : ", ") + robot_.joints[joint].name;
    gains |= sign.code == kGainsToo;
  }
  if (joints.empty()) return {};
  return fmt::format("{} were out of range in more than {:g} % of the window (clamped_share), last of joint {}{}",
                     gains ? "gains or targets" : "targets", 100 * robot_.freshness.clamped_share, joints,
                     gains ? "; gains were held at limits.kp and limits.kd" : "");
}

std::string IncidentWatch::bad_commands(const TickRecordHeader& header) const {
  if (const std::string clamped = just_clamped(header); !clamped.empty()) return "the policy's " + clamped;
  return fmt::format("more of the policy's commands were refused than bad_command_limit allows, the last one as {}",
                     name(refused_));
}

// Of causes that are about the robot as a whole.
#pragma GCC diagnostic push
#pragma GCC diagnostic ignored "-Wswitch-enum"
std::string IncidentWatch::words(const TickRecord& record) const {
  const config::Freshness& limits = robot_.freshness;
  const TickRecordHeader& header = record.header;
  const config::Fallback* const fallback = config::fallback_policy_of(robot_);
  const bool may_have_fallen_back = fallback != nullptr && header.previous_mode == Mode::degraded;
  const std::string newest = newest_text(header);
  switch (header.cause) {
    case Cause::operator_stop:
      return "a person asked for it";
    case Cause::operator_deenergise:
      return "a person took the power away";
    case Cause::shutdown:
      return "the executive was told to end";
    case Cause::command_lost:
      return fmt::format("no usable command came for {:g} ms (stop_after), {}{}; {}", limits.stop_after.milliseconds(),
                         may_have_fallen_back ? "of the fallback policy " + fallback->name + " neither, " : "", newest,
                         kPolicyLogHint);
    case Cause::fallback_spent:
      if (const std::string clamped = just_clamped(header); !clamped.empty())
        return fmt::format("the fallback policy {}'s {}", robot_.degraded.fallback, clamped);
      return fmt::format(
          "the fallback policy {} has moved the robot for {:g} s (fallbacks.{}.for), and the policy is "
          "not back: {}",
          robot_.degraded.fallback, fallback != nullptr ? fallback->longest.seconds() : 0, robot_.degraded.fallback,
          newest);
    case Cause::bad_commands:
      return bad_commands(header);
    case Cause::enable_timeout:
      return fmt::format("every drive is enabled, but no usable command came: {}", newest);
    case Cause::overrun:
      return fmt::format("the control loop was late again and again, last by {}", name(late_));
    case Cause::recording_lost:
      return "a recorder is required (record.recorder), and none writes";
    case Cause::torque_output_lost:
      return "the output that permits torque (safety.safe_torque_off) could not be set, or reads otherwise";
    case Cause::tilt:
      return tilt_words(header, robot_.imu.value_or(config::Imu{}));
    case Cause::imu_lost:
      return imu_words(header, robot_.imu.value_or(config::Imu{}).sensor);
    case Cause::degraded_spent:
      return fmt::format("the robot has been degraded for {:g} s (degraded.for), and the contract is not restored: {}",
                         robot_.degraded.longest.seconds(), newest);
    case Cause::internal_error:
      return "an assertion of Takt failed: report it with the run folder";
    default:
      return {};  // drivers/protocol/cause_detail.cpp names joints or buses
  }
}
#pragma GCC diagnostic pop

Incident IncidentWatch::made_of(const TickRecord& record) const {
  const TickRecordHeader& header = record.header;
  Incident incident{.tick = header.tick,
                    .at = header.now,
                    .from = header.previous_mode,
                    .to = header.mode,
                    .cause = header.cause,
                    .asked = is_asked(header.cause)};
  incident.detail = drivers::cause_detail(header.cause, record, robot_);
  for (const drivers::CauseFinding& finding : drivers::cause_findings(header.cause, record, robot_)) {
    const bool is_first = incident.where.empty();
    incident.where += (is_first ? "" : ", ") + drivers::place_text(finding, robot_);
    if (is_first && finding.place == drivers::CausePlace::joint)
      incident.error_code = record.joints[finding.index].feedback.error_code;
  }
  if (incident.detail.empty()) incident.detail = words(record);
  incident.chain = chain(header);
  incident.done = done_text(header, robot_);
  incident.clears_when = clears_when(header.cause);
  incident.sentence = sentence_of(incident);
  return incident;
}

std::optional<Incident> IncidentWatch::tick(const TickRecord& record) {
  const TickRecordHeader& header = record.header;
  const bool changed = header.mode != header.previous_mode;
  if (changed && header.mode == Mode::arming) forget();
  look(record);
  stands_ = pipeline::is_latched(header.mode);
  const bool power_taken = changed && header.cause == Cause::operator_deenergise;
  if (!changed || (!stands_ && !power_taken)) return std::nullopt;
  latest_ = made_of(record);
  return latest_;
}

}  // namespace takt::incident

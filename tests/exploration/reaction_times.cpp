// SPDX-License-Identifier: Apache-2.0
#include "tests/exploration/reaction_times.hpp"

#include <fmt/format.h>

#include <algorithm>
#include <cmath>

#include "executive/pipeline/mode_machine.hpp"
#include "tests/exploration/world.hpp"

namespace takt::exploration {
namespace {

constexpr int kPhases = 5;  // of a strike, in a period

// What makes a cause hold.
struct Strike {
  Cause cause;
  Happening what;
  std::string_view from;
  Duration shows;    // what the world takes to show it, in the worst case
  double share = 1;  // of the ticks in which it shows; 0: by chance
  Duration at = seconds(2);
  Duration length = milliseconds(2500);
  Planted planted = Planted::none;
};

// An ODrive tells its state every 10 ms; the policy takes 12 ms to answer, the velocity observer some time constants.
constexpr Duration kReport = milliseconds(10), kAnswer = milliseconds(12), kBunch = milliseconds(12);
// A reply may come this much early before it counts as one too many.
constexpr Duration kEarlyReplies = milliseconds(4);
constexpr Duration kTwoLateWakeUps = milliseconds(6);
constexpr Duration kImuPeriod = milliseconds(1);

constexpr Strike kStrikes[] = {
    {Cause::operator_stop, Happening::operator_stop, "the executive hears it", {}},
    {Cause::shutdown, Happening::shutdown, "the executive hears it", {}},
    {Cause::enable_timeout, Happening::drive_deaf, "arming begins", {}, 1, {}},
    {Cause::command_late, Happening::policy_silent, "the policy falls silent", {}},
    {Cause::command_lost, Happening::policy_silent, "the policy falls silent", {}},
    {Cause::bad_commands, Happening::policy_nonsense, "the policy outputs NaN", kAnswer},
    {Cause::feedback_lost, Happening::drive_silent, "a drive falls silent", {}},
    {Cause::drive_fault, Happening::drive_error, "a drive finds an error", kReport},
    {Cause::drive_disabled, Happening::drive_taken_away, "another node disables a drive", kReport},
    {Cause::bus_off, Happening::bus_off, "the controller goes bus-off", {}},
    {Cause::bus_down, Happening::bus_down, "the interface goes down", {}},
    {Cause::bus_error_passive, Happening::bus_error_passive, "the controller becomes error-passive", {}},
    {Cause::transmit_queue_full, Happening::bus_refuses, "every other frame is not taken", {}, 0.4},
    {Cause::receive_overflow, Happening::bus_overflows, "a frame is lost in every tick", {}},
    {Cause::replies_lost, Happening::frames_lost, "a third of all frames vanishes", {}, 0, seconds(2), seconds(8)},
    {Cause::replies_repeated, Happening::drive_repeats, "a drive sends every reply twice", kEarlyReplies},
    {Cause::replies_delayed, Happening::drive_late, "replies come in bunches of 12 ms", kBunch, 0.75},
    {Cause::foreign_node, Happening::bus_has_stranger, "another node sends in every tick", {}},
    {Cause::bus_babble, Happening::bus_babbles, "a node sends twenty frames a tick", {}},
    {Cause::envelope_exceeded, Happening::hurl, "a joint moves beyond velocity_hard", {}},
    {Cause::overrun, Happening::late_wake_ups, "every wake-up comes 3 ms late", kTwoLateWakeUps},
    {Cause::recording_lost, Happening::recorder_ends, "the recorder reports its end", {}},
    {Cause::internal_error, Happening::operator_stop, "the guard refuses a frame", {}, 1, {}, {}, Planted::refused},
    {Cause::operator_deenergise, Happening::operator_deenergise, "the executive hears it", {}},
    {Cause::torque_output_lost, Happening::torque_output_fails, "the torque output fails", {}},
    {Cause::tilt, Happening::base_leans, "the base leans over", kImuPeriod},
    {Cause::imu_lost, Happening::imu_silent, "the IMU falls silent", {}},
    {Cause::fallback_spent, Happening::policy_silent, "the policy falls silent", {}},
    {Cause::temperature_high, Happening::drive_hot, "a drive reports that it is hot", {}},
    {Cause::overtemperature, Happening::drive_hot, "a drive reports that it is hot", {}},
    {Cause::degraded_spent, Happening::policy_silent, "the policy falls silent", {}},
};

bool has_drive(const config::RobotConfig& robot, std::size_t bus, config::DriveProtocol protocol) {
  return std::ranges::any_of(
      robot.joints, [&](const config::Joint& joint) { return joint.bus == bus && joint.drive.protocol == protocol; });
}

// The world can do it there: who may be switched off by a stranger, whose heartbeat may come too often, who reports
// without being asked and so may be armed although it is deaf.
bool can_strike(const Strike& strike, const config::RobotConfig& robot, std::size_t index) {
  using enum config::DriveProtocol;
  if (strike.what == Happening::bus_babbles) return has_drive(robot, index, odrive);
  if (strike.what == Happening::drive_hot) return robot.joints[index].drive.variant == "damiao";
  if (strike.what != Happening::drive_taken_away && strike.cause != Cause::enable_timeout) return true;
  const config::DriveProtocol protocol = robot.joints[index].drive.protocol;
  return protocol == odrive || (protocol == mit && strike.cause == Cause::drive_disabled);
}

std::size_t places(Happening what, const config::RobotConfig& robot) {
  return is_of_bus(what) ? robot.buses.size() : is_of_joint(what) ? robot.joints.size() : 1;
}

// Until the last frame of the tick in which the cause changes the mode; none: it never does. `seed`: which frames get
// lost, where that is left to chance.
std::optional<Duration> react_by(std::uint64_t seed, const config::RobotConfig& robot, const Strike& strike,
                                 std::size_t index, Duration phase) {
  const bool is_planted = strike.planted != Planted::none;
  const Event event{strike.what, strike.at + phase, strike.length, index};
  World world(robot, is_planted ? std::vector<Event>{} : std::vector<Event>{event}, seed, strike.planted);
  MonoTime began = kStart + event.at, last_frame;
  std::optional<Duration> took;
  world.on_frame = [&](const World::Sent& sent) { last_frame = sent.at; };
  world.on_tick = [&](const TickRecord& record) {
    const bool is_arming = record.header.cause == Cause::operator_arm;
    if (strike.cause == Cause::enable_timeout && is_arming) began = record.header.now;
    if (is_planted) began = world.refused_at();
    if (!took && record.header.cause == strike.cause) took = last_frame - began;
  };
  world.run(strike.at + strike.length + milliseconds(2500));
  return took;
}

// Of frames lost at random a drive may miss so many that another cause comes first: then chance has another try.
std::optional<Duration> react(const config::RobotConfig& robot, const Strike& strike, std::size_t index,
                              Duration phase) {
  constexpr std::uint64_t kTries = 4;
  for (std::uint64_t seed = 1; seed <= (strike.what == Happening::frames_lost ? kTries : 1); ++seed)
    if (const auto took = react_by(seed, robot, strike, index, phase)) return took;
  return std::nullopt;
}

// As bus_watch.hpp counts: after which time the share of the window is over its limit.
Duration until_share(double limit, double shown, Duration window) {
  return Duration{static_cast<std::int64_t>(-std::log(1 - limit / shown) * static_cast<double>(window.ns))};
}

// The time that the table's bound names in front of its tick.
std::optional<Duration> finding(const Strike& strike, const config::RobotConfig& robot) {
  const auto shared = [&](double limit) { return until_share(limit, strike.share, robot.bus_faults.window); };
  const auto of_window = [&](double share) {
    return Duration{static_cast<std::int64_t>(share * static_cast<double>(robot.freshness.window.ns))};
  };
  switch (strike.cause) {
    case Cause::enable_timeout:
      return robot.feedback.enable_timeout;
    case Cause::command_late:
      return robot.freshness.max_age + of_window(robot.freshness.epsilon);
    case Cause::command_lost:
      return robot.freshness.max_age + robot.freshness.stop_after;
    case Cause::bad_commands:
      return robot.policy.value().period * (robot.freshness.bad_command_limit + 1);
    case Cause::feedback_lost:
      return robot.feedback.timeout;
    case Cause::contract_violated:
    case Cause::feedback_implausible:
    case Cause::following_error:
    case Cause::following_lost:
      return std::nullopt;
    case Cause::bus_error_passive:
      return shared(robot.bus_faults.error_passive);
    case Cause::transmit_queue_full:
      return shared(robot.bus_faults.transmit_drops);
    case Cause::receive_overflow:
      return shared(robot.bus_faults.receive_drops);
    case Cause::replies_lost:
      return std::nullopt;
    case Cause::replies_repeated:
      return shared(robot.bus_faults.replies_repeated);
    case Cause::replies_delayed:
      return shared(robot.bus_faults.replies_delayed);
    case Cause::foreign_node:
      return shared(robot.bus_faults.foreign_frames);
    case Cause::bus_babble:
      return shared(robot.bus_faults.babble);
    case Cause::envelope_exceeded:  // two time constants of the observer
      return Duration{static_cast<std::int64_t>(2e9 / robot.joints.front().observer_bandwidth)};
    case Cause::overrun:
      return of_window(robot.control.late_share);
    case Cause::fallback_spent:
      return robot.freshness.max_age + of_window(robot.freshness.epsilon) + robot.fallbacks.front().longest;
    case Cause::degraded_spent:
      return robot.freshness.max_age + of_window(robot.freshness.epsilon) + robot.degraded.longest;
    case Cause::imu_lost:
      return robot.sensors.back().timeout;
    case Cause::none:
    case Cause::operator_arm:
    case Cause::operator_stop:
    case Cause::operator_reset:
    case Cause::shutdown:
    case Cause::drives_enabled:
    case Cause::contract_restored:
    case Cause::drive_fault:
    case Cause::drive_disabled:
    case Cause::bus_off:
    case Cause::bus_down:
    case Cause::recording_lost:
    case Cause::internal_error:
    case Cause::operator_deenergise:
    case Cause::torque_output_lost:
    case Cause::tilt:
    case Cause::temperature_high:
    case Cause::overtemperature:
      return Duration{};
  }
  return std::nullopt;
}

}  // namespace

std::expected<std::vector<ReactionTime>, std::string> measure_reaction_times(const config::RobotConfig& plain) {
  std::vector<ReactionTime> rows;
  const config::RobotConfig with_fallback = robot_with_fallback(), minds = robot_that_minds();
  const auto struck = [&](Cause cause) -> const config::RobotConfig& {
    if (cause == Cause::fallback_spent) return with_fallback;
    return cause == Cause::temperature_high || cause == Cause::degraded_spent ? minds : plain;
  };
  for (const Strike& strike : kStrikes) {
    const config::RobotConfig& robot = struck(strike.cause);
    ReactionTime row{strike.cause, strike.from, {}, finding(strike, robot)};
    // A deviation may begin just after a tick looked: one period more than the table's tick.
    if (row.bound) row.bound = *row.bound + strike.shows + robot.control.period * 2;
    for (std::size_t index = 0; index < places(strike.what, robot); ++index) {
      for (int phase = 0; phase < kPhases && can_strike(strike, robot, index); ++phase) {
        const auto took = react(robot, strike, index, Duration{robot.control.period.ns * phase / kPhases});
        if (!took) return std::unexpected(fmt::format("{}: not met where {} is struck", name(strike.cause), index));
        row.worst = std::max(row.worst, *took);
      }
    }
    if (row.bound && row.worst > *row.bound)
      return std::unexpected(fmt::format("{}: {:.2f} ms, which is over its bound of {:.2f} ms", name(strike.cause),
                                         row.worst.milliseconds(), row.bound->milliseconds()));
    rows.push_back(row);
  }
  return rows;
}

}  // namespace takt::exploration

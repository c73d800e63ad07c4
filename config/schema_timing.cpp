// SPDX-License-Identifier: Apache-2.0
// Keys: control, freshness, feedback, bus_faults.
#include <array>

#include "config/schema.hpp"

namespace takt::config {
namespace {

constexpr std::array<std::string_view, 3> kFollowing{"warn", "degrade", "stop"};
constexpr std::array<std::string_view, 2> kWakeModes{"sleep", "hybrid"};

void describe_control(Fields& fields, Control& control) {
  fields.duration({"period", "time between control ticks", "1 ms"}, control.period, microseconds(100),
                  milliseconds(100));
  fields.integer({"priority", "SCHED_FIFO priority of the thread", "80"}, control.priority, 1, 99);
  fields.whole_or_none({"cpu", "core of the thread", "none"}, control.cpu, 0, 1023);
  fields.choice({"wake", "sleep until the tick, or spin before it", "sleep"}, control.wake, kWakeModes);
  fields.duration({"spin", "hybrid: time to spin before the tick", "100 us"}, control.spin, microseconds(1),
                  milliseconds(50));
  fields.quantity({"late_share", "damped stop beyond this share of late periods in freshness.window; 1: never", "0.25"},
                  control.late_share, Dimension::none, Range{.low = 0, .high = 1, .low_open = true});
}

void describe_freshness(Fields& fields, Freshness& freshness) {
  fields.duration({"max_age", "a command older than this is not played"}, freshness.max_age, milliseconds(1),
                  seconds(60));
  fields.quantity({"aging_fraction", "past this part of max_age a command counts as aging", "0.8"},
                  freshness.aging_fraction, Dimension::none, inside(0, 1));
  fields.quantity({"epsilon", "contract: Pr(age > max_age) <= epsilon"}, freshness.epsilon, Dimension::none,
                  inside(0, 1));
  fields.quantity({"confidence", "one-sided confidence of the miss rate's bound", "0.95"}, freshness.confidence,
                  Dimension::none, inside(0, 1));
  fields.duration({"window", "sliding window of misses"}, freshness.window, milliseconds(1), seconds(600));
  fields.duration({"recover_after", "uninterrupted fresh time that ends degraded mode"}, freshness.recover_after,
                  milliseconds(1), seconds(600));
  fields.duration(
      {"flap_memory", "a relapse within this time doubles the next recovery, up to 16 times recover_after", "10 s"},
      freshness.flap_memory, milliseconds(0), seconds(3600));
  fields.duration({"stop_after", "damped stop after this long without usable command"}, freshness.stop_after,
                  milliseconds(1), seconds(600));
  fields.integer(
      {"bad_command_limit", "damped stop beyond so many invalid messages in the window (bad_commands)", "25"},
      freshness.bad_command_limit, 1, 1'000'000);
  fields.quantity({"clamped_share",
                   "damped stop beyond this share of ticks with out-of-range targets (bad_commands); 1: never", "0.25"},
                  freshness.clamped_share, Dimension::none, Range{.low = 0, .high = 1, .low_open = true});
}

void describe_feedback(Fields& fields, FeedbackConfig& feedback) {
  fields.duration({"timeout", "fault when a joint is silent longer"}, feedback.timeout, microseconds(100), seconds(10));
  fields.duration({"enable_timeout", "time for every drive to report enabled", "500 ms"}, feedback.enable_timeout,
                  milliseconds(1), seconds(60));
  fields.quantity({"rest_velocity", "slower joints count as resting; a damped stop then holds", "0.02 rad/s"},
                  feedback.rest_velocity, Dimension::angular_velocity, above(0, 10));
  fields.quantity(
      {"jump", "ignore positions this far beyond what velocity_hard allows, stop after three in a row; 0 rad: off",
       "0.05 rad"},
      feedback.jump, Dimension::angle, between(0, 10));
  fields.quantity(
      {"contradiction",
       "stop when positions and the drive's velocities differ by this plus a quarter of the way in 0.5 s; 0 rad: off",
       "0.03 rad"},
      feedback.contradiction, Dimension::angle, between(0, 10));
  fields.duration(
      {"frozen_after", "stop when a position is constant this long in motion (velocity, torque); 0 ms: off", "20 ms"},
      feedback.frozen_after, {}, seconds(10));
  fields.duration(
      {"following_timeout", "a joint beyond limits.following_error this long is behind; 0 ms: off", "500 ms"},
      feedback.following_timeout, {}, seconds(60));
  fields.choice({"following",
                 "for a joint that is behind: warn, degrade until it follows, or damped stop (following_lost)", "warn"},
                feedback.following, kFollowing);
}

void describe_bus_faults(Fields& fields, BusFaults& faults) {
  const auto share = [&fields](const Key& key, double& value) {
    fields.quantity(key, value, Dimension::none, Range{.low = 0, .high = 1, .low_open = true});
  };
  fields.duration({"window", "window of the shares below, about", "1 s"}, faults.window, milliseconds(1), seconds(3));
  share({"replies_lost", "missing replies of a joint", "0.5"}, faults.replies_lost);
  share({"replies_repeated", "excess replies of a joint", "0.1"}, faults.replies_repeated);
  share({"replies_delayed", "replies of a joint more than two ticks late", "0.5"}, faults.replies_delayed);
  share({"transmit_drops", "ticks in which a bus took no frame", "0.05"}, faults.transmit_drops);
  share({"receive_drops", "ticks with frames lost by this computer", "0.02"}, faults.receive_drops);
  share({"foreign_frames", "ticks with another controller on the drives' ids", "0.02"}, faults.foreign_frames);
  share({"babble", "ticks with more frames than the drives can send", "0.1"}, faults.babble);
  share({"error_passive", "ticks with an error-passive controller", "0.5"}, faults.error_passive);
}

}  // namespace

void describe_timing(Fields& fields, RobotConfig& robot) {
  fields.section({"control", "the control loop", "{}"}, [&](Fields& f) { describe_control(f, robot.control); });
  fields.section({"freshness", "how old a command may be"}, [&](Fields& f) { describe_freshness(f, robot.freshness); });
  fields.section({"feedback", "what the drives owe"}, [&](Fields& f) { describe_feedback(f, robot.feedback); });
  fields.section({"bus_faults", "limits, as shares of the window's ticks; 1: off", "{}"},
                 [&](Fields& f) { describe_bus_faults(f, robot.bus_faults); });
}

}  // namespace takt::config

// SPDX-License-Identifier: Apache-2.0
#include <fmt/format.h>

#include <algorithm>
#include <numbers>

#include "lab/study/margin_report.hpp"

namespace takt::study {
namespace {

constexpr double kDegreesPerRad = 180 / std::numbers::pi, kHertz = 0.5 / std::numbers::pi;

std::string pair(const std::optional<double>& computed, const std::optional<double>& injected, double factor) {
  const auto one = [&](const std::optional<double>& value) {
    return value ? fmt::format("{:.1f}", *value * factor) : std::string("-");
  };
  return one(computed) + " / " + one(injected);
}

std::string differ(const JointMargins& joint) {
  if (!joint.disagreement) return "-";
  if (*joint.disagreement > 9.99) return "> 999 %";
  return fmt::format("{:.1f} %", *joint.disagreement * 100);
}

constexpr double kLeastPhase_deg = kLeastPhase_rad * kDegreesPerRad;

std::string joint_lines(const JointMargins& joint) {
  if (!joint.has_loop()) return fmt::format("{:<18.18}  no loop: {}\n", joint.joint, joint.no_loop);
  const std::optional<double>& crossover = joint.injected.crossover;
  std::string text = fmt::format("{:<18.18}{:>14}  {:>14}  {:>14}{:>7}{:>9}\n", joint.joint,
                                 pair(joint.computed.gain, joint.injected.gain, 1),
                                 pair(joint.computed.phase_rad, joint.injected.phase_rad, kDegreesPerRad),
                                 pair(joint.computed.delay_s, joint.injected.delay_s, 1e3),
                                 crossover ? fmt::format("{:.1f}", *crossover * kHertz) : "-", differ(joint));
  if (!joint.not_computed.empty()) text += fmt::format("  not computed: {}\n", joint.not_computed);
  if (joint.rings()) text += fmt::format("  rings: its phase margin is below {:.0f} degrees\n", kLeastPhase_deg);
  if (!joint.trouble.empty()) text += fmt::format("  spoiled: {}\n", joint.trouble);
  if (joint.disagreement && *joint.disagreement > kAgreement)
    text += fmt::format("  computed and injected differ by more than {:.0f} %\n", kAgreement * 100);
  return text;
}

std::string point_lines(const std::vector<TolerancePoint>& points, std::string_view dose, bool misses) {
  std::string text = fmt::format("{:>13}  {:>8}  {:>13}  {:>9}  {:>9}{}\n", dose, "success", "95 % bounds", "age p50",
                                 "age p99", misses ? "     misses" : "");
  for (const TolerancePoint& point : points) {
    text += fmt::format("{:>10.0f} ms  {:>8}  [{:.3f} {:.3f}]  {:>6.1f} ms  {:>6.1f} ms{}{}\n", point.dose_ms,
                        fmt::format("{} of {}", point.successes, point.rollouts), point.success_lower,
                        point.success_upper, point.age_p50_ms, point.age_p99_ms,
                        misses ? fmt::format("  {:>7.2f} %", point.miss_share * 100) : "",
                        point.tolerated ? "" : "  refused");
  }
  return text;
}

std::string recovery_lines(const std::vector<RecoveryPoint>& points) {
  std::string text = fmt::format("{:>13}  {:>11}  {:>9}  {:>18}  {:>14}\n", "recover_after", "flap_memory", "success",
                                 "ticks in violation", "times degraded");
  for (const RecoveryPoint& point : points)
    text += fmt::format("{:>10.0f} ms  {:>9g} s  {:>9}  {:>18.1f}  {:>14.1f}\n", point.recover_after.milliseconds(),
                        point.flap_memory.seconds(), fmt::format("{} of {}", point.successes, point.rollouts),
                        point.violated_ticks, point.entries);
  return text;
}

std::string proposal(const AgeTolerance& found, const config::RobotConfig& robot) {
  std::string text = fmt::format("\nage tolerated {}{:.1f} ms, without added delay p99 {:.1f} ms\n",
                                 found.age_is_open ? "at least " : "", found.tolerated_age_ms, found.nominal_p99_ms);
  if (found.tolerated_share)
    text += fmt::format("misses tolerated {}{:.2f} % of ticks\n", found.share_is_open ? "at least " : "",
                        *found.tolerated_share * 100);
  if (found.tolerated_silence_ms)
    text += fmt::format("silence tolerated {}{:.0f} ms\n", found.silence_is_open ? "at least " : "",
                        *found.tolerated_silence_ms);
  text += fmt::format("proposed: max_age {:.0f} ms, epsilon {}, stop_after {}\n", found.max_age_ms,
                      found.epsilon ? fmt::format("{:g}", *found.epsilon) : "none (no miss is tolerated)",
                      found.stop_after_ms ? fmt::format("{:.0f} ms", *found.stop_after_ms)
                                          : "none (silence is not tolerated for longer than max_age)");
  if (found.recovery)
    text += fmt::format("proposed: recover_after {:g} ms, flap_memory {:g} s\n",
                        found.recovery->recover_after.milliseconds(), found.recovery->flap_memory.seconds());
  text += fmt::format("robot file: max_age {:.0f} ms, epsilon {:g}, stop_after {:.0f} ms\n",
                      robot.freshness.max_age.milliseconds(), robot.freshness.epsilon,
                      robot.freshness.stop_after.milliseconds());
  text += fmt::format("robot file: recover_after {:g} ms, flap_memory {:g} s\n",
                      robot.freshness.recover_after.milliseconds(), robot.freshness.flap_memory.seconds());
  if (found.max_age_ms < found.nominal_p99_ms)
    text += "the policy's path alone is older than the proposed max_age: make it faster before trusting it\n";
  return text;
}

}  // namespace

std::string ringing_sentence(const JointMargins& joint) {
  return fmt::format("joint {} rings: phase margin {:.1f} degrees, below {:.0f}; {}", joint.joint,
                     joint.phase_rad().value_or(0) * kDegreesPerRad, kLeastPhase_deg, joint.advice);
}

std::string margin_text(const MarginReport& report) {
  std::string text = fmt::format("inner loop of {}, computed / injected\n", report.robot.robot);
  text += fmt::format("{:<18}{:>14}  {:>14}  {:>14}{:>7}{:>9}\n", "joint", "gain factor", "phase deg", "delay ms",
                      "at Hz", "differ");
  for (const JointMargins& joint : report.joints) text += joint_lines(joint);
  if (!report.not_measured.empty())
    text = fmt::format("inner loop of {}, not measured:\n{}\n", report.robot.robot, report.not_measured);
  if (!report.tolerance) return text;
  text += "\ncommand age, no gate\n" + point_lines(report.tolerance->ages, "delay", false);
  if (!report.tolerance->misses.empty())
    text += fmt::format("\nmisses, gated at {:.0f} ms\n", report.tolerance->max_age_ms) +
            point_lines(report.tolerance->misses, "stall per 1 s", true);
  if (!report.tolerance->silences.empty())
    text += fmt::format("\nsilence, gated at {:.0f} ms\n", report.tolerance->max_age_ms) +
            point_lines(report.tolerance->silences, "one freeze", false);
  if (!report.tolerance->recoveries.empty())
    text += "\nrecovery, by the proposed contract under stalls and at its limit of age\n" +
            recovery_lines(report.tolerance->recoveries);
  return text + proposal(*report.tolerance, report.robot);
}

}  // namespace takt::study

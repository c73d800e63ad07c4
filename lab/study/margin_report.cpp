// SPDX-License-Identifier: Apache-2.0
#include "lab/study/margin_report.hpp"

#include <fmt/format.h>

#include <algorithm>
#include <array>
#include <cmath>
#include <numbers>

#include "evidence/review/svg.hpp"

namespace takt::study {
namespace {

using Json = nlohmann::ordered_json;

constexpr double kDegrees = 180 / std::numbers::pi;

Json number(const std::optional<double>& value, double factor = 1) {
  return value && std::isfinite(*value) ? Json(*value * factor) : Json();
}

Json to_json(const LoopMargins& margins) {
  return {{"gain_factor", number(margins.gain)},
          {"phase_deg", number(margins.phase_rad, kDegrees)},
          {"delay_ms", number(margins.delay_s, 1e3)},
          {"crossover_rad_s", number(margins.crossover)},
          {"gain_at_rad_s", number(margins.gain_at)}};
}

Json to_json(const JointMargins& joint) {
  return {{"joint", joint.joint},
          {"no_loop", joint.no_loop},
          {"computed", joint.has_loop() && joint.not_computed.empty() ? to_json(joint.computed) : Json()},
          {"not_computed", joint.not_computed},
          {"injected", joint.has_loop() ? to_json(joint.injected) : Json()},
          {"trouble", joint.trouble},
          {"disagreement", number(joint.disagreement)},
          {"agrees", joint.agrees()},
          {"rings", joint.rings()},
          {"advice", joint.advice}};
}

Json to_json(const std::vector<TolerancePoint>& points) {
  Json all = Json::array();
  for (const TolerancePoint& point : points)
    all.push_back({{"dose_ms", point.dose_ms},
                   {"rollouts", point.rollouts},
                   {"successes", point.successes},
                   {"success_lower", point.success_lower},
                   {"success_upper", point.success_upper},
                   {"age_p50_ms", point.age_p50_ms},
                   {"age_p99_ms", point.age_p99_ms},
                   {"miss_share", point.miss_share},
                   {"tolerated", point.tolerated}});
  return all;
}

Json to_json(const std::vector<RecoveryPoint>& points) {
  Json all = Json::array();
  for (const RecoveryPoint& point : points)
    all.push_back({{"recover_after_ms", point.recover_after.milliseconds()},
                   {"flap_memory_ms", point.flap_memory.milliseconds()},
                   {"rollouts", point.rollouts},
                   {"successes", point.successes},
                   {"violated_ticks", point.violated_ticks},
                   {"entered_degraded", point.entries}});
  return all;
}

std::optional<double> wait_of(const AgeTolerance& found) {
  return found.recovery ? std::optional(found.recovery->recover_after.milliseconds()) : std::nullopt;
}
std::optional<double> memory_of(const AgeTolerance& found) {
  return found.recovery ? std::optional(found.recovery->flap_memory.milliseconds()) : std::nullopt;
}

Json to_json(const AgeTolerance& found) {
  return {{"publish_delay", to_json(found.ages)},
          {"inference_stall", to_json(found.misses)},
          {"policy_freeze", to_json(found.silences)},
          {"recovery", to_json(found.recoveries)},
          {"tolerated_age_ms", found.tolerated_age_ms},
          {"tolerated_age_is_open", found.age_is_open},
          {"nominal_age_p99_ms", found.nominal_p99_ms},
          {"tolerated_miss_share", number(found.tolerated_share)},
          {"tolerated_miss_share_is_open", found.share_is_open},
          {"tolerated_silence_ms", number(found.tolerated_silence_ms)},
          {"tolerated_silence_is_open", found.silence_is_open},
          {"proposed_max_age_ms", found.max_age_ms},
          {"proposed_epsilon", number(found.epsilon)},
          {"proposed_stop_after_ms", number(found.stop_after_ms)},
          {"proposed_recover_after_ms", number(wait_of(found))},
          {"proposed_flap_memory_ms", number(memory_of(found))}};
}

constexpr std::array<std::string_view, 7> kColours{"#4477aa", "#ee6677", "#228833", "#ccbb44",
                                                   "#66ccee", "#aa3377", "#555555"};
constexpr double kLeft = 60, kWidth = 640, kHeight = 220, kTop = 30, kGap = 50;
constexpr double kMost_dB = 60, kLeast_dB = -60;

// One of the two panels: where a frequency and a value lie in it.
struct Axes {
  double top = 0, low_log = 0, high_log = 0, least = 0, most = 0;
  [[nodiscard]] evidence::SvgPoint at(double omega, double value) const {
    const double across = (std::log10(omega) - low_log) / (high_log - low_log);
    const double down = (most - std::clamp(value, least, most)) / (most - least);
    return {kLeft + kWidth * across, top + kHeight * down};
  }
};

using Value = double (*)(const std::complex<double>&);

double decibels(const std::complex<double>& loop) {
  return 20 * std::log10(std::abs(loop));
}

// In (-360, 0], where a loop with delay spends its time.
double phase_deg(const std::complex<double>& loop) {
  const double phase = std::arg(loop) * kDegrees;
  return phase > 0 ? phase - 360 : phase;
}

void draw_grid(const Axes& axes, std::string_view unit, double step, std::string& out) {
  for (double value = axes.least; value <= axes.most; value += step) {
    const double y = axes.at(1, value).y;
    out += evidence::svg_line(kLeft, y, kLeft + kWidth, y, "#dddddd");
    out += evidence::svg_text(kLeft - 6, y + 4, fmt::format("{:g}", value), "end");
  }
  for (double decade = std::ceil(axes.low_log); decade <= axes.high_log; ++decade) {
    const double x = axes.at(std::pow(10, decade), 0).x;
    out += evidence::svg_line(x, axes.top, x, axes.top + kHeight, "#dddddd");
    out += evidence::svg_text(x, axes.top + kHeight + 16, fmt::format("{:g} rad/s", std::pow(10, decade)), "middle");
  }
  out += evidence::svg_text(kLeft, axes.top - 8, unit, "start");
}

void draw_joint(const JointMargins& joint, std::string_view colour, const Axes& axes, Value value, std::string& out) {
  std::vector<evidence::SvgPoint> line;
  for (const ResponsePoint& point : joint.computed_response) line.push_back(axes.at(point.omega, value(point.loop)));
  out += evidence::svg_polyline(line, colour);
  for (const ResponsePoint& point : joint.injected_response) {
    const evidence::SvgPoint place = axes.at(point.omega, value(point.loop));
    out += evidence::svg_rectangle({place.x - 2, place.y - 2, 4, 4}, colour, 1, joint.joint);
  }
}

}  // namespace

bool MarginReport::agrees() const {
  return std::ranges::all_of(joints, &JointMargins::agrees);
}

bool MarginReport::rings() const {
  return std::ranges::any_of(joints, &JointMargins::rings);
}

Json to_json(const MarginReport& report) {
  Json json{{"schema", "takt.margin/1"}, {"robot", report.robot.robot}, {"agreement", kAgreement}};
  json["not_measured"] = report.not_measured;
  json["joints"] = Json::array();
  for (const JointMargins& joint : report.joints) json["joints"].push_back(to_json(joint));
  json["agrees"] = report.agrees();
  json["rings"] = report.rings();
  json["task"] = report.tolerance ? to_json(*report.tolerance) : Json();
  return json;
}

std::string bode_svg(std::span<const JointMargins> joints) {
  double low = 1e9, high = 0;
  for (const JointMargins& joint : joints) {
    for (const ResponsePoint& point : joint.injected_response) {
      low = std::min(low, point.omega);
      high = std::max(high, point.omega);
    }
  }
  const Axes gain{kTop, std::log10(low), std::log10(high), kLeast_dB, kMost_dB};
  const Axes phase{kTop + kHeight + kGap, gain.low_log, gain.high_log, -360, 0};
  std::string body;
  draw_grid(gain, "gain of the loop, dB: lines computed, marks injected", 20, body);
  draw_grid(phase, "phase, degrees", 90, body);
  double y = kTop + 10;
  for (std::size_t i = 0; i < joints.size(); ++i) {
    if (!joints[i].has_loop()) continue;
    const std::string_view colour = kColours[i % kColours.size()];
    draw_joint(joints[i], colour, gain, decibels, body);
    draw_joint(joints[i], colour, phase, phase_deg, body);
    body += evidence::svg_rectangle({kLeft + kWidth + 16, y - 9, 10, 10}, colour, 1, joints[i].joint);
    body += evidence::svg_text(kLeft + kWidth + 32, y, joints[i].joint, "start");
    y += 18;
  }
  return evidence::svg_document(kLeft + kWidth + 190, phase.top + kHeight + 30, "Loops of the stabiliser", body);
}

}  // namespace takt::study

// SPDX-License-Identifier: Apache-2.0
#include "lab/study/budget_sources.hpp"

#include <algorithm>
#include <array>

namespace takt::study {
namespace {

std::vector<double> rates_of(const config::RobotConfig& robot) {
  const std::span<const double> usual = usual_rates_Hz();
  std::vector<double> rates(usual.begin(), usual.end());
  rates.push_back(focus_Hz_of(robot));
  return rates;
}

// Commands and replies of the fullest bus, and then what the simulated drive adds.
StageTime actuation_of(const config::RobotConfig& robot, std::span<const drivers::BusLoad> loads) {
  double busiest = 0;
  for (const drivers::BusLoad& load : loads) busiest = std::max(busiest, load.load);
  StageTime stage{"actuation", busiest * robot.control.period.milliseconds(), 0, "fullest bus"};
  if (robot.simulation) {
    stage.typical_ms += robot.simulation->torque_delay.milliseconds();
    stage.source += ", torque_delay";
  }
  stage.worst_ms = stage.typical_ms;
  return stage;
}

StageTime measured(std::string_view stage, const monitor::Quantiles& times_ns, bool waits) {
  const double typical_ms = std::max(times_ns.p50 / 1e6, 0.0);
  return {std::string(stage), typical_ms, std::max(times_ns.p99 / 1e6, typical_ms), "run, p50 and p99", waits};
}

}  // namespace

double focus_Hz_of(const config::RobotConfig& robot) {
  return robot.policy ? 1e9 / static_cast<double>(robot.policy->period.ns) : 50;
}

Question question_of(const config::RobotConfig& robot, std::span<const drivers::BusLoad> loads) {
  Question question{figure_stages(), {}, rates_of(robot), robot.freshness.max_age.milliseconds()};
  if (robot.simulation && !robot.simulation->camera_sensor.empty()) {
    const config::Simulation& camera = *robot.simulation;
    question.stages.front() = {"perception", camera.camera_delay.milliseconds(),
                               (camera.camera_delay + camera.camera_jitter).milliseconds(), "simulation.camera"};
  }
  question.stages.back() = actuation_of(robot, loads);
  return question;
}

std::expected<Question, std::string> question_of(const monitor::RecordedRun& run, const monitor::RunMetrics& metrics) {
  constexpr std::array<bool, 4> kWaits{true, true, false, true};  // sense, queue, infer, publish
  if (metrics.age_per_command.back().count == 0)
    return std::unexpected(run.folder.path() + ": no command of this run was ever used; there is nothing to measure");
  Question question{{}, {}, rates_of(run.robot), run.robot.freshness.max_age.milliseconds()};
  for (std::size_t part = 0; part < kWaits.size(); ++part)
    question.stages.push_back(measured(monitor::kAgePartNames[part], metrics.age_per_command[part], kWaits[part]));
  question.stages.push_back(measured("tick", metrics.work, false));
  question.measured_total = measured("age", metrics.age_per_command.back(), false);
  return question;
}

}  // namespace takt::study

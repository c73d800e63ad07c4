// SPDX-License-Identifier: Apache-2.0
#include "lab/panel/recorded_row.hpp"

#include <fmt/format.h>

#include <cmath>
#include <fstream>
#include <memory>
#include <nlohmann/json.hpp>
#include <optional>
#include <vector>

#include "evidence/rollout/arm_world.hpp"
#include "evidence/rollout/rollout_measures.hpp"
#include "monitor/record/recorded_run.hpp"

namespace takt::lab {
namespace {

constexpr Duration kSettle = seconds(2);             // as in virtual time
constexpr Duration kMayEndEarly = milliseconds(50);  // the end is asked for by a process without a deadline

struct TruthAt {
  MonoTime at;
  evidence::TruthOfTick truth;
};

bool is_outside(const std::vector<double>& q, const config::RobotConfig& robot) {
  for (std::size_t joint = 0; joint < robot.joints.size() && joint < q.size(); ++joint)
    if (q[joint] < robot.joints[joint].limits.q_min || q[joint] > robot.joints[joint].limits.q_max) return true;
  return false;
}

// What hangs cannot be balanced again: a passive joint beyond its limits by the margin.
bool has_fallen(const std::vector<double>& q, const config::RobotConfig& robot) {
  for (std::size_t j = 0; j < robot.joints.size() && j < q.size(); ++j) {
    const config::Limits& limits = robot.joints[j].limits;
    if (robot.joints[j].passive &&
        (q[j] < limits.q_min - limits.position_margin || q[j] > limits.q_max + limits.position_margin))
      return true;
  }
  return false;
}

// A line that was cut off when the simulator was ended is left out.
std::expected<std::vector<TruthAt>, std::string> read_truth(const std::string& path, evidence::Task task,
                                                            const config::RobotConfig& robot) {
  std::ifstream stream(path);
  if (!stream) return std::unexpected(path + ": cannot be read");
  std::vector<TruthAt> truths;
  std::vector<double> before;
  for (std::string line; std::getline(stream, line);) {
    const auto json = nlohmann::json::parse(line, nullptr, false);
    if (!json.is_object()) continue;
    const MonoTime at{json.value("monotonic_ns", std::int64_t{0})};
    const auto tool = json.value("tool", std::vector<double>{});
    if (tool.size() != 3) return std::unexpected(path + ": a line has no tool position");
    evidence::TruthOfTick truth{.error_m = json.value("error_m", 0.0)};
    const auto q = json.value("q", std::vector<double>{});
    truth.violated = is_outside(q, robot);
    truth.lost = (!truths.empty() && truths.back().truth.lost) || has_fallen(q, robot);
    if (task == evidence::Task::arm_tracking && !truths.empty()) {
      const double moved = std::hypot(tool[0] - before[0], tool[1] - before[1], tool[2] - before[2]);
      truth.violated |= moved > evidence::kToolSpeedLimit * (at - truths.back().at).seconds();
    }
    before = tool;
    truths.push_back({at, truth});
  }
  if (truths.empty()) return std::unexpected(path + ": holds nothing; takt-plant did not write it");
  return truths;
}

// Ticks in order, from the first in tracking on.
class Measuring {
 public:
  Measuring(const RecordedRollout& rollout, const config::RobotConfig& robot, std::vector<TruthAt> truths,
            RolloutWatch& watch)
      : rollout_(rollout), robot_(robot), truths_(std::move(truths)), watch_(watch) {}

  void command(const monitor::RecordedCommand& command) {
    if (measures_) watch_.command(command);
  }

  void tick(const TickRecord& record) {
    const MonoTime now = record.header.now;
    if (!measures_) {
      if (record.header.mode != Mode::tracking) return;
      begin(now);
    }
    if (now >= began_ + rollout_.duration) return;
    while (next_ + 1 < truths_.size() && truths_[next_ + 1].at <= now) ++next_;
    measures_->tick(record, truths_[next_].truth);
    watch_.tick(record);
    last_ = now;
  }

  std::expected<void, std::string> finish(const config::Freshness& freshness, evidence::RolloutRow& row) {
    if (!measures_) return std::unexpected(rollout_.run_folder + ": the robot was never in tracking");
    if (last_ + kMayEndEarly < began_ + rollout_.duration)
      return std::unexpected(fmt::format("{}: the recording ends after {:.2f} of {:.2f} s", rollout_.run_folder,
                                         (last_ - began_).seconds(), rollout_.duration.seconds()));
    measures_->finish(freshness.epsilon, freshness.confidence, row);
    return {};
  }

 private:
  void begin(MonoTime now) {
    began_ = now;
    disturbance_.emplace(rollout_.perturbation, now);
    measures_ = std::make_unique<evidence::RolloutMeasures>(
        evidence::Score{now + kSettle, now + (rollout_.duration - rollout_.scored), rollout_.bound_m}, *disturbance_,
        robot_);
  }

  const RecordedRollout& rollout_;
  const config::RobotConfig& robot_;
  std::vector<TruthAt> truths_;
  RolloutWatch& watch_;
  std::size_t next_ = 0;  // the truth that holds
  std::optional<evidence::Disturbance> disturbance_;
  std::unique_ptr<evidence::RolloutMeasures> measures_;
  MonoTime began_, last_;
};

}  // namespace

RecordedRollout recorded_rollout(const Panel& panel, const PlannedRollout& planned, const std::string& folder) {
  const PanelTask& task = panel.tasks[planned.task];
  return {.run_folder = folder + "/run",
          .truth_file = folder + "/truth.jsonl",
          .task = task.task,
          .perturbation = panel.perturbations[planned.perturbation].resolved(),
          .duration = panel.duration,
          .scored = task.scored,
          .bound_m = task.bound_m};
}

std::expected<void, std::string> measure_recorded(const RecordedRollout& rollout, RolloutWatch& watch,
                                                  evidence::RolloutRow& row) {
  const auto run = monitor::open_run(rollout.run_folder);
  if (!run) return std::unexpected(run.error());
  auto truths = read_truth(rollout.truth_file, rollout.task, run->robot);
  if (!truths) return std::unexpected(truths.error());
  Measuring measuring(rollout, run->robot, std::move(*truths), watch);
  const auto scanned = monitor::scan_run(*run, {.tick = [&](const auto& tick) { measuring.tick(tick.record); },
                                                .command = [&](const auto& command) { measuring.command(command); },
                                                .keyframe = {},
                                                .loss = {},
                                                .policy_input = [&](const auto& input) { watch.input(input); },
                                                .image = [&](const auto& image) { watch.image(image); }});
  if (!scanned) return std::unexpected(scanned.error());
  return measuring.finish(run->robot.freshness, row);
}

}  // namespace takt::lab

// SPDX-License-Identifier: Apache-2.0
#include "evidence/review/usual_stretches.hpp"

#include "evidence/review/recorded_input.hpp"

namespace takt::evidence {
namespace {

class StretchCutter {
 public:
  // `policy`: hash of the run's own; 0: any.
  StretchCutter(const config::RobotConfig& robot, std::uint64_t policy, Duration length)
      : monitors_(robot), policy_(policy), length_(length) {}

  void command(const monitor::RecordedCommand& command) { monitors_.command(command); }
  void tick(const TickRecordHeader& header) {
    const std::uint64_t whose = header.command_policy;  // 0: no command is in use
    const bool is_its_own = policy_ == 0 || whose == 0 || whose == policy_;
    const bool follows = header.mode == Mode::tracking && header.slept_ms == 0 && is_its_own;
    if (!follows || !begins_.is_set()) {
      begins_ = follows ? header.now : MonoTime{};
      monitors_.forget_levels();
    }
    monitors_.tick(header);
    if (!begins_.is_set() || header.now - begins_ < length_) return;
    if (monitors_.answers() > 0) levels_.push_back(monitors_.levels());
    monitors_.forget_levels();
    begins_ = header.now;
  }
  std::vector<monitor::ChunkScores> take() { return std::move(levels_); }

 private:
  monitor::ChunkMonitors monitors_;
  std::uint64_t policy_;
  Duration length_;
  MonoTime begins_;  // of the stretch; unset: the robot does not follow the policy
  std::vector<monitor::ChunkScores> levels_;
};

}  // namespace

std::expected<std::vector<monitor::ChunkScores>, std::string> usual_stretches(const monitor::RecordedRun& run,
                                                                              Duration length) {
  StretchCutter cutter(run.robot, recorded_config(run).policy.hash, length);
  const auto scan =
      monitor::scan_run(run, {.tick = [&](const monitor::RecordedTick& tick) { cutter.tick(tick.record.header); },
                              .command = [&](const monitor::RecordedCommand& command) { cutter.command(command); },
                              .keyframe = {},
                              .loss = {}});
  if (!scan) return std::unexpected(scan.error());
  return cutter.take();
}

}  // namespace takt::evidence

#include "evidence/review/usual_stretches.hpp"

namespace takt::monitor {
namespace {

class StretchCutter {
 public:
  StretchCutter(const config::RobotConfig& robot, Duration length) : monitors_(robot), length_(length) {}

  void command(const RecordedCommand& command) { monitors_.command(command); }
  void tick(const TickRecordHeader& header) {
    const bool follows = header.mode == Mode::tracking && header.slept_ms == 0;
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
  std::vector<ChunkScores> take() { return std::move(levels_); }

 private:
  ChunkMonitors monitors_;
  Duration length_;
  MonoTime begins_;  // of the stretch; unset: the robot does not follow the policy
  std::vector<ChunkScores> levels_;
};

}  // namespace

std::expected<std::vector<ChunkScores>, std::string> usual_stretches(const RecordedRun& run, Duration length) {
  StretchCutter cutter(run.robot, length);
  const auto scan = scan_run(run, {.tick = [&](const RecordedTick& tick) { cutter.tick(tick.record.header); },
                                   .command = [&](const RecordedCommand& command) { cutter.command(command); },
                                   .keyframe = {},
                                   .loss = {}});
  if (!scan) return std::unexpected(scan.error());
  return cutter.take();
}

}  // namespace takt::monitor

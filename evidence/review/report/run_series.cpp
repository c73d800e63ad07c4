// SPDX-License-Identifier: Apache-2.0
#include "evidence/review/report/run_series.hpp"

#include <algorithm>
#include <cstring>

#include "evidence/review/report/task_target.hpp"

namespace takt::evidence {
namespace {

constexpr std::uint64_t kMomentTicksLeast = 40, kMomentTicksMost = 2'000;

struct TickRange {
  std::uint64_t first = 0, last = 0;
};

// Around the beginning of each verdict, a third of it before; each as long as all together allow. Sorted, disjoint.
std::vector<TickRange> moments_of(const monitor::FaultSummary& faults, std::size_t row_bytes) {
  if (faults.verdicts.empty()) return {};
  const std::uint64_t room = kMomentBytes / row_bytes;
  const std::uint64_t length = std::clamp(room / faults.verdicts.size(), kMomentTicksLeast, kMomentTicksMost);
  std::vector<TickRange> moments;
  std::uint64_t used = 0;
  for (const monitor::FaultVerdict& verdict : faults.verdicts) {
    TickRange range{verdict.first_tick - std::min(verdict.first_tick, length / 3), verdict.first_tick + 2 * length / 3};
    if (!moments.empty()) range.first = std::max(range.first, moments.back().last + 1);
    if (range.first > range.last) continue;
    used += range.last - range.first + 1;
    if (used > room) break;
    moments.push_back(range);
  }
  return moments;
}

// The joint targets at the end of the newest accepted chunk.
class PolicyTarget {
 public:
  explicit PolicyTarget(std::size_t joints) : joints_(joints) {}

  // Read by the tick to come.
  void command(const monitor::RecordedCommand& command) {
    const auto header = monitor::policy_header_of(command);
    if (!header || header->joint_count != joints_ || header->step_count == 0) return;
    const std::size_t first = value_index(*header, CommandField::q, header->step_count - 1U, 0);
    const std::size_t at = sizeof *header + first * sizeof(float);
    if (command.payload.size() < at + joints_ * sizeof(float)) return;
    offered_.resize(joints_);
    std::memcpy(offered_.data(), command.payload.data() + at, joints_ * sizeof(float));
  }
  void tick(const TickRecordHeader& header) {
    if (header.seats[Seat::policy].arrival == Arrival::accepted && !offered_.empty()) in_use_ = offered_;
    offered_.clear();
  }
  [[nodiscard]] std::span<const float> in_use() const { return in_use_; }

 private:
  std::size_t joints_;
  std::vector<float> offered_, in_use_;
};

class Series {
 public:
  Series(const monitor::RecordedRun& run, const monitor::RunMetrics& metrics, const monitor::FaultSummary& faults,
         std::optional<TaskTarget> task_target, std::size_t whole_bytes)
      : joints_(run.robot.joints.size()),
        buses_(run.robot.buses.size()),
        has_task_target_(task_target.has_value()),
        bucket_ticks_(std::max<std::uint64_t>(1, (metrics.ticks * row_bytes() + whole_bytes - 1) / whole_bytes)),
        start_(metrics.start),
        task_target_(std::move(task_target)),
        policy_target_(joints_),
        whole_(joints_, buses_, has_task_target_, bucket_ticks_, run.robot.control.period),
        moments_(joints_, buses_, has_task_target_, 1, run.robot.control.period) {
    if (bucket_ticks_ > 1) ranges_ = moments_of(faults, row_bytes());
  }

  void command(const monitor::RecordedCommand& command) { policy_target_.command(command); }
  void tick(const TickRecord& record) {
    const TickRecordHeader& header = record.header;
    const double at_s = (header.now - start_).seconds();
    policy_target_.tick(header);
    TickContext context{policy_target_.in_use(), {}};
    if (task_target_) context.task_target = task_target_->at(header.now);
    whole_.tick(record, at_s, context);
    while (range_ < ranges_.size() && header.tick > ranges_[range_].last) ++range_;
    if (range_ < ranges_.size() && header.tick >= ranges_[range_].first)
      moments_.tick(record, at_s, context);
    else
      moments_.pause();
    follow_mode(header, at_s);
  }
  RunSeries finish() {
    if (any_) close_band(last_s_, Cause::none);
    return {whole_.finish(), moments_.finish(), std::move(bands_), {}};
  }

 private:
  [[nodiscard]] std::size_t row_bytes() const {
    return SampleBlockBuilder::row_bytes(joints_, buses_, has_task_target_);
  }
  void follow_mode(const TickRecordHeader& header, double at_s) {
    if (any_ && header.mode != mode_) close_band(at_s, header.cause);
    mode_ = header.mode;
    last_s_ = at_s;
    any_ = true;
  }
  void close_band(double at_s, Cause cause) {
    if (bands_.size() < kListedBands) bands_.push_back({band_from_s_, at_s, mode_, cause});
    band_from_s_ = at_s;
  }

  std::size_t joints_, buses_;
  bool has_task_target_;
  std::uint64_t bucket_ticks_;
  MonoTime start_;
  std::optional<TaskTarget> task_target_;
  PolicyTarget policy_target_;
  SampleBlockBuilder whole_, moments_;
  std::vector<TickRange> ranges_;
  std::size_t range_ = 0;
  std::vector<ModeBand> bands_;
  Mode mode_ = Mode::standby;
  double band_from_s_ = 0, last_s_ = 0;
  bool any_ = false;
};

}  // namespace

std::expected<RunSeries, std::string> series_of(const monitor::RecordedRun& run, const monitor::RunMetrics& metrics,
                                                const monitor::FaultSummary& faults, const std::string& truth_file,
                                                std::size_t whole_bytes) {
  std::optional<TaskTarget> task_target;
  if (!truth_file.empty()) {
    auto opened = TaskTarget::open(truth_file);
    if (!opened) return std::unexpected(opened.error());
    task_target = std::move(*opened);
  }
  Series series(run, metrics, faults, std::move(task_target), whole_bytes);
  ShownImages images(run, metrics, faults);
  const auto scanned =
      monitor::scan_run(run, {.tick = [&](const monitor::RecordedTick& tick) { series.tick(tick.record); },
                              .command = [&](const monitor::RecordedCommand& command) { series.command(command); },
                              .keyframe = {},
                              .loss = {},
                              .image = [&](const monitor::ShownImage& image) { images.image(image); }});
  if (!scanned) return std::unexpected(scanned.error());
  RunSeries done = series.finish();
  done.seen = images.finish();
  return done;
}

}  // namespace takt::evidence

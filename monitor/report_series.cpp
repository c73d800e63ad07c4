#include <algorithm>

#include "monitor/report.hpp"

namespace takt::monitor {
namespace {

constexpr std::uint64_t kBuckets = 2'500;        // of age and stages
constexpr std::uint64_t kJointSamples = 60'000;  // over all joints

// Keeps the samples of a bucket at which a value was smallest and largest, in the order in which they came.
template <class Sample>
class Extremes {
 public:
  void add(double value, const Sample& sample) {
    if (empty_ || value < least_) least_ = value, least_sample_ = sample;
    if (empty_ || value > most_) most_ = value, most_sample_ = sample;
    empty_ = false;
  }
  void flush(std::vector<Sample>& out) {
    if (empty_) return;
    const bool least_first = least_sample_.at_s <= most_sample_.at_s;
    out.push_back(least_first ? least_sample_ : most_sample_);
    if (least_sample_.at_s != most_sample_.at_s) out.push_back(least_first ? most_sample_ : least_sample_);
    empty_ = true;
  }
  [[nodiscard]] bool empty() const { return empty_; }
  [[nodiscard]] double most() const { return most_; }

 private:
  bool empty_ = true;
  double least_ = 0, most_ = 0;
  Sample least_sample_, most_sample_;
};

class Thinner {
 public:
  Thinner(RunSeries& series, std::uint64_t ticks, std::size_t joints)
      : series_(series),
        joint_bucket_(std::max<std::uint64_t>(2 * ticks * joints / kJointSamples, 1)),
        tracks_(joints) {
    series_.bucket_ticks = std::max<std::uint64_t>(ticks / kBuckets, 1);
    series_.joints.resize(joints);
  }

  void tick(const TickRecord& record) {
    if (seen_ == 0) start_ = record.header.now;
    const double at_s = (record.header.now - start_).seconds();
    if (record.header.freshness != Freshness::missing) {
      const double total = record.header.age.total().milliseconds();
      if (age_.empty() || total > age_.most()) stage_ = stage_of(record.header.age, at_s);
      age_.add(total, {at_s, total});
    }
    for (std::size_t joint = 0; joint < tracks_.size() && joint < record.header.joint_count; ++joint) {
      const JointRecord& each = record.joints[joint];
      tracks_[joint].add(static_cast<double>(each.feedback.q), {at_s, each.feedback.q, each.q_reference});
    }
    ++seen_;
    if (seen_ % series_.bucket_ticks == 0) flush_age();
    if (seen_ % joint_bucket_ == 0) flush_joints();
  }

  void flush() {
    flush_age();
    flush_joints();
  }

 private:
  static RunSeries::StageSample stage_of(const AgeParts& age, double at_s) {
    return {at_s,
            {age.sense.milliseconds(), age.queue.milliseconds(), age.infer.milliseconds(), age.publish.milliseconds(),
             age.hold.milliseconds()}};
  }
  void flush_age() {
    if (!age_.empty()) series_.stages.push_back(stage_);
    age_.flush(series_.age);
  }
  void flush_joints() {
    for (std::size_t joint = 0; joint < tracks_.size(); ++joint) tracks_[joint].flush(series_.joints[joint]);
  }

  RunSeries& series_;
  std::uint64_t joint_bucket_;
  std::uint64_t seen_ = 0;
  MonoTime start_;
  Extremes<RunSeries::AgeSample> age_;
  RunSeries::StageSample stage_;
  std::vector<Extremes<RunSeries::JointSample>> tracks_;
};

}  // namespace

std::expected<RunSeries, std::string> series_of(const RecordedRun& run, const RunMetrics& metrics) {
  RunSeries series;
  Thinner thinner(series, metrics.ticks, run.manifest.joints.size());
  const auto scanned = scan_run(run, {.tick = [&](const RecordedTick& tick) { thinner.tick(tick.record); },
                                      .command = {},
                                      .keyframe = {},
                                      .loss = {}});
  if (!scanned) return std::unexpected(scanned.error());
  thinner.flush();
  return series;
}

}  // namespace takt::monitor

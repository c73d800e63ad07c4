// SPDX-License-Identifier: Apache-2.0
#include "evidence/review/report/shown_images.hpp"

#include <algorithm>
#include <set>
#include <utility>

#include "executive/contract/image_sample.hpp"
#include "monitor/record/image_file.hpp"
#include "monitor/record/png_image.hpp"

namespace takt::evidence {
namespace {

using monitor::ShownImage;

// Stops, violations, marks, then evenly over the run, its end first.
std::vector<MonoTime> moments_of(const monitor::RunMetrics& metrics, const monitor::FaultSummary& faults) {
  std::vector<MonoTime> moments;
  const auto take = [&](const auto& list) {
    for (std::size_t i = 0; i < std::min(list.size(), kMomentsPerKind); ++i) moments.push_back(list[i].at);
  };
  take(monitor::by_gravity(metrics.incidents));
  take(monitor::by_gravity(faults.verdicts));
  take(metrics.marks);
  constexpr auto kStretches = static_cast<std::int64_t>(kMomentsPerKind);
  for (std::int64_t i = kStretches; i > 0; --i)
    moments.push_back(metrics.start + Duration{metrics.span.ns / kStretches * i + metrics.span.ns % kStretches});
  return moments;
}

bool is_an_image(const config::ImageShape& shape) {
  return shape.channels >= 1 && shape.channels <= 4 && shape.height >= 1 && shape.width >= 1 &&
         std::uint64_t{shape.height} * shape.width <= kMaxImageBytes / shape.channels;
}

// Empty: lost, altered, or no image.
std::string picture_of(const monitor::RunFolder& folder, const ShownImage& image) {
  if (!is_an_image(image.shape)) return "";
  const auto pixels = monitor::read_image(folder, image.shape, image.sha256);
  return pixels ? monitor::png_image(image.shape, std::as_bytes(std::span(*pixels))) : "";
}

}  // namespace

ShownImages::ShownImages(const monitor::RecordedRun& run, const monitor::RunMetrics& metrics,
                         const monitor::FaultSummary& faults)
    : folder_(run.folder), start_(metrics.start), wanted_(moments_of(metrics, faults)), moments_(wanted_) {
  for (const config::Sensor& sensor : run.robot.sensors) sensors_.push_back(sensor.name);
  std::ranges::sort(moments_);
  const auto same = std::ranges::unique(moments_);
  moments_.erase(same.begin(), same.end());
}

void ShownImages::image(const ShownImage& image) {
  if (image.sensor >= sensors_.size()) return;
  Newest& newest = newest_[image.sensor];
  newest.by_moment.resize(moments_.size());
  ++newest.shown;
  if (image.file != monitor::ImageFile::stored) ++newest.without_file;
  if (newest.last && newest.by_moment[*newest.last]->image.published_at < image.published_at)
    newest.by_moment[*newest.last]->next = image.published_at;
  newest.last.reset();
  const auto at = std::ranges::lower_bound(moments_, image.published_at) - moments_.begin();
  const auto moment = static_cast<std::size_t>(at);
  if (moment == moments_.size()) return;
  std::optional<Entry>& entry = newest.by_moment[moment];
  if (entry && entry->image.published_at >= image.published_at) return;
  entry = Entry{image, std::nullopt};
  newest.last = moment;
}

std::vector<SeenBySensor> ShownImages::finish(std::size_t most_bytes) const {
  std::map<std::uint32_t, SeenBySensor> seen;
  for (const auto& [sensor, newest] : newest_)
    seen[sensor] = {sensors_[sensor], newest.shown, newest.without_file, 0, {}};
  const auto since_start = [this](MonoTime at) { return (at - start_).seconds(); };
  std::set<std::pair<std::uint32_t, std::size_t>> done;  // sensor, moment that has the image
  for (const MonoTime wanted : wanted_) {
    for (const auto& [sensor, newest] : newest_) {
      auto moment = static_cast<std::size_t>(std::ranges::lower_bound(moments_, wanted) - moments_.begin());
      while (moment > 0 && !newest.by_moment[moment]) --moment;
      const std::optional<Entry>& entry = newest.by_moment[moment];
      if (!entry || entry->image.file != monitor::ImageFile::stored || !done.emplace(sensor, moment).second) continue;
      std::string png = picture_of(folder_, entry->image);
      if (png.empty()) ++seen[sensor].unreadable;
      if (png.empty() || png.size() > most_bytes) continue;
      most_bytes -= png.size();
      seen[sensor].pictures.push_back({entry->image.shape, since_start(entry->image.sensed_at),
                                       since_start(entry->image.published_at), entry->next.transform(since_start),
                                       std::move(png)});
    }
  }
  std::vector<SeenBySensor> out;
  for (auto& [sensor, each] : seen) {
    std::ranges::sort(each.pictures, {}, &Picture::published_s);
    out.push_back(std::move(each));
  }
  return out;
}

}  // namespace takt::evidence

// SPDX-License-Identifier: Apache-2.0
// What the policies saw, for the report's page: at each moment that a reviewer looks for (stops, violations, marks, and
// evenly over the run) the newest image of each image sensor, as PNG. Bounded in number and bytes, however long the run
// was and however large its images are; what is left out is counted. Streamed: memory is one entry for each moment and
// sensor.
#pragma once

#include <cstddef>
#include <cstdint>
#include <map>
#include <optional>
#include <string>
#include <vector>

#include "monitor/judge/fault_classifier.hpp"
#include "monitor/judge/run_metrics.hpp"

namespace takt::evidence {

inline constexpr std::size_t kPictureBytes = 4'000'000;  // of all PNGs of a page
inline constexpr std::size_t kMomentsPerKind = 30;  // stops, violations, marks, evenly: at most 120 for each sensor

struct Picture {
  config::ImageShape shape;
  double sensed_s = 0, published_s = 0;  // since the run's first tick
  std::optional<double> until_s;         // the next image was published; none: this one was the last
  std::string png;
};

struct SeenBySensor {
  std::string sensor;
  std::uint64_t shown = 0;         // images that policies were shown
  std::uint64_t without_file = 0;  // of those: that the recorder kept none of
  std::uint64_t unreadable = 0;    // of those that the page was to hold: file lost or altered since, or no image
  std::vector<Picture> pictures;   // in time
};

class ShownImages {
 public:
  ShownImages(const monitor::RecordedRun& run, const monitor::RunMetrics& metrics, const monitor::FaultSummary& faults);
  // In the file's order.
  void image(const monitor::ShownImage& image);
  // Reads and packs the images. One for each sensor that policies were shown images of, in the robot file's order.
  [[nodiscard]] std::vector<SeenBySensor> finish(std::size_t most_bytes = kPictureBytes) const;

 private:
  struct Entry {
    monitor::ShownImage image;
    std::optional<MonoTime> next;  // published
  };
  // Of one sensor: the newest image published between a moment and the one before it.
  struct Newest {
    std::vector<std::optional<Entry>> by_moment;
    std::optional<std::size_t> last;  // where the image before is, if it is kept
    std::uint64_t shown = 0, without_file = 0;
  };

  monitor::RunFolder folder_;
  std::vector<std::string> sensors_;
  MonoTime start_;
  std::vector<MonoTime> wanted_;            // the most wanted first
  std::vector<MonoTime> moments_;           // the same, sorted, once each
  std::map<std::uint32_t, Newest> newest_;  // by the sensor's index
};

}  // namespace takt::evidence

// SPDX-License-Identifier: Apache-2.0
// Goal: the images that a policy's process names are in the run folder as their sensor published them, each once, over
// restarts of the sensor; what is named and was never there is told, and nothing that the process says can do more than
// that. Method: sensors served as the client library serves them, inputs as a policy's process would name them.
#include "monitor/image_watch.hpp"

#include <gtest/gtest.h>
#include <png.h>

#include <filesystem>
#include <fstream>
#include <sstream>

#include "config/load.hpp"
#include "config/paths.hpp"
#include "executive/contract/monotonic_clock.hpp"
#include "executive/ipc/sensor_server.hpp"
#include "monitor/record/image_file.hpp"
#include "tests/support/temporary_folder.hpp"

namespace takt::monitor {
namespace {

const config::ImageShape kShape{48, 64, 3};

// As libpng's own reader has them; empty: no PNG of this shape.
std::vector<std::uint8_t> pixels_of(const std::string& png) {
  ::png_image picture{};
  picture.version = PNG_IMAGE_VERSION;
  if (png_image_begin_read_from_memory(&picture, png.data(), png.size()) == 0) return {};
  picture.format = PNG_FORMAT_RGB;
  std::vector<std::uint8_t> pixels(PNG_IMAGE_SIZE(picture));
  const bool is_ours = picture.width == kShape.width && picture.height == kShape.height;
  if (png_image_finish_read(&picture, nullptr, pixels.data(), 0, nullptr) == 0 || !is_ours) return {};
  return pixels;
}

class ImageWatchTest : public test::TemporaryFolder {
 protected:
  ImageWatchTest() {
    robot_ = config::load("config/arm6.yaml").value();
    // Behind the target's estimate, which has no images.
    robot_.sensors.push_back({.name = "cam0", .timeout = milliseconds(500), .image = kShape});
    robot_.sensors.push_back({.name = "nobodys", .timeout = milliseconds(500), .image = kShape});
    config::ObservationTerm term;
    term.kind = config::TermKind::sensor;
    term.sensor = "cam0";
    term.scale = {1};
    robot_.policy->observation.push_back(term);
  }
  void serve(const std::string& name = "cam0") {
    camera_ = ipc::SensorServer::start(config::sensor_socket(path(""), name), {},
                                       ipc::image_mailbox(kShape.height, kShape.width, kShape.channels))
                  .value();
    sequence_ = 0;
  }
  // Publishes an image of this value, and says how a policy's process would name it.
  PolicyInputSample film(std::uint8_t value, std::uint32_t sensor = 1) {
    const std::span<std::byte> slot = camera_->begin();
    const MonoTime now = monotonic_now();
    const ImageHeader header{++sequence_, now - milliseconds(30), now, kShape.bytes(), 0};
    std::memcpy(slot.data(), &header, sizeof header);
    std::fill_n(slot.begin() + sizeof header, kShape.bytes(), std::byte{value});
    camera_->commit(slot.size());
    return {header.sequence, header.sensed_at, header.published_at, sensor, 0};
  }
  static PolicyInput naming(const std::vector<PolicyInputSample>& samples) {
    PolicyInput input;
    input.samples = samples;
    return input;
  }
  RecordSink sink() {
    RecordSink sink;
    sink.image = [this](const ShownImage& image) { told_.push_back(image); };
    sink.picture = [this](const ShownPicture& picture) { pictures_.push_back(picture); };
    sink.loss = [this](const Loss& loss) { losses_[loss.ring + " " + loss.reason] += loss.count; };
    return sink;
  }
  // Until `count` images were told of, or 20 s.
  void wait_for(ImageWatch& watch, std::size_t count) {
    const MonoTime give_up = monotonic_now() + seconds(20);
    do {
      watch.hand_on(sink());
      sleep_until(monotonic_now() + milliseconds(1));
    } while (told_.size() < count && monotonic_now() < give_up);
    ASSERT_EQ(told_.size(), count);
  }
  [[nodiscard]] std::vector<std::uint8_t> bytes_of(const ShownImage& image) const {
    return read_image(folder_, image.shape, image.sha256).value();
  }

  config::RobotConfig robot_;
  RunFolder folder_ = RunFolder::create(path("run")).value();
  std::unique_ptr<ipc::SensorServer> camera_;
  std::uint64_t sequence_ = 0;
  std::vector<ShownImage> told_;
  std::vector<ShownPicture> pictures_;
  std::map<std::string, std::uint64_t> losses_;
};

TEST_F(ImageWatchTest, WhatAPolicyNamesIsKeptAsItsSensorPublishedIt) {
  robot_.record.images = {.budget_mib = 1, .rate_mib_per_s = 100};
  serve();
  ImageWatch watch(path(""), robot_, folder_);
  const PolicyInputSample first = film(10);
  const PolicyInputSample second = film(20);
  watch.shown(naming({first, second}));
  watch.shown(naming({second}));  // several answers rest on it, and other policies'
  wait_for(watch, 2);
  watch.finish(sink());
  ASSERT_EQ(told_.size(), 2U) << "each once";
  EXPECT_EQ(told_[0].sequence, 1U);
  EXPECT_EQ(told_[1].sequence, 2U);
  EXPECT_EQ(told_[1].sensor, 1U);
  EXPECT_EQ(told_[1].sensed_at, second.sensed_at);
  EXPECT_EQ(told_[1].file, ImageFile::stored);
  EXPECT_EQ(bytes_of(told_[0]), std::vector<std::uint8_t>(kShape.bytes(), 10));
  EXPECT_EQ(bytes_of(told_[1]), std::vector<std::uint8_t>(kShape.bytes(), 20));
  EXPECT_TRUE(losses_.empty());
  ASSERT_EQ(pictures_.size(), 2U);
  EXPECT_EQ(pictures_[1].sensor, 1U);
  EXPECT_EQ(pictures_[1].sensed_at, second.sensed_at);
  EXPECT_EQ(pixels_of(pictures_[1].png), std::vector<std::uint8_t>(kShape.bytes(), 20));
}

// A sensor that was started anew counts from 1 again: the same number is another image.
TEST_F(ImageWatchTest, ASensorThatStartsAnewIsFoundAgain) {
  robot_.record.images = {.budget_mib = 1, .rate_mib_per_s = 100};
  ImageWatch watch(path(""), robot_, folder_);
  for (const std::uint8_t value : {std::uint8_t{10}, std::uint8_t{20}}) {
    camera_.reset();
    serve();
    watch.shown(naming({film(value)}));
    wait_for(watch, value / 10);
    EXPECT_EQ(told_.back().sequence, 1U);
    ASSERT_EQ(told_.back().file, ImageFile::stored) << "it may come later than the policy saw it";
    EXPECT_EQ(bytes_of(told_.back()), std::vector<std::uint8_t>(kShape.bytes(), value));
  }
  watch.finish(sink());
}

// The process that names images is not trusted, nor is what it says of numbers and stamps.
TEST_F(ImageWatchTest, WhatWasNeverPublishedIsToldAndNoMore) {
  robot_.record.images = {.budget_mib = 1, .rate_mib_per_s = 100};
  serve();
  ImageWatch watch(path(""), robot_, folder_);
  PolicyInputSample real = film(10);
  PolicyInputSample later = real, of_another_time = real;
  later.sequence = 99;
  of_another_time.published_at = real.published_at + nanoseconds(1);
  std::vector<PolicyInputSample> all{later, of_another_time, real};
  for (const std::uint32_t stray : {0U, 2U, 3U, UINT32_MAX}) {  // no images, no sensor's, beyond the list
    all.push_back(real);
    all.back().sensor = stray;
  }
  watch.shown(naming(all));
  wait_for(watch, 3);
  watch.finish(sink());
  ASSERT_EQ(told_.size(), 3U);
  EXPECT_EQ(losses_["image unseen"], 2U);
  for (const ShownImage& image : told_) {
    EXPECT_EQ(image.file == ImageFile::stored, image.sequence == 1 && image.published_at == real.published_at);
    EXPECT_EQ(image.sha256.empty(), image.file == ImageFile::unseen);
  }
}

TEST_F(ImageWatchTest, WhatIsOverTheBudgetStaysNamedByItsHash) {
  robot_.record.images = {.budget_mib = 2.5 * 9231 / (1U << 20U), .rate_mib_per_s = 100};
  serve();
  ImageWatch watch(path(""), robot_, folder_);
  for (std::uint8_t value = 1; value <= 4; ++value) {
    watch.shown(naming({film(value)}));
    wait_for(watch, value);
  }
  watch.finish(sink());
  EXPECT_EQ(losses_["image over_budget"], 2U);
  EXPECT_EQ(told_[1].file, ImageFile::stored);
  EXPECT_EQ(told_[3].file, ImageFile::over_budget);
  EXPECT_EQ(pictures_.size(), 2U) << "a disk's budget bounds its pictures too";
  const std::vector<std::byte> pixels(kShape.bytes(), std::byte{4});
  EXPECT_EQ(told_[3].sha256, config::sha256_hex(image_file(kShape, pixels)));
}

TEST_F(ImageWatchTest, WhereNothingIsRecordedNothingIsWatched) {
  robot_.record.policy_inputs = false;
  serve();
  ImageWatch watch(path(""), robot_, folder_);
  watch.shown(naming({film(1)}));
  watch.finish(sink());
  EXPECT_TRUE(told_.empty() && losses_.empty());
}

}  // namespace
}  // namespace takt::monitor

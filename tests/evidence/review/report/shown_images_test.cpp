// SPDX-License-Identifier: Apache-2.0
// Goal: the report's page holds the images that a reviewer looks for, whole, and never more bytes than it may. Method:
// images with known content in a run folder, stops and marks made by hand; libpng reads what is packed.
#include "evidence/review/report/shown_images.hpp"

#include <gtest/gtest.h>
#include <png.h>

#include <filesystem>
#include <random>

#include "config/load.hpp"
#include "monitor/record/image_file.hpp"
#include "monitor/record/image_store.hpp"
#include "monitor/record/png_image.hpp"
#include "tests/monitor/record/virtual_robot.hpp"
#include "tests/support/temporary_folder.hpp"

namespace takt::evidence {
namespace {

using monitor::ShownImage;

constexpr MonoTime kStart{1'000'000'000};

std::vector<std::byte> noise(const config::ImageShape& shape, unsigned seed) {
  std::mt19937 random(seed);
  std::vector<std::byte> pixels(shape.bytes());
  for (std::byte& pixel : pixels) pixel = static_cast<std::byte>(random());
  return pixels;
}

std::vector<std::byte> read_png(const std::string& png, const config::ImageShape& shape) {
  png_image image{};
  image.version = PNG_IMAGE_VERSION;
  EXPECT_NE(png_image_begin_read_from_memory(&image, png.data(), png.size()), 0) << image.message;
  constexpr std::array<png_uint_32, 4> kFormats{PNG_FORMAT_GRAY, PNG_FORMAT_GA, PNG_FORMAT_RGB, PNG_FORMAT_RGBA};
  EXPECT_EQ(image.format, kFormats.at(shape.channels - 1));
  EXPECT_EQ(std::pair(image.height, image.width), std::pair(shape.height, shape.width));
  std::vector<std::byte> pixels(PNG_IMAGE_SIZE(image));
  EXPECT_NE(png_image_finish_read(&image, nullptr, pixels.data(), 0, nullptr), 0) << image.message;
  return pixels;
}

class ShownImagesTest : public test::TemporaryFolder {
 protected:
  ShownImagesTest() : run_{monitor::RunFolder::create(path("run")).value(), {}, monitor::demo_robot()} {
    run_.robot.sensors.push_back({.name = "wrist", .timeout = {}});
    metrics_.start = kStart;
    metrics_.span = seconds(10);
    store_.emplace(run_.folder, config::ImageRecord{.budget_mib = 1000, .rate_mib_per_s = 1e6});
  }
  // Published 5 ms after it was sensed.
  ShownImage kept(std::uint64_t number, Duration published, std::uint32_t sensor = 0,
                  const config::ImageShape& shape = {48, 64, 3}) {
    const std::string file = monitor::image_file(shape, noise(shape, static_cast<unsigned>(number)));
    ShownImage image{.sequence = number,
                     .sensed_at = kStart + published - milliseconds(5),
                     .published_at = kStart + published,
                     .sensor = sensor,
                     .shape = shape,
                     .sha256 = config::sha256_hex(file)};
    image.file = store_->keep(image, file, kStart + published);
    return image;
  }
  [[nodiscard]] std::string file_of(const ShownImage& image) const {
    return run_.folder.images() + "/" + monitor::image_file_name(image.shape, image.sha256);
  }
  [[nodiscard]] std::vector<SeenBySensor> seen(const std::vector<ShownImage>& images,
                                               std::size_t most_bytes = kPictureBytes) const {
    ShownImages shown(run_, metrics_, faults_);
    for (const ShownImage& image : images) shown.image(image);
    return shown.finish(most_bytes);
  }

  monitor::RecordedRun run_;
  monitor::RunMetrics metrics_;
  monitor::FaultSummary faults_;
  std::optional<monitor::ImageStore> store_;
};

TEST_F(ShownImagesTest, AMarkHasTheNewestImageOfEachSensorPixelByPixel) {
  metrics_.marks.push_back({.tick = 1, .at = kStart + milliseconds(1'001)});
  std::vector<ShownImage> images;
  for (std::uint64_t k = 0; k < 40; ++k)
    images.push_back(kept(k, milliseconds(50 * static_cast<std::int64_t>(k) + (k % 2 == 0 ? 0 : 3)), k % 2));
  const auto sensors = seen(images);
  ASSERT_EQ(sensors.size(), 2U);
  EXPECT_EQ(sensors[0].sensor, "target");
  EXPECT_EQ(sensors[1].sensor, "wrist");
  for (std::uint64_t sensor = 0; sensor < 2; ++sensor) {
    EXPECT_EQ(sensors[sensor].shown, 20U);
    const auto number = sensor == 0 ? 20U : 19U;  // published at 1.000 s, at 0.953 s
    const double published_s = (images[number].published_at - kStart).seconds();
    const auto picture = std::ranges::find_if(
        sensors[sensor].pictures, [&](const Picture& one) { return std::abs(one.published_s - published_s) < 1e-9; });
    ASSERT_NE(picture, sensors[sensor].pictures.end());
    EXPECT_NEAR(picture->sensed_s, published_s - 0.005, 1e-9);
    EXPECT_NEAR(picture->until_s.value(), published_s + 0.1, 1e-9);
    EXPECT_EQ(read_png(picture->png, picture->shape), noise(picture->shape, number));
  }
  EXPECT_FALSE(sensors[0].pictures.back().until_s) << "the last one, until the end of the run";
}

TEST_F(ShownImagesTest, ThePageHasNoMoreThanItMayAndTheStopComesFirst) {
  metrics_.incidents.push_back({.at = kStart + seconds(7)});
  std::vector<ShownImage> images;
  for (std::uint64_t k = 0; k < 200; ++k) images.push_back(kept(k, milliseconds(50 * static_cast<std::int64_t>(k))));
  const auto all = seen(images).at(0);
  EXPECT_EQ(all.shown, 200U);
  EXPECT_GE(all.pictures.size(), 30U);
  EXPECT_LE(all.pictures.size(), 31U);
  const std::size_t one = all.pictures[0].png.size();
  const auto few = seen(images, 2 * one + one / 2).at(0);
  ASSERT_EQ(few.pictures.size(), 2U);
  EXPECT_NEAR(few.pictures[0].published_s, 7, 1e-9);
  EXPECT_NEAR(few.pictures[1].published_s, 9.95, 1e-9) << "then the end of the run";
  EXPECT_TRUE(seen(images, 0).at(0).pictures.empty());
}

TEST_F(ShownImagesTest, WhatIsLostOrAlteredOrNoImageIsCountedAndNotShown) {
  std::vector<ShownImage> images;
  for (std::uint64_t k = 0; k < 6; ++k) images.push_back(kept(k, milliseconds(1'000 * static_cast<std::int64_t>(k))));
  std::filesystem::remove(file_of(images[0]));
  std::filesystem::resize_file(file_of(images[1]), std::uintmax_t{64} << 30U);  // sparse: not to be read
  images[2].file = monitor::ImageFile::over_budget;
  images[3].shape = {0, 64, 3};
  images[4].shape = {65'536, 65'536, 4};  // more bytes than 32 bits count
  images[5].shape.channels = 5;
  images.push_back(kept(6, seconds(6)));
  images.push_back(kept(7, seconds(7)));
  images.back().sensor = 99;
  const auto sensors = seen(images);
  ASSERT_EQ(sensors.size(), 1U);
  EXPECT_EQ(sensors[0].shown, 7U);
  EXPECT_EQ(sensors[0].without_file, 1U);
  EXPECT_EQ(sensors[0].unreadable, 5U);
  ASSERT_EQ(sensors[0].pictures.size(), 1U);
  EXPECT_NEAR(sensors[0].pictures[0].published_s, 6, 1e-9);
}

TEST(PngImage, EveryNumberOfChannelsComesBack) {
  for (const std::uint32_t channels : {1U, 2U, 3U, 4U}) {
    for (const config::ImageShape& shape : {config::ImageShape{1, 1, channels}, config::ImageShape{31, 17, channels}}) {
      const auto pixels = noise(shape, channels);
      EXPECT_EQ(read_png(monitor::png_image(shape, pixels), shape), pixels);
    }
  }
  EXPECT_EQ(monitor::png_image({0, 3, 1}, {}), "");
}

}  // namespace
}  // namespace takt::evidence

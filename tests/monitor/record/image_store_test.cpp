// SPDX-License-Identifier: Apache-2.0
// Goal: an image that a policy was shown is a file that all can open and check by its name, once per content, never
// more than the budget, the rate and the disk allow, and what was lost or altered since is told. Method: images of
// every number of channels through the store into a folder of the test's, in time that is passed in; spoilt there.
#include "monitor/record/image_store.hpp"

#include <gtest/gtest.h>

#include <filesystem>
#include <fstream>

#include "config/load.hpp"
#include "monitor/record/bounded_file.hpp"
#include "monitor/record/image_file.hpp"
#include "tests/support/temporary_folder.hpp"

namespace takt::monitor {
namespace {

constexpr double kMib = 1U << 20U;

struct Image {
  ShownImage named;
  std::string content;
  std::vector<std::byte> pixels;
};

Image image_of(std::uint8_t value, const config::ImageShape& shape = {48, 64, 3}) {
  Image image;
  image.pixels.assign(shape.bytes(), std::byte{value});
  image.content = image_file(shape, image.pixels);
  image.named.shape = shape;
  image.named.sha256 = config::sha256_hex(image.content);
  return image;
}

class ImageStoreTest : public test::TemporaryFolder {
 protected:
  ImageFile keep(ImageStore& store, const Image& image, Duration at = {}) const {
    return store.keep(image.named, image.content, MonoTime{} + seconds(5) + at);
  }
  [[nodiscard]] std::size_t files() const {
    std::error_code none;
    const std::filesystem::directory_iterator images(folder_.images(), none);
    return static_cast<std::size_t>(std::distance(begin(images), end(images)));
  }
  RunFolder folder_ = RunFolder::create(path("run")).value();
};

TEST_F(ImageStoreTest, AnImageIsANetpbmFileNamedByItsHashAndComesBack) {
  ImageStore store(folder_, {.budget_mib = 1, .rate_mib_per_s = 1});
  const std::pair<std::uint32_t, std::string> begins[] = {
      {1, "P5\n3 2\n255\n"},
      {2, "P7\nWIDTH 3\nHEIGHT 2\nDEPTH 2\nMAXVAL 255\nTUPLTYPE GRAYSCALE_ALPHA\nENDHDR\n"},
      {3, "P6\n3 2\n255\n"},
      {4, "P7\nWIDTH 3\nHEIGHT 2\nDEPTH 4\nMAXVAL 255\nTUPLTYPE RGB_ALPHA\nENDHDR\n"}};
  for (const auto& [channels, head] : begins) {
    const Image image = image_of(static_cast<std::uint8_t>(channels), {2, 3, channels});
    ASSERT_EQ(keep(store, image), ImageFile::stored);
    const std::string ending = channels == 1 ? ".pgm" : channels == 3 ? ".ppm" : ".pam";
    const std::string path = folder_.path() + "/images/" + image.named.sha256 + ending;
    const auto file = read_file(path);
    ASSERT_TRUE(file) << file.error();
    EXPECT_EQ(file->substr(0, head.size()), head);
    EXPECT_EQ(config::sha256_hex(*file), image.named.sha256);
    const auto back = read_image(folder_, image.named.shape, image.named.sha256);
    ASSERT_TRUE(back) << back.error();
    EXPECT_EQ(*back, std::vector<std::uint8_t>(6 * channels, static_cast<std::uint8_t>(channels)));
  }
  EXPECT_EQ(files(), 4U) << "nothing half-written stays";
  EXPECT_NE(image_of(1, {2, 3, 1}).named.sha256, image_of(1, {3, 2, 1}).named.sha256) << "a shape is part of it";
}

TEST_F(ImageStoreTest, TheSameImageIsKeptOnce) {
  const Image image = image_of(1);
  ImageStore store(folder_, {.budget_mib = static_cast<double>(image.content.size()) / kMib, .rate_mib_per_s = 1});
  for (int i = 0; i < 100; ++i) ASSERT_EQ(keep(store, image), ImageFile::stored) << i;
  EXPECT_EQ(files(), 1U);
  EXPECT_EQ(keep(store, image_of(2)), ImageFile::over_budget) << "the first one filled it";
  EXPECT_EQ(keep(store, image), ImageFile::stored) << "what is there stays there";
}

TEST_F(ImageStoreTest, ABudgetOfNothingMakesNoFolder) {
  ImageStore store(folder_, {.budget_mib = 0, .rate_mib_per_s = 1});
  EXPECT_EQ(keep(store, image_of(1)), ImageFile::over_budget);
  EXPECT_FALSE(std::filesystem::exists(folder_.images()));
}

// Goal: 9 KiB at a time, 20 times a second, with room for half of it: half is kept, whatever the images' size is.
TEST_F(ImageStoreTest, WhatComesTooFastIsLeftOutInTheMean) {
  const double one = static_cast<double>(image_of(1).content.size()) / kMib;
  ImageStore store(folder_, {.budget_mib = 100, .rate_mib_per_s = 10 * one});
  int kept = 0;
  for (int i = 0; i < 200; ++i) {
    const ImageFile file = keep(store, image_of(static_cast<std::uint8_t>(i)), milliseconds(50) * i);
    ASSERT_TRUE(file == ImageFile::stored || file == ImageFile::over_rate) << name(file);
    if (file == ImageFile::stored) ++kept;
  }
  EXPECT_NEAR(kept, 110, 2) << "10 s of 10 each, and what a second's rest allows";
  ImageStore slow(RunFolder::create(path("slow")).value(), {.budget_mib = 100, .rate_mib_per_s = one / 2});
  EXPECT_EQ(keep(slow, image_of(1)), ImageFile::stored) << "larger than a second's worth";
  EXPECT_EQ(keep(slow, image_of(2), seconds(1)), ImageFile::over_rate);
  EXPECT_EQ(keep(slow, image_of(2), seconds(3)), ImageFile::stored);
}

TEST_F(ImageStoreTest, WhatTheDiskDoesNotTakeIsTold) {
  std::ofstream(folder_.images()) << "in the way";
  ImageStore store(folder_, {.budget_mib = 1, .rate_mib_per_s = 1});
  EXPECT_EQ(keep(store, image_of(1)), ImageFile::unwritten);
  std::filesystem::remove(folder_.images());
  EXPECT_EQ(keep(store, image_of(1)), ImageFile::stored) << "asked again, tried again";
}

TEST_F(ImageStoreTest, WhatWasLostOrAlteredSinceIsSaidInOneSentence) {
  ImageStore store(folder_, {.budget_mib = 1, .rate_mib_per_s = 1});
  const Image image = image_of(1);
  ASSERT_EQ(keep(store, image), ImageFile::stored);
  const std::string file = folder_.images() + "/" + image_file_name(image.named.shape, image.named.sha256);
  const auto said = [&] {
    const auto read = read_image(folder_, image.named.shape, image.named.sha256);
    return read ? "it was read" : read.error();
  };
  EXPECT_EQ(said(), "it was read");
  for (const std::string& spoilt :
       {image.content.substr(1), image.content + "x", std::string(image.content.size(), 1)}) {
    std::ofstream(file, std::ios::binary) << spoilt;
    EXPECT_EQ(said(), file + " is not what was recorded: its SHA-256 is another");
  }
  std::filesystem::remove(file);
  EXPECT_EQ(said(), file + " is missing: it was lost since the run");
}

TEST(ImageMessage, ComesBackAndIsCheckedWhereItIsRead) {
  ShownImage image{.sequence = 7,
                   .sensed_at = MonoTime{5},
                   .published_at = MonoTime{6},
                   .sensor = 2,
                   .shape = {48, 64, 3},
                   .file = ImageFile::over_rate,
                   .sha256 = std::string(64, 'a')};
  CdrWriter out;
  ShownImage back;
  encode_image(image, out);
  ASSERT_TRUE(decode_image(out.bytes(), back));
  EXPECT_EQ(back.sequence, 7U);
  EXPECT_EQ(back.sensed_at, MonoTime{5});
  EXPECT_EQ(back.published_at, MonoTime{6});
  EXPECT_EQ(back.sensor, 2U);
  EXPECT_EQ(back.shape.height, 48U);
  EXPECT_EQ(back.shape.width, 64U);
  EXPECT_EQ(back.shape.channels, 3U);
  EXPECT_EQ(back.file, ImageFile::over_rate);
  EXPECT_EQ(back.sha256, image.sha256);
  for (std::size_t size = 0; size < out.bytes().size(); ++size)
    EXPECT_FALSE(decode_image(std::span(out.bytes()).first(size), back)) << size;
  image.file = static_cast<ImageFile>(kImageFileNames.size());
  encode_image(image, out);
  EXPECT_FALSE(decode_image(out.bytes(), back));
  image.file = ImageFile::unseen;
  encode_image(image, out);
  EXPECT_FALSE(decode_image(out.bytes(), back)) << "what was never seen has no hash";
}

}  // namespace
}  // namespace takt::monitor

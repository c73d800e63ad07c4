// SPDX-License-Identifier: Apache-2.0
// /takt/image (takt_msgs/msg/Image): an image that a policy was shown, by the recorder's own copy of what its sensor
// published: whose, when, its SHA-256, and what became of its file. One for each image, however many answers rest on
// it; sensor, sequence and stamps are those of /takt/policy_input's samples. In the file it stands behind the input
// that named it.
#pragma once

#include <array>
#include <cstdint>
#include <span>
#include <string>
#include <string_view>

#include "config/robot_config.hpp"
#include "executive/contract/mono_time.hpp"
#include "monitor/record/cdr.hpp"

namespace takt::monitor {

// What became of an image's bytes. Every other than `stored` is declared as a loss of the ring `image` too.
enum class ImageFile : std::uint8_t {
  unseen,       // the recorder never had this image, or not any more: its hash is not known
  stored,       // in the run folder
  over_budget,  // record.images.budget_mib was spent
  over_rate,    // record.images.rate_mib_per_s was
  behind,       // the disk took them slower than they came
  unwritten     // the disk took it not at all, or is nearly full
};
inline constexpr std::array<std::string_view, 6> kImageFileNames{"unseen",    "stored", "over_budget",
                                                                 "over_rate", "behind", "unwritten"};
constexpr std::string_view name(ImageFile file) {
  return kImageFileNames[static_cast<std::size_t>(file)];
}

struct ShownImage {
  std::uint64_t sequence = 0;
  MonoTime sensed_at, published_at;
  std::uint32_t sensor = 0;  // index into the robot file's sensors
  config::ImageShape shape;
  ImageFile file = ImageFile::unseen;
  std::string sha256;  // of its file (image_file.hpp), 64 hex digits; empty: unseen
};

// A shown image for people's eyes.
struct ShownPicture {
  MonoTime sensed_at;
  std::uint32_t sensor = 0;  // index into the robot file's sensors
  std::string png;           // of the image's own pixels
};

extern const std::string_view kImageSchema;
void encode_image(const ShownImage& image, CdrWriter& out);
bool decode_image(std::span<const std::byte> message, ShownImage& out);

}  // namespace takt::monitor

// SPDX-License-Identifier: Apache-2.0
#include "monitor/record/image_message.hpp"

namespace takt::monitor {

const std::string_view kImageSchema =
    R"(# An image that a policy was shown, as the recorder read it from its sensor.
uint64 sequence               # of the sensor's sample
int64 sensed_at               # ns, CLOCK_MONOTONIC
int64 published_at
uint32 sensor                 # index into the robot file's sensors
uint32 height
uint32 width
uint32 channels
uint8 FILE_UNSEEN=0
uint8 FILE_STORED=1
uint8 FILE_OVER_BUDGET=2
uint8 FILE_OVER_RATE=3
uint8 FILE_BEHIND=4
uint8 FILE_UNWRITTEN=5
uint8 file                    # what became of images/SHA256
string sha256                 # of that file; empty: the recorder never had this image
)";

void encode_image(const ShownImage& image, CdrWriter& out) {
  out.clear();
  out.put(image.sequence);
  out.put(image.sensed_at.ns);
  out.put(image.published_at.ns);
  out.put(image.sensor);
  out.put(image.shape.height);
  out.put(image.shape.width);
  out.put(image.shape.channels);
  out.put(static_cast<std::uint8_t>(image.file));
  out.put_string(image.sha256);
}

bool decode_image(std::span<const std::byte> message, ShownImage& out) {
  CdrReader reader(message);
  out.sequence = reader.get<std::uint64_t>();
  out.sensed_at.ns = reader.get<std::int64_t>();
  out.published_at.ns = reader.get<std::int64_t>();
  out.sensor = reader.get<std::uint32_t>();
  out.shape.height = reader.get<std::uint32_t>();
  out.shape.width = reader.get<std::uint32_t>();
  out.shape.channels = reader.get<std::uint32_t>();
  const auto file = reader.get<std::uint8_t>();
  out.sha256 = reader.get_string();
  if (!reader.ok() || file >= kImageFileNames.size()) return false;
  out.file = static_cast<ImageFile>(file);
  return out.sha256.size() == (out.file == ImageFile::unseen ? 0 : 64);
}

}  // namespace takt::monitor

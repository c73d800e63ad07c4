// SPDX-License-Identifier: Apache-2.0
#include "monitor/record/image_file.hpp"

#include <fmt/format.h>

#include <filesystem>

#include "config/load.hpp"
#include "monitor/record/bounded_file.hpp"

namespace takt::monitor {
namespace {

std::string head_of(const config::ImageShape& shape) {
  switch (shape.channels) {
    case 1:
      return fmt::format("P5\n{} {}\n255\n", shape.width, shape.height);
    case 3:
      return fmt::format("P6\n{} {}\n255\n", shape.width, shape.height);
    default:
      return fmt::format("P7\nWIDTH {}\nHEIGHT {}\nDEPTH {}\nMAXVAL 255\nTUPLTYPE {}_ALPHA\nENDHDR\n", shape.width,
                         shape.height, shape.channels, shape.channels == 2 ? "GRAYSCALE" : "RGB");
  }
}

}  // namespace

std::string image_file(const config::ImageShape& shape, std::span<const std::byte> pixels) {
  std::string file = head_of(shape);
  file.append(reinterpret_cast<const char*>(pixels.data()), pixels.size());
  return file;
}

std::string image_file_name(const config::ImageShape& shape, const std::string& sha256) {
  return sha256 + (shape.channels == 1 ? ".pgm" : shape.channels == 3 ? ".ppm" : ".pam");
}

std::expected<std::vector<std::uint8_t>, std::string> read_image(const RunFolder& folder,
                                                                 const config::ImageShape& shape,
                                                                 const std::string& sha256) {
  const std::string path = folder.images() + "/" + image_file_name(shape, sha256);
  const std::string other = path + " is not what was recorded: its SHA-256 is another";
  std::error_code error;
  if (!std::filesystem::exists(path, error)) return std::unexpected(path + " is missing: it was lost since the run");
  const std::string head = head_of(shape);
  // A stranger's file may be of any size.
  if (std::filesystem::file_size(path, error) != head.size() + shape.bytes()) return std::unexpected(other);
  const auto file = read_file(path);
  if (!file) return std::unexpected(file.error());
  if (config::sha256_hex(*file) != sha256 || !file->starts_with(head) || file->size() != head.size() + shape.bytes())
    return std::unexpected(other);
  return std::vector<std::uint8_t>(file->begin() + static_cast<std::ptrdiff_t>(head.size()), file->end());
}

}  // namespace takt::monitor

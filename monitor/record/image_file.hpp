// SPDX-License-Identifier: Apache-2.0
// An image as a file: Netpbm, so that any viewer opens it. A short text with its shape, then its bytes as they were
// published: PGM (P5) of one channel, PPM (P6) of three, PAM (P7) of two or four. The file's name is the SHA-256 of all
// of it, so that `sha256sum` checks it, and images of another shape have another name.
//
// Errors are one sentence.
#pragma once

#include <cstddef>
#include <cstdint>
#include <expected>
#include <span>
#include <string>
#include <vector>

#include "config/robot_config.hpp"
#include "monitor/record/run_folder.hpp"

namespace takt::monitor {

// Precondition: `pixels` are shape.bytes(), 1 to 4 channels.
std::string image_file(const config::ImageShape& shape, std::span<const std::byte> pixels);
// "<sha256>.ppm"
std::string image_file_name(const config::ImageShape& shape, const std::string& sha256);

// The bytes of the image in this run folder; that it is missing, cut or altered is the error.
std::expected<std::vector<std::uint8_t>, std::string> read_image(const RunFolder& folder,
                                                                 const config::ImageShape& shape,
                                                                 const std::string& sha256);

}  // namespace takt::monitor

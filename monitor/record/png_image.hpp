// SPDX-License-Identifier: Apache-2.0
// An image of bytes as a PNG of 8 bits a channel: grey, grey and alpha, RGB, RGBA. Thread rule: any thread.
// Source: libpng 1.6.
#pragma once

#include <cstddef>
#include <span>
#include <string>

#include "config/robot_config.hpp"

namespace takt::monitor {

// Made for speed, not for the smallest file. Empty: libpng took no such shape. Precondition: `pixels` are
// shape.bytes(), row by row.
std::string png_image(const config::ImageShape& shape, std::span<const std::byte> pixels);

}  // namespace takt::monitor

// SPDX-License-Identifier: Apache-2.0
// What an outside sensor has sensed: a sample of numbers, or of images the stamps of one and what is in it.
#pragma once

#include <cstdint>
#include <memory>
#include <vector>

#include "executive/contract/sensor_sample.hpp"

namespace takt::simulation {

// Row after row, the channels of a pixel together; of the shape that the robot file declares. Copies share it.
using Pixels = std::shared_ptr<const std::vector<std::uint8_t>>;

struct Sensed {
  SensorSample sample;  // of images: without values
  Pixels pixels{};      // null: the sensor has numbers
};

}  // namespace takt::simulation

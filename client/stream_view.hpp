// SPDX-License-Identifier: Apache-2.0
// A sensor of the robot file as takt/client.h shows it; points into it.
#pragma once

#include "client/takt/client.h"
#include "config/robot_config.hpp"

namespace takt::client {

inline takt_stream view_of(const config::Sensor& sensor) {
  const config::ImageShape shape = sensor.image.value_or(config::ImageShape{});
  return {.name = sensor.name.c_str(),
          .unit = sensor.unit.c_str(),
          .timeout_ns = sensor.timeout.ns,
          .type = sensor.image ? TAKT_UINT8 : TAKT_FLOAT32,
          .values = sensor.image ? shape.bytes() : sensor.values,
          .height = shape.height,
          .width = shape.width,
          .channels = shape.channels,
          .reserved = 0};
}

}  // namespace takt::client

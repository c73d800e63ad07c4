// SPDX-License-Identifier: Apache-2.0
// What every bus implementation is told when it is opened.
#pragma once

#include <cstdint>
#include <optional>
#include <string>
#include <vector>

#include "config/drive_ids.hpp"

namespace takt::drivers {

struct BusOptions {
  std::string interface;
  bool fd = false;
  // Ids wanted; an empty list: no frame at all; no list: every frame. Others are never seen: SocketCAN filters in the
  // kernel, the loopback bus on receive.
  std::optional<std::vector<config::IdPattern>> receive{};
};

}  // namespace takt::drivers

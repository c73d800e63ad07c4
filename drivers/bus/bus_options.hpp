// What every bus implementation is told when it is opened.
#pragma once

#include <cstdint>
#include <string>
#include <vector>

#include "config/drive_ids.hpp"

namespace takt::drivers {

struct BusOptions {
  std::string interface;
  bool fd = false;
  // Ids wanted; empty: every frame. Others are never seen: SocketCAN filters in the kernel, the loopback bus on
  // receive.
  std::vector<config::IdPattern> receive;
};

}  // namespace takt::drivers

// What every bus implementation is told when it is opened.
#pragma once

#include <cstdint>
#include <string>
#include <vector>

namespace takt::drivers {

struct BusOptions {
  std::string interface;
  bool fd = false;
  // Standard ids wanted; empty: every frame. SocketCAN filters in the kernel, so that others are never seen; the
  // loopback bus filters on receive and counts them as foreign.
  std::vector<std::uint32_t> receive_ids;
};

}  // namespace takt::drivers

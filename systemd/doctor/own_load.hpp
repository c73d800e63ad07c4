// SPDX-License-Identifier: Apache-2.0
// A load for the time of a measurement: one thread per core, the control core's apart, that copies memory beyond the
// caches' size, and one that writes and syncs a file. Ordinary priority; ends with the object. What a robot's own
// programs do beside it is better still. Thread rule: one thread.
#pragma once

#include <optional>
#include <string>
#include <thread>
#include <vector>

namespace takt::doctor {

class OwnLoad {
 public:
  // `folder`: where the file is written, at most 16 MiB, removed at the end; where it cannot be, only memory is loaded.
  // `spared`: the core that is left alone.
  OwnLoad(const std::string& folder, std::optional<int> spared);

 private:
  std::vector<std::jthread> threads_;
};

}  // namespace takt::doctor

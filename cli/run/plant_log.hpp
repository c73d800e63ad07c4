// SPDX-License-Identifier: Apache-2.0
// What takt-plant says in its log of the scenario that it plays: each fault as it begins and as it ends, with the
// plant's own instant. Thread rule: one thread.
#pragma once

#include <string>
#include <vector>

#include "executive/contract/mono_time.hpp"

namespace takt::cli {

class PlantLog {
 public:
  // May be there later.
  explicit PlantLog(std::string path) : path_(std::move(path)) {}

  struct Line {
    MonoTime at;
    std::string what;  // "elbow: silent for 200 ms", "elbow: end of silent for 200 ms"
  };
  // Those since the last call.
  std::vector<Line> news();

 private:
  std::string path_;
  std::size_t read_ = 0;  // bytes
};

}  // namespace takt::cli

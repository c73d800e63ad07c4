// SPDX-License-Identifier: Apache-2.0
// The images of a run folder: one file per hash, within a budget of bytes and a rate, and never the last of the disk,
// which the ticks need. What does not go in is told by the return value; nothing throws, nothing retries.
//
// Files are whole or not there, but are not brought to the medium one by one: a power cut may take those of the last
// half minute. Thread rule: one thread; keep() waits for the file system.
#pragma once

#include <cstdint>
#include <set>
#include <string>

#include "config/robot_config.hpp"
#include "monitor/record/byte_allowance.hpp"
#include "monitor/record/image_message.hpp"
#include "monitor/record/run_folder.hpp"

namespace takt::monitor {

class ImageStore {
 public:
  ImageStore(const RunFolder& folder, const config::ImageRecord& limits);
  // `content`: image_file() of the image with this hash. `now`: for the rate, never backwards. Of a hash that was kept
  // before nothing is written again, and nothing counts.
  ImageFile keep(const ShownImage& image, const std::string& content, MonoTime now);

 private:
  [[nodiscard]] ImageFile write(const std::string& name, const std::string& content);
  [[nodiscard]] bool has_room(std::size_t bytes) const;

  std::string directory_, run_;
  config::ImageRecord limits_;
  std::set<std::string> kept_;  // names
  std::uint64_t written_ = 0;   // bytes
  ByteAllowance allowance_;
};

}  // namespace takt::monitor

// SPDX-License-Identifier: Apache-2.0
// SHA-256 of a file that grows, in segments: each begins where the one before ended, so that who finds an altered byte
// can say when it was recorded. Thread rule: one thread.
#pragma once

#include <cstddef>
#include <cstdint>
#include <span>
#include <string>
#include <vector>

#include "config/sha256.hpp"

namespace takt::monitor {

struct SealedSegment {
  std::uint64_t bytes = 0;
  std::int64_t until_unix_ns = 0;  // when it was closed
  std::string sha256;              // of these bytes, 64 hexadecimal digits
};

class SegmentSeal {
 public:
  void add(std::span<const std::byte> piece);
  // The open segment ends here, if there is anything in it.
  void close(std::int64_t until_unix_ns);
  // The file at `path` was cut back to `size` bytes, which are at least those of the closed segments: what is left of
  // the open one is read again.
  void cut_back(const std::string& path, std::uint64_t size);
  [[nodiscard]] const std::vector<SealedSegment>& closed() const { return closed_; }

 private:
  config::Sha256 sha_;
  std::uint64_t closed_bytes_ = 0, open_bytes_ = 0;
  std::vector<SealedSegment> closed_;
};

}  // namespace takt::monitor

// SPDX-License-Identifier: Apache-2.0
// A file of holes claims bytes that its medium does not hold, and costs its reader time or memory for them.
#pragma once

#include <fcntl.h>
#include <sys/stat.h>
#include <unistd.h>

#include <cerrno>
#include <cstdint>
#include <string>

#include "executive/ipc/descriptor.hpp"

namespace takt::monitor {

// `entry`: of the regular file at `path`. 64 MiB may be holes; beyond, the medium holds a part. A file system that
// compresses makes that smaller, and one that counts no blocks is asked for data.
inline bool is_mostly_holes(const std::string& path, const struct stat& entry) {
  constexpr std::uint64_t kUnpaid = 64U << 20U, kLargestRatio = 64, kBlock = 512;
  const auto size = static_cast<std::uint64_t>(entry.st_size);
  if (size <= kUnpaid) return false;
  if (entry.st_blocks > 0) return size > kLargestRatio * kBlock * static_cast<std::uint64_t>(entry.st_blocks);
  const ipc::Descriptor file(::open(path.c_str(), O_RDONLY | O_NONBLOCK | O_CLOEXEC));
  return ::lseek(file.get(), 0, SEEK_DATA) < 0 && errno == ENXIO;
}

}  // namespace takt::monitor

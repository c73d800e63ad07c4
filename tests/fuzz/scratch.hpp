// SPDX-License-Identifier: Apache-2.0
// Where a target keeps the files and sockets that its readers open by name: in memory, gone at the end.
#pragma once

#include <fcntl.h>
#include <stdlib.h>
#include <unistd.h>

#include <cstdint>
#include <filesystem>
#include <span>
#include <string>
#include <system_error>

#include "tests/fuzz/source.hpp"

namespace takt::fuzz {

inline const std::string& scratch_folder() {
  static const std::string folder = [] {
    std::string path = "/dev/shm/takt-fuzz-XXXXXX";
    require(::mkdtemp(path.data()) != nullptr);
    return path;
  }();
  static const bool is_removed = [] {
    return std::atexit([] {
             std::error_code ignored;
             std::filesystem::remove_all(scratch_folder(), ignored);
           }) == 0;
  }();
  require(is_removed);
  return folder;
}

inline void write_file(const std::string& path, std::span<const std::uint8_t> content) {
  const int file = ::open(path.c_str(), O_WRONLY | O_CREAT | O_TRUNC | O_CLOEXEC, 0600);
  require(file >= 0 && ::write(file, content.data(), content.size()) == static_cast<ssize_t>(content.size()));
  ::close(file);
}

}  // namespace takt::fuzz

// SPDX-License-Identifier: Apache-2.0
// What a file holds, for tests that compare it.
#pragma once

#include <filesystem>
#include <fstream>
#include <iterator>
#include <string>

namespace takt::test {

// Every byte of the file; empty: there is none, or it cannot be read.
inline std::string text_of(const std::filesystem::path& path) {
  std::ifstream file(path, std::ios::binary);
  return {std::istreambuf_iterator<char>(file), {}};
}

}  // namespace takt::test

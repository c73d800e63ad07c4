// SPDX-License-Identifier: Apache-2.0
// The real `takt` for tests, in a directory that goes away with the test.
#pragma once

#include <gtest/gtest.h>
#include <sys/wait.h>

#include <array>
#include <cstdio>
#include <string>

#include "tests/support/temporary_directory.hpp"

namespace takt::cli::test {

struct Ended {
  int exit_code = -1;
  std::string output;  // stdout and stderr together
};

class Shell : public testing::Test {
 protected:
  static Ended shell(const std::string& command) {
    FILE* pipe = popen((command + " 2>&1").c_str(), "r");
    if (!pipe) return {};
    Ended ended;
    std::array<char, 4096> buffer{};
    while (const std::size_t got = fread(buffer.data(), 1, buffer.size(), pipe))
      ended.output.append(buffer.data(), got);
    ended.exit_code = WEXITSTATUS(pclose(pipe));
    return ended;
  }
  static Ended takt(const std::string& arguments) { return shell(std::string(TAKT_BIN_DIR) + "/takt " + arguments); }
  [[nodiscard]] std::string in(const std::string& name) const { return directory_.path(name); }
  [[nodiscard]] const std::string& directory() const { return directory_.path(); }

 private:
  const takt::test::TemporaryDirectory directory_;
};

}  // namespace takt::cli::test

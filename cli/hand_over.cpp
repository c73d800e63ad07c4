// SPDX-License-Identifier: Apache-2.0
#include "cli/hand_over.hpp"

#include <unistd.h>

#include <cerrno>
#include <cstdio>
#include <cstring>
#include <filesystem>
#include <string_view>

#include "cli/command.hpp"

namespace takt::cli {

int hand_over(const char* program, char** argv) {
  std::error_code error;
  const auto path = std::filesystem::read_symlink("/proc/self/exe", error).parent_path() / program;
  execv(path.c_str(), argv);
  const int why = errno;
  if (why == ENOENT && std::string_view(program) == kLabProgram)
    std::fprintf(stderr, "takt: this command is in the package takt-lab, and %s is not there: install takt-lab\n",
                 path.c_str());
  else
    std::fprintf(stderr, "takt: %s cannot be started: %s; it comes with takt: install that again\n", path.c_str(),
                 std::strerror(why));
  return kExitUnavailable;
}

}  // namespace takt::cli

// SPDX-License-Identifier: Apache-2.0
#include "cli/run/external_tool.hpp"

#include <fcntl.h>
#include <sys/wait.h>
#include <unistd.h>

#include <array>
#include <cerrno>
#include <cstring>
#include <utility>

namespace takt::cli {
namespace {

[[noreturn]] void become(char* const* argv, int output) {
  const int null = open("/dev/null", O_RDONLY | O_CLOEXEC);
  if (null < 0) _exit(1);
  dup2(null, STDIN_FILENO);
  dup2(output, STDOUT_FILENO);
  dup2(output, STDERR_FILENO);
  execvp(argv[0], argv);
  _exit(errno == ENOENT ? kToolMissing : 126);
}

}  // namespace

std::string read_all(int descriptor) {
  std::string all;
  std::array<char, 4096> part{};
  while (true) {
    const ssize_t size = read(descriptor, part.data(), part.size());
    if (size > 0) all.append(part.data(), static_cast<std::size_t>(size));
    if (size == 0 || (size < 0 && errno != EINTR)) return all;
  }
}

ToolResult run_tool(std::vector<std::string> arguments) {
  std::vector<char*> argv;
  for (std::string& argument : arguments) argv.push_back(argument.data());
  argv.push_back(nullptr);
  std::array<int, 2> ends{};
  if (pipe2(ends.data(), O_CLOEXEC) != 0) return {1, std::strerror(errno)};
  const pid_t pid = fork();
  if (pid == 0) become(argv.data(), ends[1]);
  close(ends[1]);
  ToolResult result;
  if (pid < 0) {
    result = {1, std::strerror(errno)};
  } else {
    result.output = read_all(ends[0]);
    int status = 0;
    while (waitpid(pid, &status, 0) < 0 && errno == EINTR) {
    }
    result.exit_code = WIFEXITED(status) ? WEXITSTATUS(status) : 128 + WTERMSIG(status);
  }
  close(ends[0]);
  return result;
}

}  // namespace takt::cli

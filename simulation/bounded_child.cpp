// SPDX-License-Identifier: Apache-2.0
#include "simulation/bounded_child.hpp"

#include <fcntl.h>
#include <fmt/format.h>
#include <poll.h>
#include <signal.h>
#include <sys/prctl.h>
#include <sys/resource.h>
#include <sys/wait.h>
#include <unistd.h>

#include <array>
#include <cerrno>
#include <chrono>
#include <cstdio>
#include <cstring>
#include <exception>
#include <fstream>
#include <new>
#include <string_view>

#include "executive/ipc/unix_socket.hpp"

namespace takt::simulation {
namespace {

using Clock = std::chrono::steady_clock;

constexpr int kDone = 0, kRefused = 1;
constexpr std::size_t kLongestSentence = 4096;

#if defined(__SANITIZE_ADDRESS__) || defined(__SANITIZE_THREAD__)
constexpr bool kBoundsMemory = false;  // a sanitizer's shadow is counted
#elif defined(__has_feature)
#if __has_feature(address_sanitizer) || __has_feature(thread_sanitizer) || __has_feature(memory_sanitizer)
constexpr bool kBoundsMemory = false;
#else
constexpr bool kBoundsMemory = true;
#endif
#else
constexpr bool kBoundsMemory = true;
#endif

std::size_t held_bytes() {
  std::size_t pages = 0;
  std::ifstream("/proc/self/statm") >> pages;
  return pages * static_cast<std::size_t>(::sysconf(_SC_PAGESIZE));
}

void limit(__rlimit_resource resource, rlim_t most, rlim_t hard) {
  const rlimit both{most, hard};
  ::setrlimit(resource, &both);
}

void set_bounds(const ChildBounds& bounds) {
  const auto time = static_cast<rlim_t>(bounds.processor_time.ns / 1'000'000'000);
  limit(RLIMIT_CPU, time, time + 1);
  limit(RLIMIT_CORE, 0, 0);
  limit(RLIMIT_FSIZE, bounds.bytes, bounds.bytes);
  if (kBoundsMemory) limit(RLIMIT_AS, held_bytes() + bounds.bytes, held_bytes() + bounds.bytes);
}

// A program may have its own ways with these; a child that is ended by one of them is just ended.
void forget_signal_handlers() {
  for (const int each : {SIGSEGV, SIGBUS, SIGFPE, SIGILL, SIGABRT, SIGXCPU, SIGXFSZ, SIGTERM, SIGINT})
    ::signal(each, SIG_DFL);
}

[[noreturn]] void run(const std::function<std::expected<void, std::string>()>& work, const ChildBounds& bounds, int to,
                      pid_t parent) {
  ::prctl(PR_SET_PDEATHSIG, SIGKILL);
  if (::getppid() != parent) ::_exit(kRefused);
  forget_signal_handlers();
  set_bounds(bounds);
  std::string sentence;
  try {
    const auto done = work();
    if (done) ::_exit(kDone);
    sentence = done.error();
  } catch (const std::bad_alloc&) {
    sentence = fmt::format("needs more than {} MiB of memory", bounds.bytes >> 20U);
  } catch (const std::exception& error) {
    sentence = error.what();
  }
  sentence.resize(std::min(sentence.size(), kLongestSentence));  // one write into an empty pipe
  ::_exit(::write(to, sentence.data(), sentence.size()) < 0 ? kDone + 2 : kRefused);
}

std::string ended_by(int status, const ChildBounds& bounds) {
  const int signal = WIFSIGNALED(status) ? WTERMSIG(status) : 0;
  if (signal == SIGXCPU || signal == SIGKILL)
    return fmt::format("takes more than {} s of processor time", bounds.processor_time.ns / 1'000'000'000);
  if (signal == SIGXFSZ) return fmt::format("makes a file of more than {} MiB", bounds.bytes >> 20U);
  if (signal == 0) return fmt::format("ended its reader (exit code {})", WEXITSTATUS(status));
  const char* const name = ::sigabbrev_np(signal);
  return fmt::format("ended its reader (SIG{}), as too little memory or a fault of the library does",
                     name != nullptr ? name : "?");
}

// What came through the pipe until its other end was closed; nothing: it took too long.
std::expected<std::string, Duration> read_until_closed(int from, Duration longest) {
  const auto end = Clock::now() + std::chrono::nanoseconds(longest.ns);
  std::string said;
  std::array<char, kLongestSentence> bytes{};
  while (true) {
    const auto left = std::chrono::duration_cast<std::chrono::milliseconds>(end - Clock::now()).count();
    pollfd entry{from, POLLIN, 0};
    const int ready = left <= 0 ? 0 : ::poll(&entry, 1, static_cast<int>(left));
    if (ready == 0) return std::unexpected(longest);
    if (ready < 0 && errno == EINTR) continue;
    const ssize_t count = ::read(from, bytes.data(), bytes.size());
    if (count < 0 && errno == EINTR) continue;
    if (count <= 0) return said;
    said.append(bytes.data(), static_cast<std::size_t>(count));
  }
}

}  // namespace

std::expected<void, std::string> in_bounded_child(const std::function<std::expected<void, std::string>()>& work,
                                                  const ChildBounds& bounds) {
  std::array<int, 2> ends{};
  if (::pipe2(ends.data(), O_CLOEXEC) != 0) return std::unexpected("no pipe for its reader: " + ipc::errno_text());
  std::fflush(nullptr);
  const pid_t parent = ::getpid();
  const pid_t child = ::fork();
  if (child == 0) run(work, bounds, ends[1], parent);
  const std::string no_child = child < 0 ? "no process for its reader: " + ipc::errno_text() : "";
  ::close(ends[1]);
  const auto said = read_until_closed(ends[0], bounds.longest);
  ::close(ends[0]);
  if (child < 0) return std::unexpected(no_child);
  if (!said) ::kill(child, SIGKILL);
  int status = 0;
  while (::waitpid(child, &status, 0) < 0 && errno == EINTR) {
  }
  if (!said) return std::unexpected(fmt::format("takes more than {} s", bounds.longest.ns / 1'000'000'000));
  if (WIFEXITED(status) && WEXITSTATUS(status) == kDone) return {};
  if (!said->empty()) return std::unexpected(*said);
  return std::unexpected(ended_by(status, bounds));
}

}  // namespace takt::simulation

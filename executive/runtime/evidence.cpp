// SPDX-License-Identifier: Apache-2.0
#include "executive/runtime/evidence.hpp"

#include <fcntl.h>
#include <sys/resource.h>
#include <unistd.h>

#include <cerrno>
#include <charconv>
#include <ctime>
#include <system_error>

namespace takt::runtime {
namespace {

constexpr const char* kSchedstat = "/proc/thread-self/schedstat";

// Second of the three numbers in the file: "cpu_ns run_delay_ns timeslices". Zero when it cannot be read.
Duration parse_run_delay(const char* begin, const char* end) noexcept {
  while (begin != end && *begin != ' ') ++begin;
  if (begin == end) return {};
  Duration delay;
  std::from_chars(begin + 1, end, delay.ns);
  return delay;
}

}  // namespace

std::expected<EvidenceSource, std::string> EvidenceSource::open() {
  ipc::Descriptor file(::open(kSchedstat, O_RDONLY | O_CLOEXEC));
  if (!file.is_open()) {
    return std::unexpected(std::string(kSchedstat) + ": " + std::generic_category().message(errno) +
                           ": mount /proc, and use a kernel with CONFIG_SCHED_INFO");
  }
  return EvidenceSource(std::move(file));
}

Evidence EvidenceSource::read() const noexcept {
  Evidence evidence;
  if (!schedstat_.is_open()) return evidence;
  timespec cpu{};
  clock_gettime(CLOCK_THREAD_CPUTIME_ID, &cpu);
  evidence.cpu = seconds(cpu.tv_sec) + nanoseconds(cpu.tv_nsec);
  char text[96];
  if (const ssize_t size = pread(schedstat_.get(), text, sizeof text, 0); size > 0) {
    evidence.run_delay = parse_run_delay(text, text + size);
  }
  rusage usage{};
  getrusage(RUSAGE_THREAD, &usage);
  evidence.voluntary_switches = usage.ru_nvcsw;
  evidence.minor_faults = usage.ru_minflt;
  evidence.major_faults = usage.ru_majflt;
  return evidence;
}

}  // namespace takt::runtime

// SPDX-License-Identifier: Apache-2.0
// What the kernel knows about the control thread: read once per tick, after the bus write, so that a missed period can
// be attributed to its cause (overrun.hpp). Cumulative since the thread began; the attribution works on differences.
//
// Sources: /proc/thread-self/schedstat (time spent runnable but not running; needs CONFIG_SCHED_INFO, on in Debian),
// getrusage(RUSAGE_THREAD), CLOCK_THREAD_CPUTIME_ID. Together 2..3 us when paced at 1 kHz.
#pragma once

#include <cstdint>
#include <expected>
#include <string>

#include "executive/contract/mono_time.hpp"
#include "executive/ipc/descriptor.hpp"

namespace takt::runtime {

struct Evidence {
  Duration cpu;        // executed; without time stolen by a hypervisor where the guest kernel is told about it
  Duration run_delay;  // runnable, but another task had the core
  std::int64_t voluntary_switches = 0;
  std::int64_t minor_faults = 0;
  std::int64_t major_faults = 0;
  friend Evidence operator-(const Evidence& a, const Evidence& b) {
    return {a.cpu - b.cpu, a.run_delay - b.run_delay, a.voluntary_switches - b.voluntary_switches,
            a.minor_faults - b.minor_faults, a.major_faults - b.major_faults};
  }
};

class EvidenceSource {
 public:
  // For the calling thread, which must also be the one that reads. Opens a file: before the loop.
  static std::expected<EvidenceSource, std::string> open();
  // Of a thread in virtual time, of which the kernel knows nothing that belongs there: reads as zero.
  static EvidenceSource none() { return EvidenceSource({}); }
  // No allocation or lock. System calls: clock_gettime, pread64, getrusage.
  [[nodiscard]] Evidence read() const noexcept;

 private:
  explicit EvidenceSource(ipc::Descriptor schedstat) : schedstat_(std::move(schedstat)) {}
  ipc::Descriptor schedstat_;
};

}  // namespace takt::runtime

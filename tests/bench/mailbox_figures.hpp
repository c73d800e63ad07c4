// SPDX-License-Identifier: Apache-2.0
// The single figures of the mailbox benchmark, each measured once per call; times in ns. `cpus`: writer, reader.
#pragma once

#include <cstddef>
#include <cstdint>

namespace takt::bench {

using TwoCpus = int[2];

struct Spread {
  double p50 = 0;
  double p99 = 0;
};

// One cache line passed to the other core: half of a ping-pong.
double line_transfer(const TwoCpus& cpus);

struct Observed {
  Spread latency;  // just before publish() until the reader holds the whole payload
  std::uint64_t torn = 0;
};
Observed publish_to_observe(const TwoCpus& cpus, std::size_t bytes);

struct HammeredRead {
  Spread latency;
  int worst_tries = 0;
  std::uint64_t gave_up = 0;  // reads that ended contended: "no new command this tick"
  std::uint64_t torn = 0;
  std::uint64_t reads = 0;
};
// 512-byte reads beside a writer that publishes without a pause.
HammeredRead hammered_read(const TwoCpus& cpus);

struct SameCore {
  Spread write;
  Spread read;
};
// 512-byte publish and read by one thread, nothing contended, caches hot.
SameCore uncontended(int cpu);

// One 12-joint tick record pushed every millisecond.
Spread record_push(int cpu);

// How many of `rounds` writers killed with SIGKILL left a complete payload to a reader.
int readable_after_kill(const TwoCpus& cpus, int rounds);

}  // namespace takt::bench

// SPDX-License-Identifier: Apache-2.0
#include "tests/bench/mailbox_figures.hpp"

#include <array>
#include <atomic>
#include <cstring>
#include <random>
#include <span>

#include "executive/ipc/executive_segments.hpp"
#include "executive/ipc/ring_layout.hpp"
#include "tests/bench/bench.hpp"

namespace takt::bench {
namespace {

constexpr int kLineRounds = 30'000;
constexpr int kObservations = 4'000;
constexpr int kHammeredReads = 30'000;
constexpr int kRecords = 600;

struct SharedRing {
  alignas(64) std::array<std::byte, 16384> memory{};
};

struct Signals {
  alignas(64) std::atomic<std::uint64_t> line{0};
  alignas(64) std::atomic<bool> ready{false};
  alignas(64) std::atomic<bool> stop{false};
  alignas(64) std::atomic<std::uint64_t> seen{0};
};

double ns_between(std::int64_t begin, std::int64_t end) {
  return static_cast<double>(end - begin) * ns_per_tick();
}

Spread spread_of(const std::vector<double>& samples) {
  return {percentile(samples, 0.5), percentile(samples, 0.99)};
}

// Payload: number, publication ticks, then words that depend on the number.
class Payload {
 public:
  explicit Payload(std::size_t bytes) : words_(bytes / 8) {}
  void fill(std::uint64_t number) {
    words_[0] = number;
    for (std::size_t i = 2; i < words_.size(); ++i) words_[i] = number * 0x9E37'79B9'7F4A'7C15ULL + i;
  }
  void stamp() { words_[1] = static_cast<std::uint64_t>(ticks()); }
  [[nodiscard]] std::int64_t stamped() const { return static_cast<std::int64_t>(words_[1]); }
  [[nodiscard]] bool is_whole(std::uint64_t number) const {
    if (words_[0] != number) return false;
    for (std::size_t i = 2; i < words_.size(); ++i) {
      if (words_[i] != number * 0x9E37'79B9'7F4A'7C15ULL + i) return false;
    }
    return true;
  }
  std::span<std::byte> bytes() { return std::as_writable_bytes(std::span(words_)); }

 private:
  std::vector<std::uint64_t> words_;
};

ipc::RingShape shape_of(std::size_t bytes) {
  return {ipc::kMailboxSlots, static_cast<std::uint32_t>(bytes), 1};
}

ipc::SlotReader attach(const SharedRing& ring, const ipc::RingShape& shape) {
  auto reader = ipc::SlotReader::attach(ring.memory, shape);
  if (!reader) throw std::runtime_error(reader.error());
  return *reader;
}

void wait_until(const std::atomic<bool>& flag) {
  while (!flag.load()) usleep(200);
}

}  // namespace

double line_transfer(const TwoCpus& cpus) {
  const Shared<Signals> shared;
  ChildProcess other([&] {
    const Pinned pinned(cpus[0]);
    shared->ready.store(true);
    for (std::uint64_t i = 0; i < kLineRounds; ++i) {
      while (shared->line.load(std::memory_order_acquire) != 2 * i + 1) {
      }
      shared->line.store(2 * i + 2, std::memory_order_release);
    }
  });
  wait_until(shared->ready);
  const Pinned pinned(cpus[1]);
  std::vector<double> halves;
  halves.reserve(kLineRounds);
  for (std::uint64_t i = 0; i < kLineRounds; ++i) {
    const std::int64_t begin = ticks();
    shared->line.store(2 * i + 1, std::memory_order_release);
    while (shared->line.load(std::memory_order_acquire) != 2 * i + 2) {
    }
    halves.push_back(0.5 * ns_between(begin, ticks()));
  }
  return median(halves);
}

Observed publish_to_observe(const TwoCpus& cpus, std::size_t bytes) {
  const ipc::RingShape shape = shape_of(bytes);
  const Shared<SharedRing> ring;
  const Shared<Signals> shared;
  ipc::SlotWriter writer(ring->memory, shape);
  ipc::SlotReader reader = attach(*ring, shape);
  ChildProcess publisher([&] {
    const Pinned pinned(cpus[0]);
    std::minstd_rand random(1);
    Payload payload(bytes);
    shared->ready.store(true);
    for (std::uint64_t number = 1; number <= kObservations; ++number) {
      payload.fill(number);
      spin_ns(2000.0 + static_cast<double>(random() % 4096));
      payload.stamp();
      writer.publish(payload.bytes());
      while (shared->seen.load(std::memory_order_acquire) != number) {
      }
    }
  });
  wait_until(shared->ready);
  const Pinned pinned(cpus[1]);
  Observed result;
  std::vector<double> latencies;
  Payload payload(bytes);
  for (std::uint64_t number = 1; number <= kObservations; ++number) {
    while (!reader.has_news() || reader.read_latest(payload.bytes()).status != ipc::ReadStatus::fresh) {
    }
    latencies.push_back(ns_between(payload.stamped(), ticks()));
    if (!payload.is_whole(number)) ++result.torn;
    shared->seen.store(number, std::memory_order_release);
  }
  result.latency = spread_of(latencies);
  return result;
}

HammeredRead hammered_read(const TwoCpus& cpus) {
  const ipc::RingShape shape = shape_of(512);
  const Shared<SharedRing> ring;
  const Shared<Signals> shared;
  ipc::SlotWriter writer(ring->memory, shape);
  ipc::SlotReader reader = attach(*ring, shape);
  ChildProcess hammer([&] {
    const Pinned pinned(cpus[0]);
    Payload payload(512);
    shared->ready.store(true);
    while (!shared->stop.load(std::memory_order_relaxed)) {
      payload.fill(writer.published() + 1);
      writer.publish(payload.bytes());
    }
  });
  wait_until(shared->ready);
  HammeredRead result;
  {
    const Pinned pinned(cpus[1]);
    std::vector<double> latencies;
    Payload payload(512);
    for (int i = 0; i < kHammeredReads; ++i) {
      spin_ns(1500.0);
      const std::int64_t begin = ticks();
      const ipc::ReadResult read = reader.read_latest(payload.bytes());
      const std::int64_t end = ticks();
      if (read.status == ipc::ReadStatus::nothing_new) continue;
      ++result.reads;
      latencies.push_back(ns_between(begin, end));
      result.worst_tries = std::max(result.worst_tries, read.tries);
      if (read.status == ipc::ReadStatus::contended) ++result.gave_up;
      if (read.status == ipc::ReadStatus::corrupt) ++result.torn;
      if (read.status == ipc::ReadStatus::fresh && !payload.is_whole(read.sequence)) ++result.torn;
    }
    result.latency = spread_of(latencies);
  }
  shared->stop.store(true);
  return result;
}

SameCore uncontended(int cpu) {
  const ipc::RingShape shape = shape_of(512);
  const Shared<SharedRing> ring;
  ipc::SlotWriter writer(ring->memory, shape);
  ipc::SlotReader reader = attach(*ring, shape);
  const Pinned pinned(cpu);
  std::vector<double> writes;
  std::vector<double> reads;
  Payload payload(512);
  Payload copy(512);
  for (std::uint64_t number = 1; number <= 20'000; ++number) {
    payload.fill(number);
    const std::int64_t begin = ticks();
    writer.publish(payload.bytes());
    const std::int64_t published = ticks();
    reader.read_latest(copy.bytes());
    const std::int64_t end = ticks();
    writes.push_back(ns_between(begin, published));
    reads.push_back(ns_between(published, end));
  }
  return {spread_of(writes), spread_of(reads)};
}

Spread record_push(int cpu) {
  const ipc::RingShape shape = ipc::tick_ring(12);
  const std::size_t bytes = ipc::ring_bytes(shape);
  void* const memory = mmap(nullptr, bytes, PROT_READ | PROT_WRITE, MAP_SHARED | MAP_ANONYMOUS | MAP_POPULATE, -1, 0);
  if (memory == MAP_FAILED) throw std::bad_alloc();
  ipc::SlotWriter writer({static_cast<std::byte*>(memory), bytes}, shape);
  const Pinned pinned(cpu);
  TickRecord record;
  record.header.joint_count = 12;
  const auto payload = std::as_bytes(std::span(&record, 1)).first(record.used_bytes());
  std::vector<double> pushes;
  timespec wake{};
  clock_gettime(CLOCK_MONOTONIC, &wake);
  for (int i = 0; i < kRecords; ++i) {
    wake.tv_nsec += 1'000'000;
    if (wake.tv_nsec >= 1'000'000'000) {
      wake.tv_nsec -= 1'000'000'000;
      ++wake.tv_sec;
    }
    clock_nanosleep(CLOCK_MONOTONIC, TIMER_ABSTIME, &wake, nullptr);
    ++record.header.tick;
    const std::int64_t begin = ticks();
    writer.publish(payload);
    pushes.push_back(ns_between(begin, ticks()));
  }
  munmap(memory, bytes);
  return spread_of(pushes);
}

int readable_after_kill(const TwoCpus& cpus, int rounds) {
  std::minstd_rand random(2);
  int readable = 0;
  for (int round = 0; round < rounds; ++round) {
    const ipc::RingShape shape = shape_of(512);
    const Shared<SharedRing> ring;
    const Shared<Signals> shared;
    ipc::SlotWriter writer(ring->memory, shape);
    ipc::SlotReader reader = attach(*ring, shape);
    ChildProcess hammer([&] {
      run_on({cpus[0]});
      Payload payload(512);
      for (;;) {
        payload.fill(writer.published() + 1);
        writer.publish(payload.bytes());
        shared->ready.store(true, std::memory_order_relaxed);
      }
    });
    wait_until(shared->ready);
    usleep(static_cast<useconds_t>(random() % 400));
    hammer.kill_now();
    Payload payload(512);
    const ipc::ReadResult read = reader.read_latest(payload.bytes());
    readable += read.status == ipc::ReadStatus::fresh && payload.is_whole(read.sequence) ? 1 : 0;
  }
  return readable;
}

}  // namespace takt::bench

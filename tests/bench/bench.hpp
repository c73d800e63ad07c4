// SPDX-License-Identifier: Apache-2.0
// What the benchmark programs share: a clock of a few nanoseconds, order statistics, pinning and real-time scheduling
// with a way back, memory shared with forked children, and output as text for people or as JSON rows for scripts.
//
// Rules of measurement here: processes are forked from an unpinned parent without real-time priority (a spinning FIFO
// parent starves its own fork), every spin is bounded by a short phase, repetitions of different things are interleaved
// and figures are medians over repetitions; p50 and p99 only, for virtual machines stall at times.
#pragma once

#include <sched.h>
#include <sys/mman.h>
#include <sys/prctl.h>
#include <sys/wait.h>
#include <unistd.h>

#include <algorithm>
#include <chrono>
#include <cmath>
#include <csignal>
#include <cstdint>
#include <cstdio>
#include <iostream>
#include <new>
#include <nlohmann/json.hpp>
#include <stdexcept>
#include <string>
#include <vector>

#if defined(__x86_64__)
#include <x86intrin.h>
#endif

namespace takt::bench {

// --- time ---

// Ticks of the cheapest monotonic counter that all cores share.
inline std::int64_t ticks() {
#if defined(__x86_64__)
  return static_cast<std::int64_t>(__rdtsc());
#else
  return std::chrono::steady_clock::now().time_since_epoch().count();
#endif
}

// Measured once, over 50 ms; fork after the first call.
inline double ns_per_tick() {
  static const double ratio = [] {
    using Clock = std::chrono::steady_clock;
    const auto begin = Clock::now();
    const std::int64_t begin_ticks = ticks();
    while (Clock::now() - begin < std::chrono::milliseconds(50)) {
    }
    const std::chrono::nanoseconds elapsed = Clock::now() - begin;
    return static_cast<double>(elapsed.count()) / static_cast<double>(ticks() - begin_ticks);
  }();
  return ratio;
}

inline void spin_ns(double ns) {
  const std::int64_t until = ticks() + static_cast<std::int64_t>(ns / ns_per_tick());
  while (ticks() < until) {
  }
}

// --- order statistics ---

// Nearest rank: the smallest sample that at least `fraction` of all samples do not exceed. NaN without samples.
inline double percentile(std::vector<double> samples, double fraction) {
  if (samples.empty()) return std::nan("");
  const auto rank = static_cast<std::size_t>(std::ceil(fraction * static_cast<double>(samples.size())));
  const auto nth = samples.begin() + static_cast<std::ptrdiff_t>(std::max<std::size_t>(rank, 1) - 1);
  std::ranges::nth_element(samples, nth);
  return *nth;
}
inline double median(std::vector<double> samples) {
  return percentile(std::move(samples), 0.5);
}

// --- scheduling ---

// The processors this process may run on.
inline std::vector<int> allowed_cpus() {
  cpu_set_t set;
  CPU_ZERO(&set);
  sched_getaffinity(0, sizeof set, &set);
  std::vector<int> cpus;
  for (std::size_t cpu = 0; cpu < CPU_SETSIZE; ++cpu) {
    if (CPU_ISSET(cpu, &set)) cpus.push_back(static_cast<int>(cpu));
  }
  return cpus;
}

inline void run_on(const std::vector<int>& cpus) {
  cpu_set_t set;
  CPU_ZERO(&set);
  for (const int cpu : cpus) CPU_SET(static_cast<std::size_t>(cpu), &set);
  sched_setaffinity(0, sizeof set, &set);
}

// SCHED_FIFO at `priority`, or back to SCHED_OTHER with 0. False where the rights are missing.
inline bool set_fifo(int priority) {
  const sched_param parameter{.sched_priority = priority};
  return sched_setscheduler(0, priority > 0 ? SCHED_FIFO : SCHED_OTHER, &parameter) == 0;
}

// This thread on one processor and in real time while the object lives.
class Pinned {
 public:
  explicit Pinned(int cpu, int priority = 50) : before_(allowed_cpus()) {
    run_on({cpu});
    is_realtime_ = set_fifo(priority);
  }
  Pinned(const Pinned&) = delete;
  Pinned& operator=(const Pinned&) = delete;
  ~Pinned() {
    set_fifo(0);
    run_on(before_);
  }
  [[nodiscard]] bool is_realtime() const { return is_realtime_; }

 private:
  std::vector<int> before_;
  bool is_realtime_ = false;
};

// --- processes and shared memory ---

// A value-initialised T in memory that forked children share.
template <class T>
class Shared {
 public:
  Shared() {
    void* const at = mmap(nullptr, sizeof(T), PROT_READ | PROT_WRITE, MAP_SHARED | MAP_ANONYMOUS | MAP_POPULATE, -1, 0);
    if (at == MAP_FAILED) throw std::bad_alloc();
    value_ = new (at) T{};
  }
  Shared(const Shared&) = delete;
  Shared& operator=(const Shared&) = delete;
  ~Shared() { munmap(value_, sizeof(T)); }
  T& operator*() const { return *value_; }
  T* operator->() const { return value_; }

 private:
  T* value_;
};

// A forked child that runs `body` and exits; it never outlives its parent or 60 s.
class ChildProcess {
 public:
  template <class Body>
  explicit ChildProcess(Body body) : pid_(fork()) {
    if (pid_ < 0) throw std::runtime_error("fork failed");
    if (pid_ != 0) return;
    prctl(PR_SET_PDEATHSIG, SIGKILL);
    alarm(60);
    body();
    _exit(0);
  }
  ChildProcess(const ChildProcess&) = delete;
  ChildProcess& operator=(const ChildProcess&) = delete;
  ~ChildProcess() { wait(); }
  void kill_now() { end_with(SIGKILL); }
  void terminate() { end_with(SIGTERM); }
  void wait() {
    if (pid_ > 0) waitpid(pid_, nullptr, 0);
    pid_ = 0;
  }

 private:
  void end_with(int signal) {
    if (pid_ > 0) kill(pid_, signal);
    wait();
  }
  pid_t pid_;
};

// --- output ---

class Report {
 public:
  explicit Report(bool as_json) : as_json_(as_json) {}
  // One figure: the text for people, the row for scripts (one JSON object per line). Only one of them is printed.
  void figure(const std::string& text, const nlohmann::ordered_json& row) const {
    std::cout << (as_json_ ? row.dump() : text) << '\n' << std::flush;
  }
  void remark(const std::string& text) const { (as_json_ ? std::cerr : std::cout) << text << '\n' << std::flush; }

 private:
  bool as_json_;
};

}  // namespace takt::bench

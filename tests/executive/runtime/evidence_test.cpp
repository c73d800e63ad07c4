// SPDX-License-Identifier: Apache-2.0
// Goal: the evidence moves with what it stands for. Method: do each thing for real on this thread; only lower bounds
// are checked, since a busy machine adds to every one of them.
#include "executive/runtime/evidence.hpp"

#include <gtest/gtest.h>
#include <sys/mman.h>

#include "executive/runtime/clock.hpp"

namespace takt::runtime {
namespace {

class EvidenceTest : public testing::Test {
 protected:
  Evidence during(const auto& act) {
    const Evidence before = source_.read();
    act();
    return source_.read() - before;
  }
  EvidenceSource source_ = EvidenceSource::open().value();
};

TEST_F(EvidenceTest, SleepingIsAVoluntarySwitch) {
  SystemClock clock;
  const Evidence spent = during([&] { clock.sleep_until(clock.now() + milliseconds(2)); });
  EXPECT_GE(spent.voluntary_switches, 1);
}

TEST_F(EvidenceTest, ComputingIsCpuTimeAndNoVoluntarySwitch) {
  const Evidence spent = during([&] {
    const Evidence begin = source_.read();
    while ((source_.read() - begin).cpu < milliseconds(2)) {
    }
  });
  EXPECT_GE(spent.cpu, milliseconds(2));
  EXPECT_EQ(spent.voluntary_switches, 0);
}

TEST_F(EvidenceTest, TouchingFreshPagesIsMinorFaults) {
  constexpr std::size_t kPages = 200;
  constexpr std::size_t kBytes = kPages * 4096;
  void* const memory = mmap(nullptr, kBytes, PROT_READ | PROT_WRITE, MAP_PRIVATE | MAP_ANONYMOUS, -1, 0);
  ASSERT_NE(memory, MAP_FAILED);
  madvise(memory, kBytes, MADV_NOHUGEPAGE);
  auto* const bytes = static_cast<volatile char*>(memory);
  const Evidence spent = during([&] {
    for (std::size_t page = 0; page < kPages; ++page) bytes[page * 4096] = 1;
  });
  EXPECT_GE(spent.minor_faults, static_cast<std::int64_t>(kPages));
  munmap(memory, kBytes);
}

}  // namespace
}  // namespace takt::runtime

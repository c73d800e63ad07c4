// SPDX-License-Identifier: Apache-2.0
// Goal: no driver takes anything from the heap after construction, whatever it is told and hears. Method: operator new
// of this program counts; every driver is abused between two readings. A planted allocation shows that the counter
// counts.
#include <gtest/gtest.h>

#include <cstdlib>
#include <new>
#include <random>

#include "config/load.hpp"
#include "tests/drivers/protocol/every_driver.hpp"

namespace {
long g_allocations = 0;
}

void* operator new(std::size_t size) {
  ++g_allocations;
  if (void* const memory = std::malloc(size)) return memory;
  throw std::bad_alloc();
}
void operator delete(void* memory) noexcept {
  std::free(memory);
}
void operator delete(void* memory, std::size_t /*size*/) noexcept {
  std::free(memory);
}

namespace takt::drivers {
namespace {

long allocations_of_abuse(test::AbusedDriver& driver, bool planted) {
  std::mt19937_64 random(1);
  std::array<std::uint8_t, 72> bytes{};
  const long before = g_allocations;
  for (int i = 0; i < 100'000; ++i) {
    for (std::size_t at = 0; at < bytes.size(); at += 8) {
      const std::uint64_t word = random();
      std::memcpy(&bytes[at], &word, 8);
    }
    const bool sound = driver.frame(bytes).empty() && driver.setpoint(i % 1000 > 100, bytes).empty();
    if (!sound) return -1;
    if (planted && i == 5) ::operator delete(::operator new(8));
  }
  return g_allocations - before;
}

TEST(DriverAllocation, TheCounterCounts) {
  const config::RobotConfig robot = config::load("config/dual_arm12.yaml").value();
  auto drivers = test::one_of_each(robot);
  EXPECT_EQ(allocations_of_abuse(drivers.front(), true), 1);
}

TEST(DriverAllocation, NoDriverAllocatesOnTheControlThread) {
  const config::RobotConfig robot = config::load("config/dual_arm12.yaml").value();
  auto drivers = test::one_of_each(robot);
  for (test::AbusedDriver& driver : drivers) EXPECT_EQ(allocations_of_abuse(driver, false), 0) << driver.name();
}

}  // namespace
}  // namespace takt::drivers

// SPDX-License-Identifier: Apache-2.0
// Goal: whatever arrives on the bus and whatever is asked of it, a driver of any protocol survives, reports numbers,
// and sends legal frames with its own drive's ids only; and so does the last guard, whatever frame it is
// given. Method: a million random frames per driver, with random
// setpoints (infinities and NaN among them) in between; seeded. The fuzzer of tests/fuzz looks where this does not.
#include "tests/drivers/protocol/every_driver.hpp"

#include <gtest/gtest.h>

#include <random>

#include "config/load.hpp"

namespace takt::drivers {
namespace {

constexpr int kFrames = 1'000'000;

TEST(EveryDriver, SurvivesAMillionRandomFrames) {
  const config::RobotConfig robot = config::load("config/dual_arm12.yaml").value();
  auto drivers = test::one_of_each(robot);
  EXPECT_EQ(drivers.size(), 6U) << "five protocols, one of them in two variants";
  std::mt19937_64 random(1);
  for (test::AbusedDriver& driver : drivers) {
    std::array<std::uint8_t, 72> bytes{};
    for (int i = 0; i < kFrames; ++i) {
      for (std::size_t at = 0; at < bytes.size(); at += 8) {
        const std::uint64_t word = random();
        std::memcpy(&bytes[at], &word, 8);
      }
      std::string wrong = driver.frame(bytes);
      if (i % 4 == 0 && wrong.empty()) wrong = driver.setpoint(bytes[70] % 8 != 0, bytes);
      if (i % 4 == 1 && wrong.empty()) wrong = driver.guarded(bytes[70] % 2 != 0, bytes);
      ASSERT_EQ(wrong, "") << driver.name() << ", frame " << i;
    }
  }
}

}  // namespace
}  // namespace takt::drivers

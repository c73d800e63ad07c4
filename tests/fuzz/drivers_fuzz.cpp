// SPDX-License-Identifier: Apache-2.0
// Fuzzes every drive protocol's host side, and the last guard on what leaves: the input is a sequence of frames and
// setpoints of 32 bytes each; the first byte chooses which and whose. See tests/drivers/protocol/every_driver.hpp for
// what must hold.
#include <cstdio>
#include <cstdlib>

#include "config/load.hpp"
#include "tests/drivers/protocol/every_driver.hpp"

extern "C" int LLVMFuzzerTestOneInput(const std::uint8_t* data, std::size_t size) {
  using namespace takt;
  constexpr std::size_t kStep = 32;
  static const config::RobotConfig robot = config::load("config/dual_arm12.yaml").value();
  auto drivers = drivers::test::one_of_each(robot);
  for (std::span<const std::uint8_t> left(data, size); left.size() >= 2;) {
    const auto step = left.first(std::min(kStep, left.size()));
    auto& driver = drivers[step[0] % drivers.size()];
    const bool is_frame = (step[0] & 0x80U) != 0;
    const bool enable = (step[0] & 0x40U) != 0;
    std::string wrong = is_frame ? driver.frame(step.subspan(1)) : driver.setpoint(enable, step.subspan(1));
    if (wrong.empty()) wrong = driver.guarded(enable, step.subspan(1));
    if (!wrong.empty()) {
      std::fprintf(stderr, "%s: %s\n", std::string(driver.name()).c_str(), wrong.c_str());
      std::abort();
    }
    left = left.subspan(step.size());
  }
  return 0;
}
